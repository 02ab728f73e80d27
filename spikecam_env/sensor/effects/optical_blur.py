"""Optical blur: the lens spreads every point of the scene.

    L <- G_s * L        G_s: normalised Gaussian of standard deviation s; the picture goes on beyond its edge as it ends

Stage: optics.  Seen in: textured or moving light: edges are erf(x / (sqrt(2) s)); flats are unchanged.
Twins: crosstalk (electrical: also a coincidence of spikes), photodiode_lag (blurs motion, not static texture).
Source: Gaussian approximation of a lens' point spread; diffraction alone gives s = 0.42 lambda F (Airy's core).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from spikecam_env.sensor.effects.base import Effect, Stage, parameter


@dataclass(frozen=True)
class OpticalBlur(Effect):
    sigma_pixels: float = parameter(0.5, unit="pixels", bounds=(0.0, 20.0), doc="standard deviation of the spread")

    stage = Stage.OPTICS
    strength = "sigma_pixels"

    def image(self, radiance: NDArray[np.float32]) -> NDArray[np.float32]:
        return gaussian_filter(radiance, self.sigma_pixels, mode="nearest")
