"""The calibration map of a unit: what the denoiser may know of each pixel's fixed pattern.

SNEE measures it (`spikecam calibrate`): alpha/phi and I_dark/phi of every pixel.  The denoiser's light is in spikes a
frame of the mean pixel, whose gain is 1, whatever the labels of the flats were in.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.calibration import Calibration
from spikecam_env.calibration.results import MAPS_FORMAT
from spikecam_env.errors import InputError
from spikecam_env.untrusted import hdf5_attributes, hdf5_values, open_hdf5

GAINS = (0.01, 100.0)
"""Least and greatest gain of a pixel in a map."""


@dataclass(frozen=True)
class PixelMap:
    """A calibrated unit: its light l fires gain * l + dark times a frame.

    gain, dark: (H, W) float32; gain 0.01 to 100; dark [spikes/frame], 0 to 1.
    Raises InputError for other shapes, and for values that are not finite or out of range.
    """

    gain: NDArray[np.float32]
    dark: NDArray[np.float32]

    def __post_init__(self) -> None:
        gain, dark = (_real(value) for value in (self.gain, self.dark))
        if gain.ndim != 2 or gain.shape != dark.shape or not gain.size:
            raise InputError(f"a calibration map has gain and dark of one shape (H, W); got {gain.shape}, {dark.shape}")
        if not (np.all((gain >= GAINS[0]) & (gain <= GAINS[1])) and np.all((dark >= 0) & (dark <= 1))):
            raise InputError(
                f"a calibration map must have gains from {GAINS[0]:g} to {GAINS[1]:g} and dark rates from 0 to 1"
            )
        object.__setattr__(self, "gain", gain)
        object.__setattr__(self, "dark", dark)

    @classmethod
    def of(cls, unit: Any) -> PixelMap:
        """A map as it is; of a pair (gain, dark); of a `Calibration`; or of a maps.h5 of `spikecam calibrate`, or its
        folder.

        Raises InputError for anything else.
        """
        if isinstance(unit, cls):
            return unit
        if isinstance(unit, Calibration):
            return cls._measured(unit.main.gain, unit.main.dark)
        if isinstance(unit, str | os.PathLike):
            return cls._read(Path(unit))
        try:
            gain, dark = unit
        except (TypeError, ValueError) as error:
            raise InputError(
                f"unit is {type(unit).__name__}; give maps (gain, dark), a Calibration, or the path of a maps.h5"
            ) from error
        return cls(gain, dark)

    @classmethod
    def _read(cls, path: Path) -> PixelMap:
        source = path / "maps.h5" if path.is_dir() else path
        with open_hdf5(source) as file:
            if hdf5_attributes(file, str(source)).get("format") != MAPS_FORMAT:
                raise InputError(f"{source} is no {MAPS_FORMAT}; give the maps.h5 of `spikecam calibrate`")
            gain, dark = (hdf5_values(file, f"setting_0/{name}", str(source)) for name in ("gain", "dark"))
        if gain.dtype.kind != "f" or dark.dtype.kind != "f":
            raise InputError(f"{source}: gain is {gain.dtype} and dark {dark.dtype}; they must be floating point")
        return cls._measured(gain, dark)

    @classmethod
    def _measured(cls, gain: NDArray[np.floating], dark: NDArray[np.floating]) -> PixelMap:
        """SNEE's maps: gains over their mean; a pixel that could not be measured, or is odd, gets the median ones."""
        known = np.isfinite(gain) & np.isfinite(dark) & (gain > 0)
        if not known.any():
            raise InputError("the calibration has no pixel whose gain and dark rate it knows")
        share = np.where(known, gain, np.median(gain[known])) / gain[known].mean()
        rates = np.where(known, dark, np.median(dark[known]))
        return cls(np.clip(share, *GAINS).astype(np.float32), np.clip(rates, 0, 1).astype(np.float32))

    @cached_property
    def digest(self) -> str:
        """SHA-256 of both maps."""
        return hashlib.sha256(self.gain.tobytes() + self.dark.tobytes()).hexdigest()


def _real(value: Any) -> NDArray[np.float32]:
    """As float32, infinite where that cannot hold it; raises InputError unless it is an array of real numbers."""
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InputError(f"a calibration map is no array: {error}") from error
    if array.dtype.kind not in "biuf":
        raise InputError(f"a calibration map holds {array.dtype}; it must hold real numbers")
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, np.float32)
