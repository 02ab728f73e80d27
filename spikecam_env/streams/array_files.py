"""Spike streams in files of arrays: `.npz`, `.npy`, `.mat` and HDF5 of other programs; `stored` has the rules.

One array of 0 and 1, time first or last, or a batch of them.  An `.npz` may also be packed along time, as in RSIR:
`seq` holds eight frames a byte along its time axis, `length` is the number of frames.  Files of `save_npz` hold
`spikes`, time first, and state so: `time_axis` = 0.  Axes of a `.mat` are as MATLAB has them: (rows, columns, time) is
time_axis=2.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from spikecam_env.checked import checked_memory
from spikecam_env.errors import InputError, shown
from spikecam_env.streams.hdf5 import check_stored, is_array
from spikecam_env.streams.packing import BitOrder, as_spikes, check_bit_order
from spikecam_env.streams.stored import Choice, as_bytes, one_stream, ordered, stream_key
from spikecam_env.types import Spikes
from spikecam_env.untrusted import existing_file, hdf5_item, hdf5_values, number, open_hdf5, read_arrays
from spikecam_env.whole import whole_file

MOST_LISTED = 1000
"""Arrays of an HDF5 file among which the stream is looked for."""


def read_array_file(
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
) -> tuple[Spikes, dict[str, Any]]:
    """The stream of a file of arrays.  Warns (UserWarning) where the spikes show another time axis than the one given.

    Args:
        path: file; the ending of its name is its format.
        key: name of the array, or its path in HDF5 ("group/spikes"); default the only one that can be a stream.
        item: stream of a batch, an array of 4 axes.
        batch_axis: axis along which the streams of a batch lie.
        time_axis: 0, 1 or 2 of the stored stream; default inferred.
        flip: turn each frame upside down.
        bit_order: of a packed `seq` alone; "big" is NumPy's own.
        first: first frame to read.
        count: frames to read; default all.

    Returns:
        (T, H, W) spikes, and how they were read: key, time_axis, time_axis_from, item.

    Raises:
        InputError: the file is absent or damaged, no or several arrays can be the stream, values are not 0 and 1, or
            the axis of time is open.
    """
    source = existing_file(path)
    choice = Choice(key, item, batch_axis, time_axis, flip, first, count)
    ending, bit_order = source.suffix.lower(), check_bit_order(bit_order)
    if ending == ".npz":
        arrays = read_arrays(source)
        if key is None and "seq" in arrays and "length" in arrays:
            return _packed(arrays, choice, bit_order, source)
        name = stream_key(arrays, key, source)
        return one_stream(arrays[name], choice, source, name, _time_axis_of(arrays, name, source))
    name, array = {".npy": _from_npy, ".mat": _from_mat}.get(ending, _from_hdf5)(source, key)
    spikes, how = one_stream(array, choice, source, name)
    return np.array(spikes) if ending == ".npy" else spikes, how  # a copy: else it is the file, and changes with it


def save_npz(path: str | Path, spikes: ArrayLike) -> None:
    """(T, H, W) spikes -> a compressed `.npz` that `read_recording` reads back.  The file appears whole.

    Example:
        >>> save_npz("spikes.npz", np.ones((8, 2, 3), np.uint8))
        >>> read_recording("spikes.npz").spikes.shape
        (8, 2, 3)
    """
    with whole_file(path) as beside, beside.open("wb") as file:
        np.savez_compressed(file, spikes=as_spikes(spikes), time_axis=0)


def _time_axis_of(arrays: dict[str, NDArray[Any]], name: str, path: Path) -> int | None:
    """The axis of time that an `.npz` of `save_npz` states."""
    stated = "time_axis" in arrays and name == "spikes"
    return int(number(arrays, "time_axis", str(path))) if stated else None


def _packed(
    arrays: dict[str, NDArray[Any]], choice: Choice, bit_order: BitOrder, path: Path
) -> tuple[Spikes, dict[str, Any]]:
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


def _packed_axis(shape: tuple[int, ...], length: int, given: int | None, path: Path) -> tuple[int, str]:
    fitting = [axis for axis in (0, 2, 1) if shape[axis] == -(-length // 8)]
    if given is not None and given in fitting:
        return given, "given"
    if given is not None or len(fitting) != 1:
        raise InputError(
            f"{path}: seq of shape {shape} packs {length} frames along one axis, which has to be "
            f"{-(-length // 8)} long; axes that are: {fitting}; give time_axis as one of them"
        )
    return fitting[0], "length"


def _from_npy(source: Path, _: str | None) -> tuple[str, NDArray[Any]]:
    try:
        array = np.load(source, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # struct, tokenize, mmap, ...: the many ways in which a damaged file fails
        raise InputError(f"{source} is not a readable .npy of a plain array ({shown(str(error))})") from error
    if not isinstance(array, np.ndarray):
        raise InputError(f"{source} is an .npz under another name; give it the ending .npz")
    size = math.prod(array.shape) * array.dtype.itemsize
    checked_memory(size, f"{source}, {array.dtype} of shape {shown(array.shape)},")
    return "the array", np.asarray(array)


def _from_mat(source: Path, key: str | None) -> tuple[str, NDArray[Any]]:
    """Versions 4 to 7 by scipy; 7.3 is HDF5, in which MATLAB's axes are the other way about."""
    if h5py.is_hdf5(source):
        with open_hdf5(source) as file:
            name = stream_key(_arrays_of(file, key, source), key, source)
            return name, _values(file, name, source).T
    try:
        listed = {name: _Listed(shape, kind) for name, shape, kind in scipy.io.whosmat(source)}
        name = stream_key(listed, key, source)
        checked_memory(listed[name].bytes, f"{source}: {name} of shape {listed[name].shape}")
        return name, np.asarray(scipy.io.loadmat(source, variable_names=[name])[name])
    except InputError:
        raise
    except Exception as error:  # struct, zlib, MatReadError, MemoryError, ...: as a damaged file fails
        raise InputError(f"{source} is not a readable .mat file ({shown(str(error))})") from error


