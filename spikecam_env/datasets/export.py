"""Recordings with ground truth in the layout of others, for their networks.

Spike-Zoo   a clip is cut out about a frame whose light is known: `frames` frames, the known one in the middle
SCFlow      windows from end to end, and the optical flow from each to the next: scenes of datasets are made again for
            it

Either takes the noisy stream, the clean twin's, or that of a denoiser.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from scenes.derived.flow import displacement
from scenes.protocol import Scene
from spikecam_env.checked import checked_count, checked_disk
from spikecam_env.datasets.manifest import Manifest
from spikecam_env.datasets.scflow import (
    INTERVALS,
    REACH,
    first_frames,
    scene_folder,
    write_flows,
    write_windows,
)
from spikecam_env.datasets.spikezoo import CLIP_FRAMES, RATE, Bits, write_clip
from spikecam_env.errors import InputError
from spikecam_env.names import distinct
from spikecam_env.streams.hdf5 import open_recording, read_hdf5
from spikecam_env.streams.packing import check_range
from spikecam_env.types import Pictures, Spikes
from spikecam_env.untrusted import hdf5_values, numbers
from spikecam_env.whole import whole_folder, write_text_whole

RECORD = "export.json"
"""Beside the clips: how they were made."""
Restore = Callable[[Spikes], tuple[Spikes, dict[str, Any]]]
"""(T, H, W) spikes of a whole recording -> as many of a denoiser, and how it was set, for the record."""


@dataclass(frozen=True)
class Exported:
    """A clip of an export."""

    split: str
    """"train" or "test"."""
    name: str
    source: str
    """File name of the recording."""
    frame: int
    """Frame in its middle."""
    light: float
    """Mean light [spikes/frame]."""
    cut: float
    """Share of its pixels that are brighter than white."""
    denoiser: dict[str, Any] = field(default_factory=dict)
    """How the stream was denoised; empty where it was not."""


def export_spikezoo(
    sources: Sequence[str | Path],
    out: str | Path,
    *,
    frames: int = CLIP_FRAMES,
    clips: int = 1,
    first: int = 0,
    count: int | None = None,
    rate: float = RATE,
    bits: Bits = 8,
    stream: str = "spikes",
    restore: Restore | None = None,
    progress: bool = False,
) -> list[Exported]:
    """Write Spike-Zoo's layout (`datasets.spikezoo`) from recordings (.h5) and folders of datasets.

    Args:
        sources: recordings and folders.
        out: a new folder, which appears whole: test/ and train/ as a dataset has them, test/ for recordings by
            themselves, and `export.json`.
        frames: of a clip, odd; the frame of known light is in the middle.
        clips: most from one recording, spread evenly over its frames of known light.
        first: frame of a recording from which on clips are cut.
        count: frames from there on, of which clips are cut; default all.
        rate: light [spikes/frame] that is white.
        bits: of a pixel of the picture, 8 or 16.
        stream: "spikes", or "clean" for the noise-free twin's.
        restore: a denoiser that the stream goes through from its first frame.
        progress: whether a bar over recordings is shown.

    Raises:
        InputError: for no source, an even number of frames, two recordings of one name, and as of `write_clip`; for a
            recording without truth, or without enough frames about it.
        WriteError: for a folder that exists already.
    """
    if not sources:
        raise InputError("nothing to export; give folders of datasets or .h5 recordings")
    if checked_count(frames, "frames") % 2 == 0:
        raise InputError(f"frames = {frames}; it must be odd: the frame of known light is in the middle")
    clips = checked_count(clips, "clips")
    recordings = [(split, path) for source in sources for split, path in _recordings(Path(source))]
    distinct((f"{split}/{path.stem}" for split, path in recordings), "recording")
    done: list[Exported] = []
    with whole_folder(out) as folder:
        for split, path in tqdm(recordings, desc="export", unit="recording", leave=False, disable=not progress):
            for row, frame in _middles(path, frames, clips, first, count):
                name = f"{path.stem}-{frame}"
                spikes, how = _cut(path, frame - frames // 2, frames, stream, restore)
                light = _light(path, row, spikes.shape[1:])
                cut = write_clip(folder / split, name, spikes, light, rate, bits)
                done.append(Exported(split, name, path.name, frame, float(light.mean()), cut, how))
        settings = {"layout": "spikezoo", "rate": rate, "bits": bits, "frames": frames, "stream": stream}
        record: dict[str, Any] = {**settings, "clips": [asdict(clip) for clip in done]}
        write_text_whole(folder / RECORD, json.dumps(record, indent=1) + "\n")
    return done


@dataclass(frozen=True)
class ExportedWindows:
    """A scene of an export for SCFlow."""

    split: str
    """"train" or "test"."""
    scene: str
    """Its folder."""
    source: str
    """File name of the recording."""
    interval: int
    """Frames from a window to the next."""
    windows: int
    rate: float
    """Mean spikes a frame and pixel."""
    flow: float
    """Mean length of the flow from a window to the next [pixels]."""
    denoiser: dict[str, Any] = field(default_factory=dict)
    """How the stream was denoised; empty where it was not."""


def export_scflow(
    sources: Sequence[str | Path],
    out: str | Path,
    *,
    intervals: Sequence[int] = INTERVALS,
    stream: str = "spikes",
    restore: Restore | None = None,
    progress: bool = False,
) -> list[ExportedWindows]:
    """Write SCFlow's layout (`datasets.scflow`) from folders of datasets, a folder of scenes for each split.

    Args:
        sources: folders of datasets: their scenes are made again, for the flow from window to window.
        out: a new folder, which appears whole: test/, train/ and `export.json`.
        intervals: frames from a window to the next.
        stream: "spikes", or "clean" for the noise-free twin's.
        restore: a denoiser that the stream goes through from its first frame.
        progress: whether a bar over recordings is shown.

    Raises:
        InputError: for no source, one that is no dataset or is not finished, two scenes of one name, and recordings
            that are too short for two windows.
        WriteError: for a folder that exists already.
    """
    if not sources:
        raise InputError("nothing to export; give folders of datasets")
    files = [(split, path, scene) for source in sources for split, path, scene in _scenes(Path(source))]
    distinct((f"{split}/{scene_folder(path.stem)}" for split, path, _ in files), "scene")
    done: list[ExportedWindows] = []
    with whole_folder(out) as folder:
        for split, path, scene_again in tqdm(files, desc="export", unit="scene", leave=False, disable=not progress):
            spikes, how = _cut(path, 0, None, stream, restore)
            _check_room(spikes, intervals, out, path.stem)
            scene = scene_again()
            for interval in intervals:
                windows = write_windows(folder / split, path.stem, interval, spikes)
                flows = true_flows(scene, len(spikes), interval)
                write_flows(folder / split, path.stem, interval, flows)
                rate, mean = float(spikes.mean()), float(np.linalg.norm(np.stack(flows), axis=-1).mean())
                name = scene_folder(path.stem)
                done.append(ExportedWindows(split, name, path.name, interval, windows, rate, mean, how))
        record = {"layout": "scflow", "stream": stream, "scenes": [asdict(scene) for scene in done]}
        write_text_whole(folder / RECORD, json.dumps(record, indent=1) + "\n")
    return done


def true_flows(scene: Scene, frames: int, interval: int) -> list[Pictures]:
    """Flows (H, W, 2) [pixels] from each window of a recording of so many frames to the next, middle to middle."""
    return [displacement(scene, frame + 0.5, interval) for frame in first_frames(frames, interval)]


def _scenes(source: Path) -> Iterator[tuple[str, Path, Callable[[], Scene]]]:
    """(split, path, maker of the scene) of every recording of a dataset."""
    if not source.is_dir():
        raise InputError(f"{source} is no folder of a dataset; SCFlow's truth needs the scene, which a recording lacks")
    manifest = Manifest.read(source)
    for (split, path), file in zip(_recordings(source), manifest.files, strict=True):
        yield split, path, partial(manifest.scene, file)


def _check_room(spikes: Spikes, intervals: Sequence[int], out: str | Path, name: str) -> None:
    """InputError where the disk has no room for the windows and flows of a recording."""
    pixels = spikes[0].size
    size = sum(len(first_frames(len(spikes), interval)) * pixels * (2 * REACH + 1 + 8) for interval in intervals)
    checked_disk(size, out, f"windows of {name}")


def _cut(
    path: Path, first: int, count: int | None, stream: str, restore: Restore | None
) -> tuple[Spikes, dict[str, Any]]:
    """Frames of a stream, through a denoiser from its first frame where there is one, and how that was set."""
    if restore is None:
        return read_hdf5(path, first=first, count=count, stream=stream)[0], {}
    whole, how = restore(read_hdf5(path, stream=stream)[0])
    return whole[first : None if count is None else first + count], how


def _recordings(source: Path) -> list[tuple[str, Path]]:
    """(split, path) of every recording that a source means."""
    if not source.is_dir():
        return [("test", source)]
    files = Manifest.read(source).files
    if any(file["sha256"] is None for file in files):
        raise InputError(f"{source} is not finished; run its `spikecam dataset` command again")
    return [(file["path"].rpartition("/")[0].partition("/")[0] or "test", source / file["path"]) for file in files]


def _middles(path: Path, frames: int, most: int, first: int, count: int | None) -> list[tuple[int, int]]:
    """(row of its truth, frame) of frames of known light with room about them, at most so many, spread evenly.  All is
    inside the `count` frames from `first` on."""
    with open_recording(path) as recording:
        if "truth" not in recording.file.keys():  # noqa: SIM118 - `in` follows links
            raise InputError(f"{path} holds no truth; record it with --truth-every")
        instants = numbers(hdf5_values(recording.file, "truth/frame", str(path)), "truth/frame", str(path))
        first, stop = check_range(first, count, recording.frames("spikes"), str(path))
    reach = frames // 2
    whole = np.floor(instants.ravel())
    room = [(row, int(frame)) for row, frame in enumerate(whole) if first + reach <= frame < stop - reach]
    if not room:
        raise InputError(
            f"{path}: of {stop - first} frames, none of known light has {reach} before and after it; record more, "
            "or give fewer --frames"
        )
    taken = min(most, len(room))
    return [room[(2 * i + 1) * len(room) // (2 * taken)] for i in range(taken)]


def _light(path: Path, row: int, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """(H, W) light of a truth [spikes/frame]."""
    with open_recording(path) as recording:
        held = hdf5_values(recording.file, "truth/radiance", str(path), slice(row, row + 1))
    light = numbers(held, "truth/radiance", str(path)).astype(np.float64)
    if light.shape != (1, *shape) or not np.isfinite(light).all():
        raise InputError(f"{path}: truth/radiance has frames of {light.shape[1:]}; need finite numbers of {shape}")
    return np.asarray(light[0])
