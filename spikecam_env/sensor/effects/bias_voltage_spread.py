"""Bias-voltage spread: pixels differ in the voltage between reset and comparator reference.

    V_d(x, y) = V_d + V_S,  V_S ~ N(0, sigma^2)

Stage: threshold.  Seen in: flats at two V_d settings (at one, it is part of the gain).
Within a frame: constant in time.
Source: paper (10)-(12); published 0.0497 V.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import SECOND_V_D, Identification, Needs
from spikecam_env.sensor.unit import PixelArray


@dataclass(frozen=True)
class BiasVoltageSpread(Effect):
    sigma_V: float = parameter(0.0497, unit="V", bounds=(0.0, 0.5), doc="standard deviation over pixels")

    stage = Stage.THRESHOLD
    acts = Acts.CONSTANT
    strength = "sigma_V"
    identification = Identification(family="pattern", needs=Needs.EVEN, experiment=SECOND_V_D)

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        return pixels.with_swings_off(self.sigma_V, rng.standard_normal(pixels.gain.shape))
