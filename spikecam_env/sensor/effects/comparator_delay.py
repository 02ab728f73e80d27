"""Comparator delay: the comparator trips late, the later the slower the ramp; that light is lost.

    T = 1/x + c / sqrt(x)        x: charge a frame over threshold, T: mean interval [frames]

Stage: reset.  Seen in: flats at several levels (intervals longer by an amount that grows as 1/sqrt(x)).
Twins: dead_time (the same at all levels), photo_response_nonlinearity.
Within a frame: at the crossing, whose frame has the spike, by convention: of a camera whose bit is that of the tripped
comparator, spikes that trip after the frame's end come a frame later, with the same intervals in steady light.  The
light lost is the mean of its frame for as long as the node is held: below 1 % of a threshold off while d T'^2 < 0.02, d
the change of x from one frame to the next and T' = c / sqrt(x); refused where light bends by more.
Source: delay of a comparator on a slow ramp, square root of the time to cross a window (regenerative comparator).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, ExposureBlock, Feedback, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.types import Floats


@dataclass(frozen=True)
class ComparatorDelay(Effect):
    delay_us: float = parameter(0.1, unit="us", bounds=(0.0, 25.0), doc="delay c at one spike a frame (x = 1)")

    stage = Stage.RESET
    acts = Acts.CROSSING
    strength = "delay_us"
    identification = Identification(family="saturation", needs=Needs.LEVELS)

    def after_reset(self, residual: Floats, rate: Floats, now: ExposureBlock) -> Floats:
        return residual - np.sqrt(rate) * self.delay(now)

    def feedback(self, first: ExposureBlock) -> Feedback:
        return Feedback(lost_per_root_rate=self.delay(first))

    def delay(self, now: ExposureBlock) -> float:
        """The delay c [frames]."""
        return self.delay_us * 1e-6 * now.frame_rate_hz
