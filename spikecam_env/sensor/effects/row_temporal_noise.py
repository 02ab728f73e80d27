"""Row temporal noise: the reference line of a row moves, anew every frame.

    fires when charge >= 1 + sigma n_(row, t) / V_d,  n ~ N(0, 1) a row and frame

Stage: threshold.  Seen in: spikes a frame of a row: pixels of one row move together, rows do not.
Twins: common_threshold_noise (all rows together), row_fixed_pattern (constant in time), ir_drop (follows activity).
Within a frame: drawn once a frame; by assumption it holds for the frame.
Source: shared reference lines of CMOS imagers; white by assumption.  A real wall recording shows none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, ExposureBlock, Shift, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response


@dataclass(frozen=True)
class RowTemporalNoise(Effect):
    sigma_mV: float = parameter(1.0, unit="mV", bounds=(0.0, 100.0), doc="standard deviation of a row's reference")

    stage = Stage.THRESHOLD
    acts = Acts.DRAWN
    strength = "sigma_mV"
    identification = Identification(family="common", response=Response.QUADRATIC, needs=Needs.STEADY)

    def compare(self, now: ExposureBlock, memory: np.random.Generator) -> tuple[Shift, np.random.Generator]:
        return Shift(millivolts=self.sigma_mV * memory.standard_normal((now.frames, now.shape[0], 1))), memory
