"""Any recording by its path: `.dat`, `.npz`, `.h5`."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError
from spikecam_env.streams.hdf5 import read_hdf5
from spikecam_env.streams.npz import load_npz
from spikecam_env.streams.vidar import load_vidar_dat


@dataclass(frozen=True)
class Recording:
    """Spikes (T, H, W) uint8 of 0 and 1, the frame rate [Hz] where the file states it, and what else it says."""

    spikes: NDArray[np.uint8]
    frame_rate_hz: float | None = None
    attributes: dict[str, Any] = field(default_factory=dict)


def read_recording(path: str | Path, **options: Any) -> Recording:
    """Read a recording; the ending of its name says how, and which options there are.

        .dat          load_vidar_dat: height, width, flip, bit_order, crop_width, first, count
        .npz          load_npz: key, time_axis, flip, bit_order, first, count
        .h5, .hdf5    read_hdf5: first, count

    Errors: InputError for another ending, an option the format does not have, and all that its loader refuses.
    """
    allowed = reading_options(path)
    for name in options:
        if name not in allowed:
            ending = Path(path).suffix.lower()
            raise InputError(f"option {name} does not apply to {ending} files; they take {', '.join(allowed)}")
    loaded = _loader(path)(path, **options)
    spikes, attributes = loaded if isinstance(loaded, tuple) else (loaded, {})
    return Recording(spikes, attributes.get("frame_rate_hz"), attributes)


def reading_options(path: str | Path) -> tuple[str, ...]:
    """Names of the options that apply to a recording, by the ending of its name; InputError for another ending."""
    return tuple(name for name in inspect.signature(_loader(path)).parameters if name != "path")


def _loader(path: str | Path) -> Callable[..., Any]:
    ending = Path(path).suffix.lower()
    if ending not in _LOADERS:
        raise InputError(f"{path} ends in {ending!r}; a recording is one of {', '.join(_LOADERS)}")
    return _LOADERS[ending]


_LOADERS: dict[str, Callable[..., Any]] = {
    ".dat": load_vidar_dat,
    ".npz": load_npz,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
}
