"""A scene through a sensor into a file, block by block, for `record` and `film`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spikecam_env.checked import checked_disk, checked_memory
from spikecam_env.errors import InputError
from spikecam_env.whole import check_file

if TYPE_CHECKING:
    from scenes import Scene
    from spikecam_env.sensor import SpikeSensor

BLOCK = 64
"""Frames simulated and written at a time; a multiple of the chunks of the .h5 file."""
HDF5 = (".h5", ".hdf5")


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


def check_out(out: Path, frames: int, shape: tuple[int, int], truth_every: int | None = 0) -> None:
    """Refuse a recording that cannot be written, before the work.

    Raises:
        InputError: a file type that no recording has, or that has no room for truth; a place that cannot be written to;
            or more frames than the disk, or for a .npz the memory, has room for.
    """
    from spikecam_env.streams.packing import packed_bytes
    from spikecam_env.streams.side_file import side_path

    suffix = out.suffix.lower()
    if suffix not in (*HDF5, ".dat", ".npz"):
        raise InputError(f"--out {out}: unknown file type {suffix!r}; use .h5, .dat or .npz")
    if truth_every and suffix not in HDF5:
        raise InputError(f"--out {out}: truth (--truth-every {truth_every}) is kept in .h5 files only")
    check_file(out)
    if suffix == ".dat":
        check_file(side_path(out))
    if suffix == ".npz":
        checked_memory(2 * frames * math.prod(shape), f"{frames} frames in a .npz")
    else:
        checked_disk(frames * packed_bytes(shape), out, f"{frames} frames")


def record_scene(
    out: Path,
    scene: Scene,
    sensor: SpikeSensor,
    frames: int,
    title: str,
    attributes: dict[str, object],
    truth: range = range(0),
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

    Returns:
        The number of spikes.
    """
    from tqdm import trange

    spikes = 0
    with _appending(out, scene, sensor, attributes) as (append, append_truth):
        for start in trange(0, frames, BLOCK, desc=title, unit="block", leave=False):
            count = min(BLOCK, frames - start)
            block = sensor.step(scene.radiance(start, start + count), count)
            append(block)
            for frame in range(start, start + count):
                if frame in truth:
                    append_truth(frame)
            spikes += int(block.sum())
    return spikes


@contextmanager
def _appending(
    out: Path, scene: Scene, sensor: SpikeSensor, attributes: dict[str, object]
) -> Iterator[tuple[Callable[[Any], object], Callable[[int], object]]]:
    """A function that takes (T, H, W) spikes, block after block, and one that adds the truth of a frame (.h5 only)."""
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
                yield lambda block: file.write(pack_frames(block).tobytes()), _no_truth
            write_side_file(out, {"height": rows, "width": columns, "frame_rate_hz": sensor.model.frame_rate_hz})
    else:
        blocks: list[Any] = []
        yield blocks.append, _no_truth
        save_npz(out, np.concatenate(blocks))


def _no_truth(frame: int) -> None:
    raise AssertionError("check_out lets truth into .h5 files only")
