"""The calibration map of a unit: the fixed pattern of each pixel, as far as the denoiser may know it.

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
MEAN_GAINS = (0.1, 10.0)
"""Least and greatest mean gain of a map.  It is 1 but for pixels left out; far from it, light has another unit."""
MEASURED_DARK = (-0.1, 1.0)
"""Dark rates that a calibration may give [spikes/frame]: a little below 0 where it extrapolates from lit levels."""
MOST_MEASURED = 1e30
"""Greatest gain that a calibration may give, as of a unit of the sensor: labels have any unit."""


@dataclass(frozen=True)
class PixelMap:
    """A calibrated unit: its light l fires gain * l + dark times a frame.

    Raises:
        InputError: the maps have other shapes, or values that are not finite or out of range.
    """

    gain: NDArray[np.float32]
    """(H, W), relative to the mean pixel, 0.01 to 100."""
    dark: NDArray[np.float32]
    """(H, W) [spikes/frame], 0 to 1."""

    def __post_init__(self) -> None:
        gain, dark = (_real(value) for value in (self.gain, self.dark))
        if gain.ndim != 2 or gain.shape != dark.shape or not gain.size:
            raise InputError(f"a calibration map has gain and dark of one shape (H, W); got {gain.shape}, {dark.shape}")
        _check_range("gain", gain, *GAINS)
        _check_range("dark", dark, 0.0, 1.0)
        if not MEAN_GAINS[0] <= gain.mean(dtype=np.float64) <= MEAN_GAINS[1]:
            raise InputError(
                f"a calibration map's gains have the mean {gain.mean():g}; they are relative to the mean pixel: "
                "divide them by their mean"
            )
        object.__setattr__(self, "gain", gain)
        object.__setattr__(self, "dark", dark)

    @classmethod
    def of(cls, unit: Any) -> PixelMap:
        """The map of a unit.

        Args:
            unit: a map; a pair (gain, dark); a `Calibration`; or the path of a maps.h5 of `spikecam calibrate`, or of
                its folder.

        Raises:
            InputError: it is none of these.
        """
        if isinstance(unit, cls):
            return unit
        if isinstance(unit, Calibration):
            return cls._measured(unit.main.gain, unit.main.dark, f"the calibration of {unit.campaign}")
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
        return cls._measured(gain, dark, str(source))

    @classmethod
    def _measured(cls, gain: NDArray[np.floating], dark: NDArray[np.floating], where: str) -> PixelMap:
        """SNEE's maps: gains over their mean; a pixel that could not be measured, or is odd, gets the median ones."""
        gain, dark = gain.astype(np.float64), dark.astype(np.float64)
        if gain.ndim != 2 or gain.shape != dark.shape:
            raise InputError(f"{where}: gain is {gain.shape} and dark {dark.shape}; both must be (rows, columns)")
        dark_rates = (dark >= MEASURED_DARK[0]) & (dark <= MEASURED_DARK[1])
        known = dark_rates & (gain > 0.0) & (gain <= MOST_MEASURED)
        known &= gain <= GAINS[1] * np.median(gain[known]) if known.any() else False
        if not known.any() or 2 * known.sum() < known.size:
            raise InputError(
                f"{where}: {known.sum()} of {known.size} pixels have a gain above 0 and a dark rate from "
                f"{MEASURED_DARK[0]:g} to {MEASURED_DARK[1]:g}; half of them are needed: calibrate anew"
            )
        share = np.where(known, gain, np.median(gain[known])) / gain[known].mean()
        rates = np.where(known, dark, np.median(dark[known]))
        return cls(np.clip(share, *GAINS).astype(np.float32), np.clip(rates, 0, 1).astype(np.float32))

    @cached_property
    def digest(self) -> str:
        """SHA-256 of both maps."""
        return hashlib.sha256(self.gain.tobytes() + self.dark.tobytes()).hexdigest()


def _check_range(name: str, values: NDArray[np.float32], low: float, high: float) -> None:
    bad = np.argwhere(~((values >= low) & (values <= high)))
    if bad.size:
        row, column = bad[0].tolist()
        raise InputError(
            f"a calibration map has {name} {values[row, column]:g} at pixel ({row}, {column}); it must be a number "
            f"from {low:g} to {high:g}"
        )


def _real(value: Any) -> NDArray[np.float32]:
    """As float32, infinite where that cannot hold it; InputError unless it is an array of real numbers."""
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InputError(f"a calibration map is no array: {error}") from error
    if np.ma.is_masked(value):
        raise InputError("a calibration map is masked in part; fill it first, e.g. with .filled(1.0)")
    if array.dtype.kind not in "iuf":
        raise InputError(f"a calibration map holds {array.dtype}; it must hold real numbers")
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, np.float32)
