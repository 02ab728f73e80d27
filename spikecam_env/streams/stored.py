"""From the arrays of a file to one stream: which array, which stream of a batch, which axis is time.

A stream is a 3-D array of 0 and 1, time first or last.  A batch has one axis more; `item` says which of its streams to
read and `batch_axis` along which axis they lie.

Which axis is time, when neither the caller nor the file says, by the first rule that decides:

1. Spikes.  A pixel that fires less than every second frame hardly ever fires in two frames running, while
   neighbours in space do so as often as chance has it.  Along an axis, over the lines with rate p <= 1/2,

       r = P(spike at i and at i + 1) / mean of p^2          time: r near 0;  space: r >= 1

   Time is the axis with r < 1/2, if the other has r > 1/2.
2. Shape.  One reading, and only one, gives a known sensor (`geometry.KNOWN_SHAPES`).

Else the caller has to say.  Where he says an axis and rule 1 another, the loaders warn.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.checked import checked_whole
from spikecam_env.errors import InputError, shown
from spikecam_env.streams.geometry import KNOWN_SHAPES
from spikecam_env.streams.packing import check_range

EIGHT_BITS = (np.uint8, np.int8, np.bool_)


@dataclass(frozen=True)
class Choice:
    """The caller's options for the stream in a file; None where file or spikes decide."""

    key: str | None = None
    item: int | None = None
    batch_axis: int = 0
    time_axis: int | None = None
    flip: bool | None = None
    first: int = 0
    count: int | None = None

    def __post_init__(self) -> None:
        for name, kind in (("key", str), ("flip", bool)):
            value = getattr(self, name)
            if value is not None and not isinstance(value, kind):
                raise InputError(f"{name} is {shown(value)}; it must be {'text' if kind is str else 'True or False'}")


def stream_key(arrays: Mapping[str, Any], key: str | None, path: str | Path) -> str:
    """The name of the array to read: the key, else the only one that can be a stream or a batch of them.

    Args:
        arrays: by name, anything with ndim, shape and dtype.
        key: of the caller.
        path: for messages.
    """
    if key is not None and key in arrays:
        return key
    listing = ", ".join(f"{name} {a.dtype}{a.shape}" for name, a in list(arrays.items())[:20]) or "nothing"
    if key is not None:
        raise InputError(f"{path} has no array {key!r}; it holds {listing}")
    eight_bits = [name for name, a in arrays.items() if a.dtype in EIGHT_BITS]
    for some in (eight_bits, [name for name, a in arrays.items() if a.dtype.kind in "iuf"]):
        for axes in (3, 4):
            fitting = [name for name in some if arrays[name].ndim == axes]
            if len(fitting) == 1:
                return fitting[0]
            if fitting:
                break
    raise InputError(
        f"{path} holds {listing}; {len(fitting)} of these can be a spike stream (3 axes, uint8, int8 or bool); "
        "give its name as key"
    )


def one_stream(
    array: NDArray[Any], choice: Choice, path: str | Path, key: str, stated: int | None = None
) -> tuple[NDArray[np.uint8], dict[str, Any]]:
    """The stream in an array of a file.

    Args:
        array: of 3 or 4 axes.
        choice: the caller's options.
        path: for messages.
        key: name of the array.
        stated: axis of time that the file names, if it does.

    Returns:
        (T, H, W) spikes, and how they were read: key, time_axis, time_axis_from, item.
    """
    stored = as_bytes(one_item(array, choice, path, key), path, key)
    axis, source = time_axis(stored, choice.time_axis, stated, path)
    how = {"key": key, "time_axis": axis, "time_axis_from": source}
    if array.ndim == 4:
        how["item"] = 0 if choice.item is None else int(choice.item)
    return ordered(stored, axis, choice, path), how


