"""Excess threshold noise: the comparator adds to the noise of a reset, drawn anew at each reset.

    kappa^2 = (sigma_reset^2 + sigma^2) / V_d^2

Stage: threshold.  Seen in: the k-slope of A_k, T^2 kappa^2, above that of kT/C and shot noise.
Twins: reset_noise (same law, its strength known from C), shot_noise (separated by a second V_d).
Within a frame: at the crossing; drawn anew at the reset.
Source: comparator input noise, white and sampled once a spike; about 1 mV rms in CMOS comparators.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response
from spikecam_env.sensor.unit import PixelArray


@dataclass(frozen=True)
class ExcessThresholdNoise(Effect):
    sigma_mV: float = parameter(2.0, unit="mV", bounds=(0.0, 100.0), doc="standard deviation of a spike's threshold")

    stage = Stage.THRESHOLD
    acts = Acts.CROSSING
    strength = "sigma_mV"
    identification = Identification(family="noise", response=Response.QUADRATIC, needs=Needs.STEADY)

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        return pixels.with_reset_noise(self.sigma_mV)
