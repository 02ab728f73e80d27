"""Dead time: after a spike the reset switch holds the node for tau, and that light is lost.

    T = 1/x + tau        x: charge a frame over threshold, T: mean interval [frames]

Stage: reset.  Seen in: flats at x > 0.3 (every interval longer by tau, whatever the level).
Twins: comparator_delay (grows as 1/sqrt(x)), photo_response_nonlinearity.
Within a frame: at the crossing; the light lost is the mean of its frame for as long as the node is held: below 1 % of a
threshold off while d tau^2 < 0.02, d the change of x from one frame to the next; refused where light bends by more.
In light above one spike a frame and of 50 electrons to a threshold, the reference is off by 0.5 % in the rate.
Source: SCSim's script (0.2 % of a 50 us frame).
"""

from __future__ import annotations

from dataclasses import dataclass

from spikecam_env.sensor.effects.base import Acts, Effect, ExposureBlock, Feedback, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.types import Floats


@dataclass(frozen=True)
class DeadTime(Effect):
    tau_us: float = parameter(0.1, unit="us", bounds=(0.0, 25.0), doc="time without integration after a spike")

    stage = Stage.RESET
    acts = Acts.CROSSING
    strength = "tau_us"
    identification = Identification(family="saturation", needs=Needs.LEVELS)

    def after_reset(self, residual: Floats, rate: Floats, now: ExposureBlock) -> Floats:
        return residual - rate * self.tau(now)

    def feedback(self, first: ExposureBlock) -> Feedback:
        return Feedback(lost_per_rate=self.tau(first))

    def tau(self, now: ExposureBlock) -> float:
        """The dead time [frames]."""
        return self.tau_us * 1e-6 * now.frame_rate_hz