def one_item(array: NDArray[Any], choice: Choice, path: str | Path, key: str) -> NDArray[Any]:
    """The array itself, or the chosen stream of a batch."""
    if array.ndim != 4:
        if choice.item is not None:
            raise InputError(f"{path}: {key} has shape {array.shape}, which is no batch of streams; leave item")
        return array
    if checked_whole(choice.batch_axis, "batch_axis") not in range(4):
        raise InputError(f"batch_axis is {choice.batch_axis}; it must be 0, 1, 2 or 3")
    size = array.shape[choice.batch_axis]
    if choice.item is None and size != 1:
        raise InputError(
            f"{path}: {key} of shape {array.shape} is a batch of {size} streams along axis {choice.batch_axis}; "
            f"say which with item, 0 to {size - 1} (and batch_axis if they lie along another axis)"
        )
    item = 0 if choice.item is None else checked_whole(choice.item, "item")
    if not 0 <= item < size:
        raise InputError(f"{path}: item is {item}; {key} holds {size} streams along axis {choice.batch_axis}")
    return np.asarray(np.take(array, item, axis=choice.batch_axis))


def as_bytes(array: NDArray[Any], path: str | Path, key: str) -> NDArray[np.uint8]:
    """A 3-D array of 0 and 1 of any real dtype as uint8; raises InputError for another, and other values."""
    if array.ndim != 3 or array.dtype.kind not in "biuf":
        raise InputError(
            f"{path}: {key} is {array.dtype} of shape {array.shape}; a stream has 3 axes and holds numbers, 0 and 1"
        )
    if array.dtype.itemsize == 1:
        stored = array.view(np.uint8)
        if stored.max(initial=0) <= 1:
            return stored
    elif np.all((array == 0) | (array == 1)):
        return array.astype(np.uint8)
    raise InputError(f"{path}: {key} holds values to {array.max():.6g}; a spike stream holds 0 and 1 only")


def ordered(stored: NDArray[np.uint8], axis: int, choice: Choice, path: str | Path) -> NDArray[np.uint8]:
    """The chosen frames, time first, upside down if `flip`."""
    spikes = np.moveaxis(stored, axis, 0)
    first, stop = check_range(choice.first, choice.count, len(spikes), str(path))
    return np.ascontiguousarray(spikes[first:stop, ::-1] if choice.flip else spikes[first:stop])


def coincidence(stored: NDArray[np.uint8], axis: int) -> float:
    """r of the module's rule 1 along an axis; 1 where nothing is known."""
    lines = np.moveaxis(stored.view(np.uint8), axis, 0)
    rate = lines.mean(axis=0)
    lines, rate = lines[:, rate <= 0.5], rate[rate <= 0.5]
    chance = float(np.mean(rate**2)) if rate.size else 0.0
    if len(lines) < 2 or chance == 0:
        return 1.0
    return float(np.mean(lines[:-1] & lines[1:])) / chance


def time_axis(stored: NDArray[np.uint8], given: int | None, stated: int | None, path: str | Path) -> tuple[int, str]:
    """(axis, where from): see the module's rules."""
    if not stored.size:
        raise InputError(f"{path}: the array has shape {stored.shape}; it holds no spikes")
    silent = _silent_axes(stored)
    for axis, source in ((given, "given"), (stated, "file")):
        if axis is not None:
            if isinstance(axis, bool) or axis not in (0, 1, 2):
                raise InputError(f"{path}: time_axis is {axis}; it must be 0, 1 or 2")
            if len(silent) == 1 and axis != 1 and axis not in silent:
                warnings.warn(
                    f"{path} of shape {stored.shape} is read with time_axis={axis}; "
                    f"its spikes say time_axis={silent[0]}",
                    UserWarning,
                    stacklevel=5,
                )
            return int(axis), source
    if len(silent) == 1:
        return silent[0], "spike statistics"
    rows, columns = stored.shape[1:], stored.shape[:2]
    known = [axis for axis, shape in ((0, rows), (2, columns)) if shape in KNOWN_SHAPES]
    if len(known) == 1:
        return known[0], "sensor shape"
    raise InputError(
        f"{path}: neither the spikes nor the shape {stored.shape} show which axis is time; "
        "give time_axis=0 (time first) or time_axis=2 (time last)"
    )


def _silent_axes(stored: NDArray[np.uint8]) -> list[int]:
    middle = tuple(slice((n - min(n, 256)) // 2, (n + min(n, 256)) // 2) for n in stored.shape)
    return [axis for axis in (0, 2) if coincidence(stored[middle], axis) < 0.5]
