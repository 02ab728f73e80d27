"""Common threshold noise: the reference of all comparators moves together, anew every frame.

    fires when charge >= 1 + sigma n_t / V_d,  n_t ~ N(0, 1) a frame, one for all pixels
    share of a large array that fires in a frame: x + sigma (n_(t-1) - n_t) / V_d

Stage: threshold.  Seen in: spikes a frame over the whole array: variance 2 sigma^2/V_d^2, lag-1 correlation -1/2.
Twins: row_temporal_noise (rows), clock_jitter (in proportion to light), supply_ripple (a line).
Within a frame: drawn once a frame; by assumption it holds for the frame.
Source: a reference that all comparators share; white by assumption.  A real wall recording shows none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, ExposureBlock, Shift, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response


@dataclass(frozen=True)
class CommonThresholdNoise(Effect):
    sigma_mV: float = parameter(1.0, unit="mV", bounds=(0.0, 100.0), doc="standard deviation of the common reference")

    stage = Stage.THRESHOLD
    acts = Acts.DRAWN
    strength = "sigma_mV"
    identification = Identification(family="common", response=Response.QUADRATIC, needs=Needs.STEADY)

    def compare(self, now: ExposureBlock, memory: np.random.Generator) -> tuple[Shift, np.random.Generator]:
        return Shift(millivolts=self.sigma_mV * memory.standard_normal((now.frames, 1, 1))), memory
