"""How the phases of a pixel's spikes walk through the clock's frame under a periodic disturbance c(v).

    charge since the reset:  (t' - t) / T >= 1 + xi + c(t')          xi: noise of one spike, standard deviation s
    so                       t' = Theta(t + T + T xi),  Theta inverse to  Psi(t) = max over t'' <= t of (t'' - T c(t''))

t, t' are times of successive crossings [frames], by the array's clock; c is in thresholds and has period 1, so both
maps do.  Psi rises by -T a where the threshold falls by -a: everything within the fall crosses at once.  Its level
stretches are moments at which nothing crosses, while a raised threshold is caught up with.

With T = n + d the phase moves on by d + T c(v) a spike.  Where this has a zero the phase stays (the pixel is gathered);
elsewhere it dwells as 1 / (d + T c).  y = Psi(t') has a density even where t' has none:

    p(y') = integral of p(y) N(y'; Theta(y) + T, (sT)^2) dy       on the circle

A row whose bits are counted from phase b of the clock on, frame floor(t - b), sees an interval of n + 1 with
probability up, one of n - 1 with probability down.  With B = Psi(b), over B <= y < B + 1:

    up   = integral of p(y) P(Theta(y) + d + T xi >= B + 1) dy
    down = integral of p(y) P(Theta(y) + d + T xi <  B) dy

up - down is the mean drift, the same for all b: the pixel's rate says it.  up + down is large where the phase dwells
at b. So a row measures how long its pixels stay at its own b, and the rows together measure it at all phases that
they cover.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from spikecam_env.types import Floats

PHASES = 128
"""Cells of the circle for densities: 0.008 frames, half the noise of a spike at an interval of 2 frames."""

_FINE = 4000
"""Points of a frame at which Psi is tabled."""


def edge(phase: Floats, amplitude: float, moment: float, tau: float) -> Floats:
    """c(v) of one edge a frame: amplitude * exp(-((v - moment) mod 1) / tau) less its mean; tau [frames]."""
    mean = tau * -np.expm1(-1.0 / tau)
    shape: Floats = amplitude * (np.exp(-np.mod(phase - moment, 1.0) / tau) - mean)
    return shape


@dataclass(frozen=True)
class Walk:
    """Steps of spikes of intervals n + d: up, down (D, PHASES), for D offsets d and B = i / PHASES.

    time, target: a table of Psi, target at time, over phases from before 0 to beyond 1.
    """

    up: Floats
    down: Floats
    time: Floats
    target: Floats

    def at(self, offset: NDArray[np.int64], start: Floats) -> tuple[Floats, Floats]:
        """up, down of the d of indices `offset` for rows that begin at b = `start`; shapes broadcast."""
        cell = np.interp(np.mod(start, 1.0), self.time, self.target) * PHASES
        low = np.floor(cell).astype(np.int64)
        part = cell - low
        here, there = low % PHASES, (low + 1) % PHASES
        up, down = ((1 - part) * m[offset, here] + part * m[offset, there] for m in (self.up, self.down))
        return up, down


def walk(disturbance: Floats, noise: float, interval: float, offsets: Floats) -> Walk:
    """Steps of pixels of intervals interval + offsets (D,) [frames].

    disturbance: c(v) [thresholds] at v = i / its size, as `sampled` has it.  noise: s.
    """
    time, target = _psi(disturbance, interval)
    centres, begins = (np.arange(PHASES) + 0.5) / PHASES, np.arange(PHASES) / PHASES
    fires = np.interp(centres, target, time)
    sd = noise * interval
    turns = centres < begins[:, None]
    ahead = fires + turns - begins[:, None]
    up, down = np.empty((2, offsets.size, PHASES))
    for i, offset in enumerate(offsets):
        density = _stationary(fires + offset, sd)
        up[i] = _share_below((ahead + offset - 1.0) / sd) @ density
        down[i] = _share_below(-(ahead + offset) / sd) @ density
    return Walk(up, down, time, target)


def _share_below(deviates: Floats) -> Floats:
    """Of a normal law; shares below 1e-19 are 0: of 128 by 128 most are, and the exact ones take long."""
    share, counts = np.zeros_like(deviates), deviates > -9.0
    share[counts] = ndtr(deviates[counts])
    return share


def sampled(law: object, *arguments: float) -> Floats:
    """c(v) at the phases that `walk` takes."""
    values: Floats = law(np.arange(_FINE) / _FINE, *arguments)  # type: ignore[operator]
    return values


def _psi(disturbance: Floats, interval: float) -> tuple[Floats, Floats]:
    """t and Psi(t), rising, over phases from before 0 to beyond 1."""
    time = np.arange(-disturbance.size, 2 * disturbance.size) / disturbance.size
    target = np.maximum.accumulate(time - interval * np.tile(disturbance, 3))
    return time, target + 1e-12 * np.arange(target.size)


def _stationary(mean: Floats, sd: float) -> Floats:
    """(PHASES,) probabilities that do not change under y -> N(mean(y), sd^2), on the circle."""
    centres = (np.arange(PHASES) + 0.5) / PHASES
    apart = centres - mean[:, None]
    apart -= np.rint(apart)
    step = np.exp(-0.5 * (apart / sd) ** 2)
    step /= step.sum(axis=1, keepdims=True)
    equations = step.T - np.eye(PHASES)
    equations[-1] = 1.0
    right = np.zeros(PHASES)
    right[-1] = 1.0
    probability: Floats = np.linalg.solve(equations, right)
    return probability
