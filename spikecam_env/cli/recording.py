"""A scene through a sensor into a file, block by block, for `record` and `film`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spikecam_env.checked import amount, checked_disk, checked_memory
from spikecam_env.errors import InputError
from spikecam_env.whole import check_file

if TYPE_CHECKING:
    from scenes import Scene
    from spikecam_env.sensor import SpikeSensor

BLOCK = 64
"""Frames simulated and written at a time; a multiple of the chunks of the .h5 file."""
HDF5 = (".h5", ".hdf5")
TRIAL_S, TRIAL_SHARE = 1.0, 0.05
"""Of a trial before a recording, from which its time is told: its length [s], and its share of the frames, at most."""


def lit_frames(out: Path, frames: int, every: int | None) -> range:
    """Frames of a recording whose true light is kept.

    Args:
        out: The recording; .h5 alone has room for truth.
        frames: Its length.
        every: Frames between two; 0: none; None: the frame in the middle, where there is room.
    """
    from spikecam_env.datasets.write import truth_frames

    if every is None:
        return range(frames // 2, frames // 2 + 1) if out.suffix.lower() in HDF5 else range(0)
    return truth_frames(every, 0, frames)


def check_out(
    out: Path, frames: int, shape: tuple[int, int], truth_every: int | None = 0, *, clean: bool = False
) -> None:
    """Refuse a recording that cannot be written, before the work.

    Raises:
        InputError: a file type that no recording has, or that has no room for truth or a clean twin; a place that
            cannot be written to; or more frames than the disk, or for a .npz the memory, has room for.
    """
    from spikecam_env.streams.side_file import side_path

    suffix = out.suffix.lower()
    if suffix not in (*HDF5, ".dat", ".npz"):
        raise InputError(f"--out {out}: unknown file type {suffix!r}; use .h5, .dat or .npz")
    if truth_every and suffix not in HDF5:
        raise InputError(f"--out {out}: truth (--truth-every {truth_every}) is kept in .h5 files only")
    if clean and suffix not in HDF5:
        raise InputError(f"--out {out}: a clean twin (--clean) is kept in .h5 files only")
    check_file(out)
    if suffix == ".dat":
        check_file(side_path(out))
    if suffix == ".npz":
        checked_memory(2 * frames * math.prod(shape), f"{frames} frames in a .npz")
    else:
        checked_disk(_bytes(frames, shape, clean), out, f"{frames} frames")


def _bytes(frames: int, shape: tuple[int, int], clean: bool) -> int:
    """Bytes of a recording's bits."""
    from spikecam_env.streams.packing import packed_bytes

    return (2 if clean else 1) * frames * packed_bytes(shape)


def size_and_time(out: Path, scene: Scene, sensor: SpikeSensor, frames: int, *, clean: bool = False) -> str:
    """A line that says how large a recording will be and, if it is long, about how long it will take.

    The time is that of a trial, after which the sensor is as it was before.
    """
    size = amount(_bytes(frames, sensor.shape, clean))
    line = f"{out}: {frames} frames ({frames / sensor.model.frame_rate_hz:.3g} s), {size}"
    if clean:
        line += " with the clean twin"
    seconds = _trial(scene, sensor, frames, clean)
    return line if seconds is None else f"{line}, about {_duration(seconds)}"


def _trial(scene: Scene, sensor: SpikeSensor, frames: int, clean: bool) -> float | None:
    """Seconds that a recording will take, by its first blocks; None where it is too short for a trial."""
    blocks = int(TRIAL_SHARE * frames) // BLOCK
    if blocks < 2:
        return None
    before, twin = sensor.state(), sensor.clean_twin() if clean else None
    for number, start in enumerate(range(0, blocks * BLOCK, BLOCK)):
        if number == 1:  # the first one compiles
            began = time.perf_counter()
        _step(scene, sensor, twin, start, BLOCK)
        if number and time.perf_counter() - began > TRIAL_S:
            break
    sensor.restore(before)
    return (time.perf_counter() - began) * frames / (number * BLOCK)


def _duration(seconds: float) -> str:
    """`40 s`, `3 min`, `2.5 h`."""
    for unit, length in (("s", 1), ("min", 60)):
        if seconds < 90 * length:
            return f"{max(1, round(seconds / length))} {unit}"
    return f"{seconds / 3600:.1f} h"


def _step(scene: Scene, sensor: SpikeSensor, twin: SpikeSensor | None, start: int, count: int) -> tuple[Any, Any]:
    """The next frames of the sensor, and of its twin where there is one."""
    light = scene.radiance(start, start + count)
    return sensor.step(light, count), None if twin is None else twin.step(light, count)


def record_scene(
    out: Path,
    scene: Scene,
    sensor: SpikeSensor,
    frames: int,
    title: str,
    attributes: dict[str, object],
    truth: range = range(0),
    *,
    clean: bool = False,
) -> int:
    """Record a scene.  Beside a .dat file, its geometry and frame rate go to `<name>.dat.json`.

    Args:
        out: .h5, .dat or .npz file, which appears whole.
        scene: light of the recording.
        sensor: camera.
        frames: length of the recording.
        title: for the progress bar.
        attributes: for a .h5 file.
        truth: frames whose ground truth is kept, in a .h5 file.
        clean: whether the noise-free twin's spikes are kept beside, in a .h5 file.

    Returns:
        The number of spikes.
    """
    from tqdm import trange

    spikes = 0
    twin = sensor.clean_twin() if clean else None
    with _appending(out, scene, sensor, attributes) as (append, append_truth):
        for start in trange(0, frames, BLOCK, desc=title, unit="block", leave=False):
            count = min(BLOCK, frames - start)
            block, beside = _step(scene, sensor, twin, start, count)
            append(block, beside)
            for frame in range(start, start + count):
                if frame in truth:
                    append_truth(frame)
            spikes += int(block.sum())
    return spikes


@contextmanager
def _appending(
    out: Path, scene: Scene, sensor: SpikeSensor, attributes: dict[str, object]
) -> Iterator[tuple[Callable[[Any, Any], object], Callable[[int], object]]]:
    """A function that takes (T, H, W) spikes and those of a twin or None, and one that adds the truth of a frame; .h5
    alone has room for twins and truth."""
    import numpy as np

    from spikecam_env.datasets.write import append_truth
    from spikecam_env.streams import SpikeWriter, pack_frames, save_npz
    from spikecam_env.streams.side_file import write_side_file
    from spikecam_env.whole import whole_file

    suffix = out.suffix.lower()
    if suffix in HDF5:
        with SpikeWriter(out, sensor.shape, sensor.model.frame_rate_hz, **attributes) as writer:
            yield writer.append, lambda frame: append_truth(writer, scene, frame)
    elif suffix == ".dat":
        rows, columns = sensor.shape
        with whole_file(out) as beside:
            with beside.open("wb") as file:
                yield lambda block, _: file.write(pack_frames(block).tobytes()), _no_truth
            write_side_file(out, {"height": rows, "width": columns, "frame_rate_hz": sensor.model.frame_rate_hz})
    else:
        blocks: list[Any] = []
        yield lambda block, _: blocks.append(block), _no_truth
        save_npz(out, np.concatenate(blocks))


def _no_truth(frame: int) -> None:
    raise AssertionError("check_out lets truth into .h5 files only")
