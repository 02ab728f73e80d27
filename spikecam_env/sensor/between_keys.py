"""Exact integrals of light that is linear between keys and constant outside: sums over keys, with weights of the times
alone.

    mean of [a, b] = sum_k m_k L_k          rise = sum_k r_k L_k = 12 / (b - a)^2 integral of (t - (a + b)/2) L(t) dt

The rise is that of the straight line with the mean and the first moment of the light: integrals over part of a frame
need it besides the mean.  All is float64.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spikecam_env.types import Floats


class KeyWeights(NamedTuple):
    """Weights of the keys first .. first + n."""

    first: int
    mean: Floats
    """(n,)."""
    rise: Floats
    """(n,)."""


def key_weights(times: Floats, start: float, stop: float) -> KeyWeights:
    """Weights of keys at `times` (K,), strictly increasing, for the mean over [start, stop] and the rise within it."""
    after = int(np.searchsorted(times, start, side="right"))
    until = int(np.searchsorted(times, stop, side="left"))
    first, last = max(after - 1, 0), min(until, times.size - 1)
    points = np.concatenate([[start], times[after:until], [stop]])
    length, span = np.diff(points), stop - start
    arm = (points[1:] + points[:-1] - (start + stop)) / 2.0
    of_points = np.zeros((2, points.size))
    of_points[:, :-1] += length / 2.0 / span, length * (arm / 2.0 - length / 12.0) * (12.0 / span**2)
    of_points[:, 1:] += length / 2.0 / span, length * (arm / 2.0 + length / 12.0) * (12.0 / span**2)
    weights = np.zeros((2, last - first + 1))
    weights[:, after - first : until - first] = of_points[:, 1:-1]
    for t, weight in ((start, of_points[:, 0]), (stop, of_points[:, -1])):
        key, share = _place(times, t)
        weights[:, key - first] += weight * (1.0 - share)
        if share > 0.0:
            weights[:, key + 1 - first] += weight * share
    return KeyWeights(first, weights[0], weights[1])


def frame_means(times: Floats, values: Floats, frames: int) -> Floats:
    """Mean (F,) over each frame [n, n + 1) of a quantity with values (K,) at `times`, e.g. of uniform light."""
    edges = np.arange(frames + 1, dtype=np.float64)
    before = np.concatenate([[0.0], np.cumsum(np.diff(times) * (values[1:] + values[:-1]) / 2.0)])
    key = np.clip(np.searchsorted(times, edges, side="right") - 1, 0, times.size - 1)
    beyond = edges - times[key]
    at_edge = np.interp(edges, times, values)
    return np.diff(before[key] + beyond * (values[key] + at_edge) / 2.0)


def _place(times: Floats, t: float) -> tuple[int, float]:
    """The last key at or before t, or the first key, and how far t is on the way to the next, in [0, 1)."""
    key = int(np.searchsorted(times, t, side="right")) - 1
    if key < 0 or key == times.size - 1:
        return max(key, 0), 0.0
    return key, float((t - times[key]) / (times[key + 1] - times[key]))
