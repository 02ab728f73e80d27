"""Capacitor spread: pixels differ in the capacitance that light discharges.

    C(x, y) = C + C_S,  C_S ~ N(0, sigma^2)

Stage: integration.  Seen in: flats (with dark current, separates from conversion gain).
Within a frame: constant in time.
Source: paper (10); published 0.0128 fF.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import SECOND_V_D, Identification, Needs
from spikecam_env.sensor.unit import PixelArray


@dataclass(frozen=True)
class CapacitorSpread(Effect):
    sigma_fF: float = parameter(0.0128, unit="fF", bounds=(0.0, 1.0), doc="standard deviation over pixels")

    stage = Stage.INTEGRATION
    acts = Acts.CONSTANT
    strength = "sigma_fF"
    identification = Identification(family="pattern", needs=Needs.EVEN, experiment=SECOND_V_D)

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        return pixels.with_capacitances_off(self.sigma_fF, rng.standard_normal(pixels.gain.shape))
