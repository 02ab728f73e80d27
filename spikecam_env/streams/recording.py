"""Any recording by its path."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError
from spikecam_env.streams.foreign_hdf5 import read_foreign_hdf5
from spikecam_env.streams.hdf5 import is_recording, read_hdf5
from spikecam_env.streams.mat import read_mat
from spikecam_env.streams.npz import load_npz, read_npy
from spikecam_env.streams.vidar import read_dat, read_raw


@dataclass(frozen=True)
class Recording:
    """Spikes (T, H, W) uint8 of 0 and 1, the frame rate [Hz] where the file states it, and what else it says.

    >>> print(Recording(np.zeros((301, 250, 400), np.uint8), frame_rate_hz=40_000.0))
    301 frames of 250 rows x 400 columns
    """

    spikes: NDArray[np.uint8]
    frame_rate_hz: float | None = None
    attributes: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        """How it was read, e.g. `301 frames of 250 rows x 400 columns, flip`."""
        frames, rows, columns = self.spikes.shape
        said = [f"{frames} frames of {rows} rows x {columns} columns"]
        if "geometry_from" in self.attributes:
            stored = (self.attributes["height"], self.attributes["width"])
            if stored != (rows, columns):
                said.append(f"of {stored[0]} x {stored[1]} stored")
            said.append("flipped upside down" if self.attributes["flip"] else "not flipped")
            said.append(f"{self.attributes['bit_order']}-endian bits")
            said.append(f"size {self.attributes['geometry_from']}")
        for name in ("key", "item", "time_axis"):
            if name in self.attributes:
                said.append(f"{name} {self.attributes[name]}")
        return ", ".join(said)


def read_recording(path: str | Path, **options: Any) -> Recording:
    """Read a recording; the ending of its name says how, and which options there are.  All take first, count.

        .dat          read_dat: height, width, flip, bit_order, crop_width, layout
        .raw, .bin    read_raw, one byte a pixel: height, width, flip, crop_width
        .npz          load_npz: key, item, batch_axis, time_axis, flip, bit_order
        .npy          read_npy: item, batch_axis, time_axis, flip
        .mat          read_mat: key, item, batch_axis, time_axis, flip
        .h5, .hdf5    of this package, read_hdf5: stream
                      of others, read_foreign_hdf5: key, item, batch_axis, time_axis, flip

    Warns (UserWarning) where the spikes say that it was read wrong.
    Raises InputError for another ending, an option the format does not have, and all that its loader refuses.

    >>> save_npz("spikes.npz", np.zeros((8, 2, 3), np.uint8))
    >>> print(read_recording("spikes.npz"))
    8 frames of 2 rows x 3 columns, key spikes, time_axis 0
    """
    loader = _loader(path)
    allowed = _options(loader)
    for name in options:
        if name not in allowed:
            ending = Path(path).suffix.lower()
            own = " of this package" if loader is read_hdf5 else ""
            raise InputError(f"option {name} does not apply to {ending} files{own}; they take {', '.join(allowed)}")
    spikes, attributes = loader(path, **options)
    return Recording(spikes, attributes.get("frame_rate_hz"), attributes)


def reading_options(path: str | Path) -> tuple[str, ...]:
    """Names of the options that apply to a recording, by its name, and for HDF5 by what is in it.

    Raises InputError for another ending, or no HDF5 file.
    """
    return _options(_loader(path))


def _options(loader: Callable[..., Any]) -> tuple[str, ...]:
    return tuple(name for name in inspect.signature(loader).parameters if name != "path")


def _loader(path: str | Path) -> Callable[..., Any]:
    ending = Path(path).suffix.lower()
    if ending in (".h5", ".hdf5"):
        return read_hdf5 if is_recording(path) else read_foreign_hdf5
    if ending not in _LOADERS:
        raise InputError(f"{path} ends in {ending!r}; a recording is one of {', '.join(ENDINGS)}")
    return _LOADERS[ending]


_LOADERS: dict[str, Callable[..., Any]] = {
    ".dat": read_dat,
    ".raw": read_raw,
    ".bin": read_raw,
    ".npz": load_npz,
    ".npy": read_npy,
    ".mat": read_mat,
}
ENDINGS = (*_LOADERS, ".h5", ".hdf5")
"""Of the names of files that `read_recording` reads."""
