"""Conversion-gain spread: photodiodes differ in how much charge the same light gives.

    alpha(x, y) = alpha (1 + sigma n),  n ~ N(0, 1) a pixel

Stage: photodiode.  Seen in: flats, rate proportional to light, pixel by pixel.
Within a frame: constant in time.
Source: paper (8); published 0.0584 / 1.0128.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.sensor.unit import PixelArray


@dataclass(frozen=True)
class ConversionGainSpread(Effect):
    sigma: float = parameter(0.0584 / 1.0128, unit="relative", bounds=(0.0, 1.0), doc="standard deviation over mean")

    stage = Stage.PHOTODIODE
    acts = Acts.CONSTANT
    strength = "sigma"
    identification = Identification(family="pattern", needs=Needs.EVEN)

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        factor = 1.0 + self.sigma * rng.standard_normal(pixels.gain.shape)
        return replace(pixels, gain=pixels.gain * np.maximum(factor, 0.0))
