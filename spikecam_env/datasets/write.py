"""One scene of a dataset: scene, camera and its noise-free twin, ground truth, into one file that appears whole."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenes.protocol import Scene
from spikecam_env.datasets.plan import AT_REST, Plan, PlannedScene
from spikecam_env.sensor import SpikeSensor
from spikecam_env.streams import SpikeWriter
from spikecam_env.whole import said_of

BLOCK = 64
"""Frames simulated and written at a time; a multiple of the chunks of the file."""

_READ_BYTES = 1 << 20


@dataclass(frozen=True)
class Written:
    """A file that is written."""

    entry: PlannedScene
    size: int
    """Bytes."""
    sha256: str
    seconds: dict[str, float]
    """Purpose -> time spent [s]."""
    processor_s: float
    """Processor time [s]."""


def write_scene(plan: Plan, entry: PlannedScene, folder: Path) -> Iterator[int | Written]:
    """Record one entry into `folder`.

    Yields:
        Numbers of frames done, piece by piece, and at the end the file.
    """
    clock, began = _Clock(), time.process_time()
    with clock.on("start"):
        scene = plan.scene(entry)
        camera = SpikeSensor(plan.model, plan.shape, entry.unit_seed, engine="auto")
        twin = camera.clean_twin()
        path = folder / entry.path
        with said_of(path):
            path.parent.mkdir(exist_ok=True)
        noisy, clean = (np.empty((BLOCK, *plan.shape), np.uint8) for _ in range(2))
    attributes = {**_attributes(plan, entry), "engine": camera.engine}
    with SpikeWriter(path, plan.shape, plan.model.frame_rate_hz, **attributes) as writer:
        for start in range(0, plan.frames, BLOCK):
            count = min(BLOCK, plan.frames - start)
            with clock.on("scene"):
                light = scene.radiance(start, start + count)
            with clock.on("noisy"):
                camera.step(light, count, out=noisy[:count])
            with clock.on("clean"):
                twin.step(light, count, out=clean[:count])
            with clock.on("file"):
                writer.append(noisy[:count], clean[:count])
            for frame in truth_frames(plan.truth_every, start, start + count):
                with clock.on("truth"):
                    append_truth(writer, scene, frame)
            yield count
    with clock.on("digest"):
        digest = sha256_of(path)
    yield Written(entry, path.stat().st_size, digest, clock.seconds, time.process_time() - began)


def truth_frames(every: int, start: int, stop: int) -> range:
    """Frames of start .. stop whose ground truth is kept: every so many, 0 for none."""
    return range(-(-start // every) * every, stop, every) if every else range(0)


def append_truth(writer: SpikeWriter, scene: Scene, frame: int) -> None:
    """Add the ground truth in the middle of a frame to a recording."""
    instant = frame + 0.5
    writer.append_truth(instant, **_truth(scene, instant))


def sha256_of(path: Path, progress: Callable[[int], object] | None = None) -> str:
    """SHA-256 of a file, in hexadecimal; `progress` is called with the numbers of bytes read, piece by piece."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(_READ_BYTES):
            digest.update(piece)
            if progress is not None:
                progress(len(piece))
    return digest.hexdigest()


def _attributes(plan: Plan, entry: PlannedScene) -> dict[str, Any]:
    settings = plan.settings()
    settings |= {name: value for name, value in settings.pop("films", {}).items() if value is not None}
    shared = {name: value for name, value in settings.items() if name not in ("shape", "frames", "kind", "pan")}
    if tuple(plan.pan) != AT_REST:
        shared |= {"pan_x": plan.pan[0], "pan_y": plan.pan[1]}
    own = {"scene": entry.scene, "scene_seed": entry.scene_seed, "unit_seed": entry.unit_seed}
    return {"dataset": plan.kind, **shared, **own}


def _truth(scene: Scene, instant: float) -> dict[str, Any]:
    """Arrays by name; depth is absent where the scene is flat, poses are as the scene documents them."""
    truth = scene.truth(instant)
    arrays = {"radiance": truth.radiance, "flow": truth.flow, "object_id": truth.object_id}
    if truth.depth is not None:
        arrays["depth"] = truth.depth
    return {**arrays, **{f"pose_{name}": np.asarray(pose, np.float64) for name, pose in truth.poses.items()}}


class _Clock:
    """Purpose -> seconds spent."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def on(self, purpose: str) -> Iterator[None]:
        begin = time.perf_counter()
        yield
        self.seconds[purpose] = self.seconds.get(purpose, 0.0) + time.perf_counter() - begin