class _Listed:
    """A variable as the listing of a `.mat` has it."""

    def __init__(self, shape: tuple[int, ...], kind: str) -> None:
        self.shape, self.ndim = shape, len(shape)
        names = {"double": "float64", "single": "float32", "logical": "bool"}
        try:
            self.dtype = np.dtype(names.get(kind, kind))
        except TypeError:  # cells, structs, functions
            self.dtype = np.dtype(object)
        self.bytes = math.prod(shape) * self.dtype.itemsize


def _from_hdf5(source: Path, key: str | None) -> tuple[str, NDArray[Any]]:
    """Links are not followed."""
    with open_hdf5(source) as file:
        try:
            name = stream_key(_arrays_of(file, key, source), key, source)
        except InputError as error:
            raise InputError(f"{error}; it is not a recording of this package (no format attribute)") from error
        return name, _values(file, name, source)


def _arrays_of(file: h5py.File, key: str | None, path: Path) -> dict[str, h5py.Dataset]:
    """Arrays by path, e.g. "group/spikes": the one of a key, or all that are in the file itself."""
    if key is not None:
        item = hdf5_item(file, key, str(path))
        if not is_array(item):
            raise InputError(f"{path}: {key} is no array; give the path of one")
        return {key: item}
    arrays: dict[str, h5py.Dataset] = {}

    def visit(name: str, item: Any) -> bool | None:
        if is_array(item) and not name.startswith("#"):
            arrays[name] = item
        return True if len(arrays) >= MOST_LISTED else None

    try:
        file.visititems(visit)
    except Exception as error:
        raise InputError(f"{path} cannot be read ({shown(str(error))}); it is damaged") from error
    return arrays


def _values(file: h5py.File, name: str, path: Path) -> NDArray[Any]:
    """The values of an array; raises InputError where they are elsewhere, damaged, too many or not stored."""
    item = hdf5_item(file, name, str(path))
    try:
        check_stored(item, f"{path}: {name}")
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{path}: {name} cannot be read ({shown(str(error))})") from error
    return hdf5_values(file, name, str(path))
