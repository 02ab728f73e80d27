"""Changes in continuous time, with their integrals in closed form; times in frames.

A wave has `value(t)` and `area(t)`, an antiderivative: whoever needs a mean over a stretch of time takes a difference,
so that nothing is sampled, however fast the wave.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Wave(Protocol):
    """A function of time."""

    def value(self, t: Array) -> Array:
        """Its value at each time."""
        ...

    def area(self, t: Array) -> Array:
        """An antiderivative at each time."""
        ...


@dataclass(frozen=True)
class Sine:
    """1 + amplitude sin(2 pi (cycles t + phase)); cycles: a frame."""

    amplitude: float
    cycles: float
    phase: float

    def value(self, t: Array) -> Array:
        return 1.0 + self.amplitude * np.sin(2.0 * np.pi * (self.cycles * t + self.phase))

    def area(self, t: Array) -> Array:
        if self.cycles == 0.0:
            return t * self.value(np.zeros(1))[0]
        turns = 2.0 * np.pi * (self.cycles * t + self.phase)
        return t - self.amplitude / (2.0 * np.pi * self.cycles) * np.cos(turns)


@dataclass(frozen=True)
class Switched:
    """`first` for the first `frames` of every period, `then` after; phase: frames into a period at time 0."""

    period: float
    frames: float
    phase: float
    first: float
    then: float

    def value(self, t: Array) -> Array:
        return np.where((t + self.phase) % self.period < self.frames, self.first, self.then)

    def area(self, t: Array) -> Array:
        whole, into = np.divmod(t + self.phase, self.period)
        return self.then * t + (self.first - self.then) * (whole * self.frames + np.minimum(into, self.frames))


@dataclass(frozen=True)
class Rise:
    """1 + rise (1 - exp(-(t - begin) / tau)) from `begin` on, 1 before."""

    rise: float
    tau: float
    begin: float = 0.0

    def value(self, t: Array) -> Array:
        return 1.0 - self.rise * np.expm1(-np.maximum(t - self.begin, 0.0) / self.tau)

    def area(self, t: Array) -> Array:
        gone = np.maximum(t - self.begin, 0.0)
        return t + self.rise * (gone + self.tau * np.expm1(-gone / self.tau))


@dataclass(frozen=True)
class Flashes:
    """height exp(-(t - at) / tau) after each moment, added up.  at: (N,)."""

    at: Array
    height: float
    tau: float

    def value(self, t: Array) -> Array:
        total = np.zeros(np.shape(t))
        for at in self.at:
            total += np.where(t >= at, self.height * np.exp(-np.maximum(t - at, 0.0) / self.tau), 0.0)
        return total

    def area(self, t: Array) -> Array:
        total = np.zeros(np.shape(t))
        for at in self.at:
            total -= self.height * self.tau * np.expm1(-np.maximum(t - at, 0.0) / self.tau)
        return total


class Polygon:
    """Straight lines between points, constant outside.  time: (K,), rising.  height: (K,)."""

    def __init__(self, time: Array, height: Array) -> None:
        self.time, self.height = np.asarray(time, float), np.asarray(height, float)
        below = 0.5 * (self.height[1:] + self.height[:-1]) * np.diff(self.time)
        self.below = np.concatenate([[0.0], np.cumsum(below)])

    def value(self, t: Array) -> Array:
        return np.interp(t, self.time, self.height)

    def area(self, t: Array) -> Array:
        i = np.clip(np.searchsorted(self.time, t, side="right") - 1, 0, len(self.time) - 1)
        return self.below[i] + 0.5 * (self.height[i] + self.value(t)) * (t - self.time[i])


@dataclass(frozen=True)
class Clock:
    """A line that falls at the moment `phase` of every frame to -amplitude and recovers with `tau`, for ever:

        c(w) = -amplitude exp(-w / tau),   w: frames since the last edge

    the sum of the tails of all edges so far, each of amplitude (1 - exp(-1 / tau)): a square wave through a capacitor.
    It jumps at the edge: whoever uses it must cut there, and at `nodes` after.
    """

    amplitude: float
    phase: float
    tau: float
    pieces: int = 12

    def nodes(self) -> Array:
        """(pieces,) moments after an edge, between which straight lines are off by a 300th of the amplitude at most."""
        end = np.exp(-0.5 / self.tau)
        return -2.0 * self.tau * np.log(1.0 + (end - 1.0) * np.arange(self.pieces) / self.pieces)

    def height(self, since: Array) -> Array:
        """Value `since` frames (0 .. 1) after an edge; 1: just before the next one."""
        return -self.amplitude * np.exp(-since / self.tau)


@dataclass(frozen=True)
class SlewingClock(Clock):
    """The same edge, from which the line comes back along a straight one, in 2 tau."""

    def nodes(self) -> Array:
        return np.array([0.0, min(2.0 * self.tau, 0.999)])

    def height(self, since: Array) -> Array:
        return -self.amplitude * np.maximum(1.0 - since / (2.0 * self.tau), 0.0)


def means(waves: Sequence[Wave], t: Array) -> Array:
    """Product of the waves' means between successive times of the last axis (0 between equal ones); exact for one."""
    span = np.diff(t, axis=-1)
    product = np.ones((*t.shape[:-1], t.shape[-1] - 1))
    for wave in waves:
        product *= np.diff(wave.area(t), axis=-1) / np.where(span > 0.0, span, 1.0)
    return product
