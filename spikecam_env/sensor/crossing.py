"""When a pixel fires whose reference moves within the frame: the first moment at which its charge is up to it.

    q(u) = begin + gained u,  u: 0 .. 1 of the frame;   fires at the first u at which q(u) >= limit(u)

The limit is linear between nodes; where it jumps there are two nodes at the same moment.  A reset clears the pixel: it
takes q(u), with what a jump of the limit left above it, and what comes afterwards is kept.  At a frame's start it takes
the limit: what holds for a frame, and may be another in the next, is a course sampled once a frame.

The same operations in the same order as `kernels.within`, for many pixels at once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NEVER = 2.0
"""The moment of a crossing that is not in the frame."""


def first_crossing(begin: Array, gained: Array, since: Array, at: Array, limits: Array) -> tuple[Array, Array]:
    """When pixels are first at their limits from `since` on (P,), NEVER if not, and what the reset takes (P,) [grains].

    begin: charge at the frame's start, if it came as now since then; gained: charge of the frame (P,) [grains].
    at: (n, P) moments of the nodes, 0 .. 1; limits: (n, P) [grains].
    """
    moment, taken = np.full(begin.size, NEVER), np.zeros(begin.size)
    u, over = since.copy(), np.empty(begin.size)
    begun, done = np.zeros((2, begin.size), dtype=np.bool_)
    for k in range(1, len(at)):
        opens = ~begun & ((at[k] > since) | (since == 0.0))
        width = np.where(at[k] > at[k - 1], at[k] - at[k - 1], 1.0)
        share = np.where(since > at[k - 1], (since - at[k - 1]) / width, 0.0)
        limit = limits[k - 1] + (limits[k] - limits[k - 1]) * share
        over = np.where(opens, (begin + gained * since) - limit, over)
        at_once = opens & (over >= 0.0)
        moment[at_once] = since[at_once]
        taken[at_once] = np.where(since == 0.0, limit, begin + gained * since)[at_once]
        begun, done = begun | opens, done | at_once
        before, over = over, np.where(begun, (begin + gained * at[k]) - limits[k], over)
        crosses = begun & ~done & (over >= 0.0)
        share = before[crosses] / (before[crosses] - over[crosses])
        here = u[crosses] + (at[k] - u)[crosses] * share
        moment[crosses] = here
        taken[crosses] = begin[crosses] + gained[crosses] * here
        done |= crosses
        u = np.where(begun, at[k], u)
    return moment, taken
