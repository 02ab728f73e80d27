"""When a pixel fires whose reference moves within the frame: the first moment at which its charge is up to it.

    q(u) = begin + gained u,  u: 0 .. 1 of the frame;   fires at the first u at which q(u) >= limit(u)

The limit is linear between nodes; where it jumps there are two nodes at the same moment.  A reset clears the pixel: it
takes q(u), with what a jump of the limit or a neighbour's kick left above it, and what comes afterwards is kept.  At a
frame's start it takes the limit: what holds for a frame, and may be another in the next, is a course sampled once a
frame.

In numbers alone, so that numpy's world and a compiled loop give the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Numbers = Sequence[float] | NDArray[np.float64]

NEVER = 2.0
"""The moment of a crossing that is not in the frame."""

MOST_AGAIN = 8
"""Times at most that what a reset left takes a pixel to its threshold once more in a frame.  A reset leaves half a
threshold at most, so that six use up the three thresholds a frame can hold; a reference far below the nominal would go
on for ever, and what is above it is there in the next frame."""


def first_crossing(begin: float, gained: float, since: float, at: Numbers, limits: Numbers) -> tuple[float, float]:
    """When a pixel is first at its limit from `since` on, NEVER if not, and the charge that the reset takes [grains].

    begin: charge at the frame's start, if it came as now since then; gained: charge of the frame [grains].
    at: moments of the nodes, 0 .. 1, ascending; limits: at each [grains].
    """
    least = min(limits)
    for k in range(1, len(at)):
        if begin + gained * at[k] < least:
            continue
        moment, taken = crossing_between(begin, gained, since, at[k - 1], at[k], limits[k - 1], limits[k])
        if moment != NEVER:
            return moment, taken
    return NEVER, 0.0


def crossing_between(
    begin: float, gained: float, since: float, u: float, v: float, low: float, high: float
) -> tuple[float, float]:
    """As `first_crossing`, between two nodes: the limit goes straight from low at u to high at v [grains]."""
    if 0.0 < since >= v:
        return NEVER, 0.0
    limit = low
    if since > u:
        u, limit = since, low + (high - low) * ((since - u) / (v - u))
    before = (begin + gained * u) - limit
    if before >= 0.0:
        return u, limit if u == 0.0 else begin + gained * u
    over = (begin + gained * v) - high
    if over >= 0.0:
        moment = u + (v - u) * (before / (before - over))
        return moment, begin + gained * moment
    return NEVER, 0.0
