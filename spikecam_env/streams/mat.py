"""Spike streams in MATLAB files: `.mat` of versions 4 to 7 by scipy, 7.3 (HDF5) by h5py.

Axes are as MATLAB has them, so (rows, columns, time) is time_axis=2; `stored` has the rules.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy
from numpy.typing import NDArray

from spikecam_env.checked import checked_memory
from spikecam_env.errors import InputError, shown
from spikecam_env.streams.foreign_hdf5 import array_of, named_arrays
from spikecam_env.streams.stored import Choice, one_stream, stream_key
from spikecam_env.untrusted import existing_file, open_hdf5


def read_mat(
    path: str | Path,
    *,
    key: str | None = None,
    item: int | None = None,
    batch_axis: int = 0,
    time_axis: int | None = None,
    flip: bool | None = None,
    first: int = 0,
    count: int | None = None,
) -> tuple[NDArray[np.uint8], dict[str, Any]]:
    """A `.mat` file -> (T, H, W) uint8 spikes and how they were read; options as `load_npz`.

    key: name of the variable; in version 7.3 also a path to a field, e.g. "data/spikes".
    Raises InputError if the file is absent, damaged or no .mat, and as `load_npz`.
    """
    source = existing_file(path)
    choice = Choice(key, item, batch_axis, time_axis, flip, first, count)
    name, array = _from_hdf5(source, key) if h5py.is_hdf5(source) else _from_old(source, key)
    return one_stream(array, choice, source, name)


def _from_hdf5(source: Path, key: str | None) -> tuple[str, NDArray[Any]]:
    """MATLAB stores columns first: HDF5 has the axes the other way about."""
    with open_hdf5(source) as file:
        name = stream_key(named_arrays(file, key, source), key, source)
        return name, array_of(file, name, source).T


def _from_old(source: Path, key: str | None) -> tuple[str, NDArray[Any]]:
    try:
        names = {name: _Listed(shape, kind) for name, shape, kind in scipy.io.whosmat(source)}
        name = stream_key(names, key, source)
        checked_memory(names[name].bytes, f"{source}: {name} of shape {names[name].shape}")
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

    @property
    def bytes(self) -> int:
        return int(np.prod(self.shape, dtype=object)) * self.dtype.itemsize
