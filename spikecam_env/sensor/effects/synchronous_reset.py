"""Synchronous reset: the node is held at reset from the crossing to the read-out, and that light is lost.

    T = ceil(1/x) for steady light x;  averaged over x: mean interval + 1/2, successive intervals uncorrelated

Stage: reset.  Seen in: flats (intervals locked to whole frames).
Within a frame: at the crossing, exactly; of a share, each electron after it brings so much less.
Source: simulators that set the accumulator to zero.
"""

from __future__ import annotations

from dataclasses import dataclass

from spikecam_env.sensor.effects.base import Acts, Effect, ExposureBlock, Feedback, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.types import Floats


@dataclass(frozen=True)
class SynchronousReset(Effect):
    fraction: float = parameter(
        1.0, unit="relative", bounds=(0.0, 1.0), doc="share of the charge after the crossing lost"
    )

    stage = Stage.RESET
    acts = Acts.CROSSING
    strength = "fraction"
    identification = Identification(family="reset", needs=Needs.STEADY)

    def after_reset(self, residual: Floats, rate: Floats, now: ExposureBlock) -> Floats:
        return residual * (1.0 - self.fraction)

    def feedback(self, first: ExposureBlock) -> Feedback:
        return Feedback(kept=1.0 - self.fraction)
