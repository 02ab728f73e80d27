"""Spike streams in `.npz` and `.npy` files, as several public datasets have them.

One array of 0 and 1, time first or last, or a batch of them (`stored` has the rules); or packed along time, as in RSIR:
`seq` holds eight frames a byte along its time axis and `length` the number of frames.

Those that `save_npz` writes hold `spikes`, time first, and say so: `time_axis` = 0.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.checked import checked_memory
from spikecam_env.errors import InputError, shown
from spikecam_env.streams.packing import BitOrder, as_spikes, check_bit_order
from spikecam_env.streams.stored import Choice, as_bytes, coincidence, one_stream, ordered, stream_key
from spikecam_env.untrusted import existing_file, number, read_arrays
from spikecam_env.whole import whole_file

__all__ = ["coincidence", "load_npz", "read_npy", "save_npz"]


def load_npz(
    path: str | Path,
    *,
    key: str | None = None,
    item: int | None = None,
    batch_axis: int = 0,
    time_axis: int | None = None,
    flip: bool | None = None,
    bit_order: BitOrder = "big",
    first: int = 0,
    count: int | None = None,
) -> tuple[NDArray[np.uint8], dict[str, Any]]:
    """An `.npz` file -> (T, H, W) uint8 spikes and how they were read: key, time_axis, time_axis_from, item.

    key: name of the array, default the only one that can be a stream.  item, batch_axis: which stream of a batch (4
    axes), and the axis they lie along.  time_axis: 0, 1 or 2 of the stored stream, default inferred.  flip: turn each
    frame upside down.  bit_order: of packed `seq` only; "big" is NumPy's own.
    Warns (UserWarning) where the spikes say another time axis.
    Raises InputError if the file is absent or not an .npz, no or several arrays can be the stream, values are
    not 0 and 1, or a time axis that the spikes and the shape leave open.
    """
    arrays = read_arrays(path)
    choice = Choice(key, item, batch_axis, time_axis, flip, first, count)
    check_bit_order(bit_order)
    if key is None and "seq" in arrays and "length" in arrays:
        return _packed(arrays, choice, bit_order, path)
    name = stream_key(arrays, key, path)
    stated = None
    if "time_axis" in arrays and name == "spikes":
        stated = int(number(arrays, "time_axis", str(path)))
    return one_stream(arrays[name], choice, path, name, stated)


def read_npy(
    path: str | Path,
    *,
    item: int | None = None,
    batch_axis: int = 0,
    time_axis: int | None = None,
    flip: bool | None = None,
    first: int = 0,
    count: int | None = None,
) -> tuple[NDArray[np.uint8], dict[str, Any]]:
    """An `.npy` file -> (T, H, W) uint8 spikes and how they were read; options and errors as `load_npz`."""
    source = existing_file(path)
    try:
        array = np.load(source, mmap_mode="r", allow_pickle=False)
        if not isinstance(array, np.ndarray):
            raise InputError(f"{source} is an .npz under another name; give it the ending .npz")
        taken = math.prod(array.shape) * array.dtype.itemsize
        checked_memory(taken, f"{source}, {array.dtype} of shape {shown(array.shape)},")
        choice = Choice(None, item, batch_axis, time_axis, flip, first, count)
        spikes, how = one_stream(np.asarray(array), choice, source, "the array")
        return np.array(spikes), how  # a copy: else it is the file, and changes with it
    except InputError:
        raise
    except Exception as error:  # struct, tokenize, mmap, ...: the many ways in which a damaged file fails
        raise InputError(f"{source} is not a readable .npy of a plain array ({shown(str(error))})") from error


def save_npz(path: str | Path, spikes: ArrayLike) -> None:
    """(T, H, W) spikes -> a compressed `.npz` that `load_npz` reads back.  The file appears whole.

    >>> save_npz("spikes.npz", np.ones((8, 2, 3), np.uint8))
    >>> read_recording("spikes.npz").spikes.shape
    (8, 2, 3)
    """
    with whole_file(path) as beside, beside.open("wb") as file:
        np.savez_compressed(file, spikes=as_spikes(spikes), time_axis=0)


def _packed(
    arrays: dict[str, NDArray[Any]], choice: Choice, bit_order: BitOrder, path: str | Path
) -> tuple[NDArray[np.uint8], dict[str, Any]]:
    """The stream of a `seq` that is packed along time."""
    seq = arrays["seq"]
    if seq.ndim != 3 or seq.dtype.itemsize != 1 or seq.dtype.kind not in "biu":
        raise InputError(f"{path}: seq is {seq.dtype} of shape {seq.shape}; need uint8 with 3 axes")
    length = number(arrays, "length", str(path))
    if length != int(length) or length < 1:
        raise InputError(f"{path}: length is {length:g}; it must be a number of frames")
    checked_memory(8 * seq.size, f"{path}: seq, unpacked,")
    axis, source = _packed_axis(seq.shape, int(length), choice.time_axis, path)
    bits = np.unpackbits(seq.view(np.uint8), axis, int(length), bit_order)
    how = {"key": "seq", "time_axis": axis, "time_axis_from": source}
    return ordered(as_bytes(bits, path, "seq"), axis, choice, path), how


def _packed_axis(shape: tuple[int, ...], length: int, given: int | None, path: str | Path) -> tuple[int, str]:
    fitting = [axis for axis in (0, 2, 1) if shape[axis] == -(-length // 8)]
    if given is not None and given in fitting:
        return given, "given"
    if given is not None or len(fitting) != 1:
        raise InputError(
            f"{path}: seq of shape {shape} packs {length} frames along one axis, which has to be "
            f"{-(-length // 8)} long; axes that are: {fitting}; give time_axis as one of them"
        )
    return fitting[0], "length"
