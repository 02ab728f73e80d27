"""Incomplete reset: a reset leaves some charge behind, the more the longer the interval before it.

    charge after a reset = f (1 - exp(-T/tau)) of a threshold,  T: the interval that has just ended
    steady light: T = (1 - f (1 - exp(-T/tau))) / x;   a long interval is followed by a shorter one

Stage: reset.  Seen in: flats over a wide range of levels; steps of light (the first interval after one is off).
Twins: photodiode_lag (follows the light, in static light nothing), dead_time (the same at all levels).
Within a frame: at the end of the frame; charge left may take a pixel to its threshold once more in the frame, a spike
that is lost.  Of light that comes unevenly, the interval is timed as if it came evenly (refused beyond 1 %).
Source: image lag of a soft reset (Pain et al. 1999, sub-threshold reset); exponential filling of slow states assumed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, ExposureBlock, Feedback, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.sensor.ground.decay import LONG, decayed
from spikecam_env.types import Floats, Masks


@dataclass(frozen=True)
class IncompleteReset(Effect):
    fraction: float = parameter(0.02, unit="relative", bounds=(0.0, 0.5), doc="charge f left after a long interval")
    tau_us: float = parameter(250.0, unit="us", bounds=(0.1, 1e7), doc="time constant of filling")

    stage = Stage.RESET
    acts = Acts.END
    strength = "fraction"
    identification = Identification(
        family="reset", fitted=("fraction", "tau_us"), shapes={"tau_us": (50.0, 250.0, 1250.0)}, needs=Needs.LEVELS
    )

    def begin(self, first: ExposureBlock, pattern: np.random.Generator, rng: np.random.Generator) -> Floats:
        return np.full(first.shape, -np.inf)

    def spiked(
        self, charge: Floats, spikes: Masks, rate: Floats, now: ExposureBlock, memory: Floats
    ) -> tuple[Floats, Floats]:
        at = np.flatnonzero(spikes)
        over = np.clip(charge.flat[at] / np.maximum(rate.flat[at], 1e-12), 0.0, 1.0)
        crossing, last = now.number + 1.0 - over, memory.copy()
        left = charge.copy()
        ended = np.maximum(crossing - memory.flat[at], 0.0)
        left.flat[at] -= self.fraction * (decayed(np.minimum(ended / self.tau(now), LONG)) - 1.0)
        last.flat[at] = crossing
        return left, last

    def feedback(self, first: ExposureBlock) -> Feedback:
        return Feedback(left=self.fraction, left_tau=self.tau(first))

    def tau(self, now: ExposureBlock) -> float:
        """Time constant of filling [frames]."""
        return self.tau_us * 1e-6 * now.frame_rate_hz
