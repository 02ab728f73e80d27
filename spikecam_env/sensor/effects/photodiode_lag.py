"""Photodiode lag: part of the light's charge arrives late, through traps or a slow transfer.

    x <- (1 - f) x + f h_tau * x,   h_tau(t) = exp(-t/tau) / tau
    after a step: (1 - f) + f (1 - exp(-t/tau))

Stage: photodiode.  Seen in: steps and moving light (tails of length tau); static light is unchanged.
Twins: incomplete_reset (depends on the last interval, not on the last light), optical_blur.
Within a frame: integrated over the frame, between keys.
Source: first-order image lag (Janesick, Photon Transfer); light before frame 0 is taken as steady.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spikecam_env.compiled import njit
from spikecam_env.sensor.effects.base import Acts, Charge, Effect, ExposureBlock, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.sensor.frame_moments import decay_moment
from spikecam_env.types import Floats


@dataclass(frozen=True)
class PhotodiodeLag(Effect):
    fraction: float = parameter(0.05, unit="relative", bounds=(0.0, 1.0), doc="share f of the charge that is late")
    tau_us: float = parameter(1000.0, unit="us", bounds=(0.1, 1e7), doc="time constant of the late charge")

    stage = Stage.PHOTODIODE
    acts = Acts.INTEGRATED
    strength = "fraction"
    wants_rise = True
    identification = Identification(
        family="lag",
        fitted=("fraction", "tau_us"),
        shapes={"tau_us": (150.0, 600.0, 2500.0, 10000.0)},
        needs=Needs.MOTION,
        only_contrast=True,
    )

    def begin(self, first: ExposureBlock, pattern: np.random.Generator, rng: np.random.Generator) -> None:
        return None

    def collect(
        self, light: Charge, dark: Charge, now: ExposureBlock, memory: Floats | None
    ) -> tuple[Charge, Charge, Floats | None]:
        x, d = light.values, light.rises
        moves = bool(d.any())
        slow = (x[0] - 0.5 * d[0] if moves else x[0]) if memory is None else memory
        if len(x) == 1 and not moves and np.array_equal(slow, x[0]):
            return light, dark, slow
        shape = (now.frames, *now.shape)
        x, d = (_flat(a if np.ndim(a) else np.zeros((1, 1, 1)), shape) for a in (x, d))
        late, rises, slow = np.empty((now.frames, x.shape[1])), np.empty((now.frames, x.shape[1])), slow.flatten()
        _follow(x, d, self.fraction, self._law(now), slow, late, rises)
        return Charge(late.reshape(shape), 1.0, rises.reshape(shape)), dark, slow.reshape(now.shape)

    def _law(self, now: ExposureBlock) -> tuple[float, ...]:
        """Weights of light x + d (t - 1/2) and of the charge s that lags at a frame's start: see `_follow`."""
        tau = self.tau_us * 1e-6 * now.frame_rate_hz
        kept = math.exp(-1.0 / tau)
        mean = -tau * math.expm1(-1.0 / tau)
        return kept, 0.5 - tau + (0.5 + tau) * kept, mean, mean / 2.0 + tau * (mean - 1.0), tau + 0.5, decay_moment(tau)


def _flat(values: Floats, shape: tuple[int, int, int]) -> Floats:
    """(F, H, W), or (1, H, W) where all frames are alike, as (F or 1, P)."""
    return np.ascontiguousarray(np.broadcast_to(values, (len(values), *shape[1:]))).reshape(len(values), -1)


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def _follow(
    x: Floats, d: Floats, fraction: float, law: tuple[float, ...], slow: Floats, mean: Floats, rise: Floats
) -> None:
    """mean, rise (F, P), overwritten: charge of which a part is late.  x, d: (F or 1, P).  slow (P,): charge that lags,

    s(t) = L(t) - d tau + (s - x + d/2 + d tau) exp(-t/tau).
    """
    kept, kept_rise, late, late_rise, reach, moment = law
    x_moves, d_moves = x.shape[0] > 1, d.shape[0] > 1
    for f in range(mean.shape[0]):
        xs, ds, means, rises = x[f * x_moves], d[f * d_moves], mean[f], rise[f]
        for p in range(slow.size):
            behind, slope = slow[p] - xs[p], ds[p]
            means[p] = xs[p] + fraction * (behind * late + slope * late_rise)
            rises[p] = slope + fraction * 12.0 * (behind + slope * reach) * moment
            slow[p] = xs[p] + behind * kept + slope * kept_rise
