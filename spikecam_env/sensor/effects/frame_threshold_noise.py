"""Frame threshold noise: the comparator's reference is drawn anew in every frame, not at each reset.

    fires when charge >= 1 + sigma n_t / V_d,  n_t ~ N(0, 1) a pixel and frame
    mean interval T (1 - (sigma/V_d)^2 T) while sigma T << V_d

Stage: threshold.  Seen in: dim flats: many draws before a crossing make the lowest win, so intervals shorten with T.
Within a frame: drawn once a frame; by assumption it holds for the frame.
Source: SCSim's public script (6.36 mV), kept for comparison with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, ExposureBlock, Shift, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response
from spikecam_env.sensor.ground.random_fields import Words, white_field, words


@dataclass(frozen=True)
class FrameThresholdNoise(Effect):
    sigma_mV: float = parameter(6.36, unit="mV", bounds=(0.0, 100.0), doc="standard deviation of a frame's reference")

    stage = Stage.THRESHOLD
    acts = Acts.DRAWN
    strength = "sigma_mV"
    identification = Identification(family="noise", response=Response.QUADRATIC, needs=Needs.STEADY)

    def begin(self, first: ExposureBlock, pattern: np.random.Generator, rng: np.random.Generator) -> Words:
        return words(rng)

    def compare(self, now: ExposureBlock, memory: Words) -> tuple[Shift, Words]:
        return Shift(millivolts=white_field(memory, self.sigma_mV, now.number, now.frames, now.shape)), memory
