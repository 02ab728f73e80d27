"""Optical blur: the lens spreads every point of the scene.

    L <- G_s * L        G_s(n) ~ exp(-n^2 / 2 v) along rows and columns; the picture goes on beyond its edge as it ends

v gives the weights the variance s^2.  A Gaussian sampled at pixels has it from 0.7 pixels on (v = s^2), but vanishes
below 0.3.  There an edge in motion, averaged over each pixel, still loses s^2 / 2 of it to each side.

Stage: optics.  Seen in: textured or moving light: edges are erf(x / (sqrt(2) s)); flats are unchanged.
Twins: crosstalk (electrical: also a coincidence of spikes), photodiode_lag (blurs motion, not static texture).
Within a frame: constant in time.
Source: Gaussian approximation of a lens' point spread; diffraction alone gives s = 0.42 lambda F (Airy's core).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from spikecam_env.sensor.effects.base import Acts, Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response

_NO_BLUR = 1e-9
"""[pixels] Below, the neighbours' weight is under 1e-18, and no float32 moves by it."""


@dataclass(frozen=True)
class OpticalBlur(Effect):
    sigma_pixels: float = parameter(0.5, unit="pixels", bounds=(0.0, 20.0), doc="standard deviation of the spread")

    stage = Stage.OPTICS
    acts = Acts.CONSTANT
    strength = "sigma_pixels"
    identification = Identification(family="optics", response=Response.QUADRATIC, needs=Needs.EDGES, only_contrast=True)

    def image(self, radiance: NDArray[np.float32]) -> NDArray[np.float32]:
        if self.sigma_pixels < _NO_BLUR:
            return radiance
        kernel = gaussian_weights(self.sigma_pixels)
        columns: NDArray[np.float32] = scipy.ndimage.convolve1d(radiance, kernel, axis=0, mode="nearest")
        blurred: NDArray[np.float32] = scipy.ndimage.convolve1d(columns, kernel, axis=1, mode="nearest")
        return blurred


@lru_cache(maxsize=64)
def gaussian_weights(sigma: float) -> NDArray[np.float64]:
    """Normalised weights (2 n + 1,) of variance sigma^2 [pixels^2]; n reaches 5 sigma."""
    reach = int(np.ceil(5.0 * sigma)) + 1
    square = np.arange(-reach, reach + 1, dtype=np.float64) ** 2
    weights = lambda v: np.exp(-square / (2.0 * v)) / np.exp(-square / (2.0 * v)).sum()  # noqa: E731
    v = scipy.optimize.brentq(lambda v: float(weights(v) @ square) - sigma**2, 1e-3, sigma**2 + 1.0)  # type: ignore[no-untyped-call]
    found = np.asarray(weights(v), np.float64)  # type: ignore[no-untyped-call]
    found.setflags(write=False)  # kept, and given to whoever asks again
    return found
