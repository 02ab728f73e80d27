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

from spikecam_env.compiled import njit
from spikecam_env.sensor.effects.base import Array, Charge, Effect, Exposure, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs


@dataclass(frozen=True)
class PhotodiodeLag(Effect):
    fraction: float = parameter(0.05, unit="relative", bounds=(0.0, 1.0), doc="share f of the charge that is late")
    tau_us: float = parameter(1000.0, unit="us", bounds=(0.1, 1e7), doc="time constant of the late charge")

    stage = Stage.PHOTODIODE
    strength = "fraction"
    identification = Identification(
        family="lag",
        fitted=("fraction", "tau_us"),
        shapes={"tau_us": (150.0, 600.0, 2500.0, 10000.0)},
        needs=Needs.MOTION,
        only_contrast=True,
    )

    def begin(self, first: Exposure, pattern: np.random.Generator, rng: np.random.Generator) -> None:
        return None

    def collect(
        self, light: Charge, dark: Charge, now: Exposure, memory: Array | None
    ) -> tuple[Charge, Charge, Array | None]:
        x = light.values
        slow = x[0] if memory is None else memory
        if len(x) == 1 and np.array_equal(slow, x[0]):
            return light, dark, slow
        tau = self.tau_us * 1e-6 * now.frame_rate_hz
        kept = math.exp(-1.0 / tau)
        late, slow = np.empty((now.frames, now.shape[0] * now.shape[1])), slow.flatten()
        _follow(np.ascontiguousarray(x).reshape(len(x), -1), self.fraction * tau * (1.0 - kept), kept, slow, late)
        return Charge(late.reshape(-1, *now.shape)), dark, slow.reshape(now.shape)


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def _follow(x, late, kept, slow, out):  # type: ignore[no-untyped-def]
    """out (F, P), overwritten: charge of which a part is late.  x: (F or 1, P).  slow: (P,) what lags, updated."""
    moves = x.shape[0] > 1
    for f in range(out.shape[0]):
        now, row = x[f * moves], out[f]
        for p in range(slow.size):
            behind = slow[p] - now[p]
            row[p] = now[p] + behind * late
            slow[p] = now[p] + behind * kept
