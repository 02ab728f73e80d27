"""SCFlow's layout: windows of spikes, and the optical flow from each to the next.

    <folder>/SCENE/encoding25_dt10/N.npy             (25, H, W) uint8, the 12 frames before and after a frame, upright
    <folder>/SCENE/dt=10/motion_vector/NNNN.flo      (H, W, 2) float32 [pixels], x to the right, then y down: how far
                                                     the point in each pixel goes from window N to N + 1

and the same of dt=20.  Its loader counts the windows from 0, and takes the truth of all but the last.  The middles of
windows are dt frames apart.  Spikes and truth are upright: its loader turns neither.

A .flo file is Middlebury's: the number 202021.25 as float32, columns and rows as int32, and the values row by row, all
with the lowest byte first.

Source: L. Hu, R. Zhao et al., CVPR 2022, https://github.com/Acnext/Optical-Flow-For-Spiking-Camera, `eval.py`,
`encoding/encoding.py`, `utils.py`.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.checked import checked_count
from spikecam_env.errors import InputError
from spikecam_env.types import Pictures, Spikes
from spikecam_env.untrusted import existing_file
from spikecam_env.whole import whole_file

REACH = 12
"""Frames of a window before its middle, and after it."""
INTERVALS = (10, 20)
"""Frames from a window to the next: it has weights for both."""
FIRST = 100
"""Frame of the first middle: noisy and clean twins have lost their common phase after some 60, and a denoiser has a
past."""
LAST_ROOM = 40
"""Frames after the last middle, as in its own windows."""
MAGIC = 202021.25
"""First number of a .flo file."""
HEADER = struct.Struct("<fii")
NAMES = {"doll": "dolldrop"}
"""Its names of scenes that have another one here."""


def scene_folder(name: str) -> str:
    """Its name of a scene: numbers of random scenes without zeros before them.

    Example:
        >>> scene_folder("doll"), scene_folder("ball"), scene_folder("007")
        ('dolldrop', 'ball', '7')
    """
    return str(int(name)) if name.isdecimal() else NAMES.get(name, name)


def first_frames(frames: int, interval: int) -> range:
    """Middles of the windows that have a next one, of a recording of so many frames.

    Example:
        >>> list(first_frames(200, 20))
        [100, 120, 140]
    """
    return range(FIRST, max(FIRST, frames - LAST_ROOM - interval + 1), checked_count(interval, "interval"))


def windows_file(folder: Path, scene: str, interval: int, number: int) -> Path:
    """Where a window of a scene is."""
    return folder / scene_folder(scene) / f"encoding{2 * REACH + 1}_dt{interval}" / f"{number}.npy"


def flow_file(folder: Path, scene: str, interval: int, number: int) -> Path:
    """Where the flow from a window to the next is."""
    return folder / scene_folder(scene) / f"dt={interval}" / "motion_vector" / f"{number:04d}.flo"


def write_windows(folder: Path, scene: str, interval: int, spikes: Spikes) -> int:
    """Write the windows of a recording (T, H, W), one after another.

    Args:
        folder: of the scenes.
        scene: its name in the catalogue.
        interval: frames from a window to the next.
        spikes: (T, H, W) 0 or 1.

    Returns:
        The number of windows.

    Raises:
        InputError: for a recording that is too short for two windows.
    """
    starts = first_frames(len(spikes), interval)
    if not starts:
        need = FIRST + interval + LAST_ROOM
        raise InputError(f"{scene} has {len(spikes)} frames; two windows {interval} frames apart need {need}")
    for number, middle in enumerate([*starts, starts[-1] + interval]):
        path = windows_file(folder, scene, interval, number)
        path.parent.mkdir(parents=True, exist_ok=True)
        np.save(path, np.ascontiguousarray(spikes[middle - REACH : middle + REACH + 1], np.uint8))
    return len(starts) + 1


def write_flows(folder: Path, scene: str, interval: int, flows: Iterable[Pictures]) -> None:
    """Write the flows from each window to the next, (H, W, 2) [pixels], in their order."""
    for number, flow in enumerate(flows):
        path = flow_file(folder, scene, interval, number)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_flo(path, flow)


def write_flo(path: str | Path, flow: ArrayLike) -> None:
    """Write a flow (H, W, 2), x then y [pixels], as Middlebury's .flo; the file appears whole.

    Args:
        path: of the file.
        flow: of each pixel.

    Raises:
        InputError: for an array of another shape.

    Example:
        >>> write_flo("still.flo", np.zeros((2, 3, 2)))
        >>> read_flo("still.flo").shape
        (2, 3, 2)
    """
    values = np.ascontiguousarray(flow, "<f4")
    if values.ndim != 3 or values.shape[2] != 2:
        raise InputError(f"a flow has shape {values.shape}; it must be (rows, columns, 2)")
    with whole_file(path) as beside:
        beside.write_bytes(HEADER.pack(MAGIC, values.shape[1], values.shape[0]) + values.tobytes())


def read_flo(path: str | Path, shape: tuple[int, int] | None = None) -> NDArray[np.float32]:
    """Read a .flo file.

    Args:
        path: of the file.
        shape: (rows, columns) that it must have; default any.

    Returns:
        (H, W, 2), x then y [pixels].

    Raises:
        InputError: for a file that is not there, is none, is cut, has another shape, or numbers that are not finite.

    Example:
        >>> write_flo("right.flo", np.ones((2, 3, 2)))
        >>> read_flo("right.flo", (2, 4))
        Traceback (most recent call last):
            ...
        spikecam_env.errors.InputError: right.flo has 2 x 3 pixels; need 2 x 4
    """
    data = existing_file(path).read_bytes()
    magic, columns, rows = HEADER.unpack(data[: HEADER.size]) if len(data) >= HEADER.size else (0.0, 0, 0)
    if magic != MAGIC or min(rows, columns) < 1:
        raise InputError(f"{path} is no .flo file; give one in Middlebury's format")
    if len(data) - HEADER.size != 8 * rows * columns:
        raise InputError(
            f"{path} has {len(data)} bytes; {rows} x {columns} pixels take {HEADER.size + 8 * rows * columns}"
        )
    if shape is not None and (rows, columns) != tuple(shape):
        raise InputError(f"{path} has {rows} x {columns} pixels; need {shape[0]} x {shape[1]}")
    flow = np.frombuffer(data, "<f4", offset=HEADER.size).reshape(rows, columns, 2).astype(np.float32)
    if not np.isfinite(flow).all():
        raise InputError(f"{path} has numbers that are not finite; a flow has one for every pixel")
    return flow
