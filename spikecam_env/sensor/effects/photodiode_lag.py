"""Photodiode lag: part of the light's charge arrives late, through traps or a slow transfer.

    x <- (1 - f) x + f h_tau * x,   h_tau(t) = exp(-t/tau) / tau
    after a step: (1 - f) + f (1 - exp(-t/tau))

Stage: photodiode.  Seen in: steps and moving light (tails of length tau); static light is unchanged.
Twins: incomplete_reset (depends on the last interval, not on the last light), optical_blur.
Source: first-order image lag (Janesick, Photon Transfer); light before frame 0 is taken as steady.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Array, Effect, Exposure, Stage, parameter


@dataclass(frozen=True)
class PhotodiodeLag(Effect):
    fraction: float = parameter(0.05, unit="relative", bounds=(0.0, 1.0), doc="share f of the charge that is late")
    tau_us: float = parameter(1000.0, unit="us", bounds=(0.1, 1e7), doc="time constant of the late charge")

    stage = Stage.PHOTODIODE
    strength = "fraction"

    def begin(self, first: Exposure, rng: np.random.Generator) -> None:
        return None

    def collect(
        self, light: Array, dark: Array, now: Exposure, memory: Array | None
    ) -> tuple[Array, Array, Array | None]:
        tau = self.tau_us * 1e-6 * now.frame_rate_hz
        slow = light if memory is None else memory
        kept = math.exp(-1.0 / tau)
        late = light + (slow - light) * (tau * (1.0 - kept))
        return (1.0 - self.fraction) * light + self.fraction * late, dark, light + (slow - light) * kept
