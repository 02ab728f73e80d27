"""Crosstalk: the reset of a pixel couples into its four neighbours.

    charge += k for each neighbour that fires;   uniform light, away from the edge: rate = x / (1 - 4 k) + O(k^2)

when = "at_spike": at the moment of the spike, within the frame: a neighbour that is lifted over its threshold fires at
that moment, and its reset takes the surplus; pixels that would fire later in the frame do so the earlier.
when = "frame_end": at the end of the frame, for all that fired in it, and nothing is lost: exactly x / (1 - 4 k).

Stage: reset.  Seen in: coincidences of neighbours' spikes, at lag 0 more and at lag 1 fewer (frame_end: the other way
round); spots of light (a halo).
Twins: optical_blur (no coincidence), blooming (only beside saturated pixels).
Within a frame: at the crossing; the kick of frame_end at the end of the frame.  Kicks are bounded to 0.05: the fast
engine takes them without shot noise, and is off by a share k of a spike's variance (2.7 % of A_4 at k = 0.1, N = 150).
Of negative ones in light above one spike a frame it is off by 0.2 % in the rate at k = -0.05 and N = 100.
Source: capacitive coupling between nodes, k = C_coupling / C, which acts at once; frame_end is a simulator's short cut.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, ExposureBlock, Feedback, Stage, neighbour_sum, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response
from spikecam_env.types import Floats, Masks


@dataclass(frozen=True)
class Crosstalk(Effect):
    kick: float = parameter(0.002, unit="thresholds", bounds=(-0.05, 0.05), doc="charge k to each neighbour a spike")

    when: str = parameter("at_spike", unit="", choices=("at_spike", "frame_end"), doc="when the charge arrives")

    stage = Stage.RESET
    acts = Acts.CROSSING
    strength = "kick"
    identification = Identification(family="coupling", response=Response.MIXED, needs=Needs.STEADY)

    def spiked(
        self, charge: Floats, spikes: Masks, rate: Floats, now: ExposureBlock, memory: Any
    ) -> tuple[Floats, Any]:
        if self.when == "at_spike":
            return charge, memory
        return charge + self.kick * neighbour_sum(spikes.astype(np.float64)), memory

    def feedback(self, first: ExposureBlock) -> Feedback:
        return Feedback(kick_at_once=self.kick) if self.when == "at_spike" else Feedback(kick=self.kick)
