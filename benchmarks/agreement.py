"""Do two engines follow one law?  Two-sample tests on the spikes of two cameras, pixel by pixel.

Every test takes one value a pixel, so its samples are independent, and compares two histograms by chi-square.
Blind to spikes beyond the first ones, and to dependence over more than three intervals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from spikecam_env.sensor.light import Keyframes
from spikecam_env.sensor.sensor import SpikeSensor

_LEAST = 40
"""Smallest number of values, of both samples, in a histogram's cell."""

_LEVELS = 12
"""Levels to which each member of a pair is cut, at most."""


@dataclass(frozen=True)
class ObservedSpikes:
    """Spikes of P pixels."""

    spike: NDArray[np.int64]
    """(P, n) frames of the first n spikes, -1 where one came too late."""
    count: NDArray[np.int64]
    """(P,) number of spikes."""
    word: NDArray[np.int64]
    """(P,) frames 8 .. 24 as sixteen bits."""

    @property
    def interval(self) -> NDArray[np.int64]:
        """(P, n-1) intervals [frames]; -1 where its second spike came too late."""
        return np.where(self.spike[:, 1:] < 0, -1, np.diff(self.spike, axis=1))


def observe(sensor: SpikeSensor, light: Keyframes | ArrayLike, frames: int, spikes: int = 5) -> ObservedSpikes:
    """Run a sensor for `frames` frames, and keep the first spikes, the counts and a word of each pixel."""
    pixels = sensor.shape[0] * sensor.shape[1]
    spike = np.full((pixels, spikes), -1, dtype=np.int64)
    count = np.zeros(pixels, dtype=np.int64)
    word = np.zeros(pixels, dtype=np.int64)
    for first in range(0, frames, 64):
        block = sensor.step(light, min(64, frames - first)).reshape(-1, pixels)
        for i, frame in enumerate(block):
            fires = np.flatnonzero(frame)
            noted = fires[count[fires] < spikes]
            spike[noted, count[noted]] = first + i
            count[fires] += 1
            if 8 <= first + i < 24:
                word = 2 * word + frame
    return ObservedSpikes(spike, count, word)


def compare(a: ObservedSpikes, b: ObservedSpikes) -> dict[str, float]:
    """p-values that a and b are of one law, by name; a test without two cells to compare is left out."""
    ia, ib = a.interval, b.interval
    tests = {"first spike": same_law(a.spike[:, 0], b.spike[:, 0])}
    for k in range(ia.shape[1]):
        tests[f"interval {k + 1}"] = same_law(ia[:, k], ib[:, k])
    tests["two intervals"] = same_law(*_pairs(ia[:, 0], ia[:, 1], ib[:, 0], ib[:, 1]))
    tests["two intervals, two apart"] = same_law(*_pairs(ia[:, 0], ia[:, 2], ib[:, 0], ib[:, 2]))
    tests["count"] = same_law(a.count, b.count)
    tests["16-bit word"] = same_law(a.word, b.word)
    return {name: p for name, p in tests.items() if p is not None}


def neighbours(a: ObservedSpikes, distances: tuple[int, ...] = (1, 16, 256)) -> dict[str, float]:
    """p-values that intervals of pixels at these distances are independent; for light that is alike everywhere."""
    tests = {}
    for distance in distances:
        pixels = a.count.size // (2 * distance) * 2 * distance
        paired = a.interval[:pixels, 1].reshape(-1, 2, distance)
        p = independent(paired[:, 0].ravel(), paired[:, 1].ravel())
        if p is not None:
            tests[f"neighbour at {distance}"] = p
    return tests


def same_law(a: NDArray[np.int64], b: NDArray[np.int64]) -> float | None:
    """Chi-square p-value that two samples of whole numbers are of one law; neighbouring values share thin cells."""
    low = min(a.min(), b.min())
    size = int(max(a.max(), b.max()) - low) + 1
    table = np.array([np.bincount(a - low, minlength=size), np.bincount(b - low, minlength=size)])
    table = np.add.reduceat(table, _cells(table.sum(axis=0), _LEAST), axis=1)
    return float(stats.chi2_contingency(table, correction=False).pvalue) if table.shape[1] > 1 else None


def independent(x: NDArray[np.int64], y: NDArray[np.int64]) -> float | None:
    """Chi-square p-value that paired samples are independent, each cut to a few levels."""
    (level_x, level_y), size = _levels(x, y)
    table = np.bincount(level_x * size + level_y, minlength=size**2).reshape(size, size)
    return float(stats.chi2_contingency(table, correction=False).pvalue) if size > 1 else None


def _pairs(
    ax: NDArray[np.int64], ay: NDArray[np.int64], bx: NDArray[np.int64], by: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    (ax, ay, bx, by), size = _levels(ax, ay, bx, by)
    return ax * size + ay, bx * size + by


def _levels(*samples: NDArray[np.int64]) -> tuple[list[NDArray[np.int64]], int]:
    """Samples cut alike into at most _LEVELS levels of like size, and the number of levels."""
    together = np.concatenate(samples)
    low = together.min()
    counts = np.bincount(together - low)
    starts = _cells(counts, together.size // _LEVELS)
    return [np.searchsorted(starts, s - low, side="right") - 1 for s in samples], starts.size


def _cells(counts: NDArray[np.int64], least: int) -> NDArray[np.int64]:
    """Where to start cells of neighbouring values so that each holds `least`; the last may hold more."""
    starts, held = [0], 0
    for i in np.flatnonzero(counts):
        if held >= least:
            starts.append(int(i))
            held = 0
        held += int(counts[i])
    if held < least and len(starts) > 1:
        starts.pop()
    return np.array(starts)
