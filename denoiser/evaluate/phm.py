"""PHM_N: the ten scenes of `spikecam dataset phm-n`, at true speed or another, simulated or from a dataset.

The picture is of the middle frame.  The frames about it are judged: as many as its pictures look at, and three mean
intervals on either side, so that TFI finds whole intervals in most pixels.  At least WARM_UP frames come before
the picture, by default before all that is judged.
Seed 0 is the camera of the dataset with seed 0; other seeds are other cameras before the same scene.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from denoiser.evaluate.case import ExposedStreams, StreamCase
from denoiser.training.pairs import light_in_frame
from scenes.catalogue import make_scene
from scenes.derived.faster import at_speed
from scenes.protocol import Scene
from spikecam_env.datasets import PHM, phm_n
from spikecam_env.datasets.manifest import Manifest
from spikecam_env.datasets.plan import panned
from spikecam_env.datasets.renderer import AUTO, renderer_of_process
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.streams.hdf5 import open_recording
from spikecam_env.types import Spikes

SCENES = PHM
INTERVALS = (3.0, 10.0, 40.0, 100.0)
"""Mean frames between spikes, of the tables about dim light; the paper's sets are at about 10."""
WARM_UP = 100
"""Least frames before the picture: noisy and clean twins have lost their common phase after some 60, and the
denoiser's running means need a past."""
WINDOW = 50
"""Frames on either side of the middle that are judged, at least: pictures look at 20, the search for lag at 24 and
more (`measures.lag_frames`)."""
INTERVALS_SEEN = 3
"""Mean intervals on either side of the middle: longer than the interval of pixels a third as bright as the mean."""
AHEAD = 64
"""Frames after the judged ones that are simulated too: more than any denoiser's latency."""


def reach(interval: float) -> int:
    """Frames that are judged on either side of the middle."""
    return max(WINDOW, 20 + round(INTERVALS_SEEN * interval))


def default_frames(interval: float) -> int:
    """Length of a stream whose middle has enough frames before it."""
    return 2 * (WARM_UP + reach(interval))


def dataset_cases(folder: str | Path) -> list[StreamCase]:
    """The scenes of a dataset that `spikecam dataset phm-n` made; InputError for a folder that holds none, or
    unfinished files."""
    manifest = Manifest.read(Path(folder)).without_lost(Path(folder))
    settings = manifest.settings
    rows, columns = settings["shape"]
    if settings.get("mean_interval") is None:
        raise InputError(f"{folder} holds cuts of films; give a dataset of `spikecam dataset phm-n`")
    for file in manifest.files:
        if file["sha256"] is None:
            raise InputError(f"{folder} has no whole {file['path']}; run `spikecam dataset` again to make it")
    return [
        StreamCase(
            Path(file["path"]).stem,
            file["scene_seed"],
            (rows, columns),
            settings["frames"],
            settings["mean_interval"],
            folder=str(folder),
            pan=manifest.pan,
        )
        for file in manifest.files
    ]


def expose(case: StreamCase) -> ExposedStreams:
    """The case's streams and light."""
    middle = case.frames // 2
    around = min(reach(case.interval), middle)
    first, stop = middle - around, min(middle + around + 1, case.frames)
    seen = min(stop + AHEAD, case.frames)
    scene, noisy, clean = scene_and_streams(case, seen)
    keys = scene.radiance(first, stop)
    light = np.stack([light_in_frame(keys, t) for t in range(first, stop)])
    return ExposedStreams(noisy, clean, light, first, stop, middle, white=float(light.max()))


def scene_and_streams(case: StreamCase, frames: int) -> tuple[Scene, Spikes, Spikes]:
    """The case's scene, and the first frames of its noisy stream and of its clean twin's."""
    return _from_dataset(case, frames) if case.folder else _simulated(case, frames)


def scene_of(case: StreamCase) -> Scene:
    """The case's scene, as the camera sees it."""
    if case.folder:
        manifest = Manifest.read(Path(case.folder))
        return manifest.scene(_file_of(manifest, case))
    scene = make_scene(case.scene, case.shape, 0, case.interval, renderer=renderer_of_process(AUTO))
    return panned(at_speed(scene, case.speed) if case.speed else scene, case.pan, case.frames)


def _simulated(case: StreamCase, frames: int) -> tuple[Scene, Spikes, Spikes]:
    plan = phm_n(scenes=(case.scene,), seed=case.seed)
    scene = scene_of(case)
    camera = SpikeSensor(SensorModel.preset("scsim"), case.shape, plan.entries[0].unit_seed, engine="auto")
    twin = camera.clean_twin()
    light = scene.radiance(0, frames)
    return scene, camera.step(light, frames), twin.step(light, frames)


def _from_dataset(case: StreamCase, frames: int) -> tuple[Scene, Spikes, Spikes]:
    folder = Path(case.folder)
    manifest = Manifest.read(folder)
    file = _file_of(manifest, case)
    with open_recording(folder / file["path"]) as recording:
        rows, columns = (slice(0, n) for n in case.shape)
        noisy, clean = (recording.read_crop(s, slice(0, frames), rows, columns) for s in ("spikes", "clean"))
    return manifest.scene(file), noisy, clean


def _file_of(manifest: Manifest, case: StreamCase) -> dict[str, Any]:
    return next(f for f in manifest.files if Path(f["path"]).stem == case.scene)
