"""Spike streams in HDF5 files of others: an array of 0 and 1 by its path, e.g. key="/group/spikes"."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError, shown
from spikecam_env.streams.hdf5 import check_stored
from spikecam_env.streams.stored import Choice, one_stream, stream_key
from spikecam_env.untrusted import hdf5_item, hdf5_values, open_hdf5

MOST_LISTED = 1000
"""Arrays of a file that are looked at."""


def read_foreign_hdf5(
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
    """An HDF5 file that is no recording of this package -> (T, H, W) uint8 spikes and how they were read.

    key: path of the array, default the only one that can be a stream; links are not followed.  The rest as `load_npz`.
    Raises InputError if the file is absent, damaged or no HDF5, and as `load_npz`.
    """
    choice = Choice(key, item, batch_axis, time_axis, flip, first, count)
    with open_hdf5(path) as file:
        try:
            name = stream_key(named_arrays(file, key, path), key, path)
        except InputError as error:
            raise InputError(f"{error}; it is not a recording of this package (no format attribute)") from error
        array = array_of(file, name, path)
    return one_stream(array, choice, path, name)


def named_arrays(file: h5py.File, key: str | None, path: str | Path) -> dict[str, h5py.Dataset]:
    """Arrays by path, e.g. "group/spikes": the one asked, or all that are in the file itself."""
    if key is not None:
        found = hdf5_item(file, key, str(path))
        if not isinstance(found, h5py.Dataset) or found.shape is None:
            raise InputError(f"{path}: {key} is no array; give the path of one")
        return {key: found}
    arrays: dict[str, h5py.Dataset] = {}

    def visit(name: str, found: Any) -> bool | None:
        if isinstance(found, h5py.Dataset) and found.shape is not None and not name.startswith("#"):
            arrays[name] = found
        return True if len(arrays) >= MOST_LISTED else None

    try:
        file.visititems(visit)
    except Exception as error:
        raise InputError(f"{path} cannot be read ({shown(str(error))}); it is damaged") from error
    return arrays


def array_of(file: h5py.File, name: str, path: str | Path) -> NDArray[Any]:
    """The values of an array; raises InputError where they are elsewhere, damaged, too many or not stored."""
    found = hdf5_item(file, name, str(path))
    try:
        check_stored(found, f"{path}: {name}")
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{path}: {name} cannot be read ({shown(str(error))})") from error
    return hdf5_values(file, name, str(path))
