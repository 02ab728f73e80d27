"""Reset noise: the reset transistor leaves a random voltage on the node, drawn anew at each reset.

    phi = (C + C_S)(V_d + V_S + V_T),   V_T ~ N(0, sigma^2)
    thermal: sigma = sqrt(kT/C) = 0.976 mV at 300 K, 4.348 fF

Stage: threshold.  Seen in: the k-slope of A_k, T^2 kappa^2.
Twins: excess_threshold_noise, shot_noise (separated by a second V_d).
Within a frame: at the crossing; drawn anew at the reset.
Source: paper (7), (12).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import SECOND_V_D, Identification, Needs, Response
from spikecam_env.sensor.unit import PixelArray


@dataclass(frozen=True)
class ResetNoise(Effect):
    sigma_mV: float = parameter(0.976, unit="mV", bounds=(0.0, 100.0), doc="standard deviation of a reset's voltage")

    stage = Stage.THRESHOLD
    acts = Acts.CROSSING
    strength = "sigma_mV"
    identification = Identification(
        family="noise", response=Response.QUADRATIC, needs=Needs.STEADY, experiment=SECOND_V_D
    )

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        return pixels.with_reset_noise(self.sigma_mV)
