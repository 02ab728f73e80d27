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


def first_crossing(begin: float, gained: float, since: float, at: Numbers, limits: Numbers) -> tuple[float, float]:
    """When a pixel is first at its limit from `since` on, NEVER if not, and the charge that the reset takes [grains].

    begin: charge at the frame's start, if it came as now since then; gained: charge of the frame [grains].
    at: moments of the nodes, 0 .. 1, ascending; limits: at each [grains].
    """
    k = 1
    while since > 0.0 and k < len(at) and at[k] <= since:
        k += 1
    if k == len(at):
        return 2.0, 0.0
    limit = limits[k - 1]
    if since > at[k - 1]:
        limit = limit + (limits[k] - limit) * ((since - at[k - 1]) / (at[k] - at[k - 1]))
    u, over = since, (begin + gained * since) - limit
    if over >= 0.0:
        return u, limit if since == 0.0 else begin + gained * since
    while k < len(at):
        before, over = over, (begin + gained * at[k]) - limits[k]
        if over >= 0.0:
            moment = u + (at[k] - u) * (before / (before - over))
            return moment, begin + gained * moment
        u = at[k]
        k += 1
    return 2.0, 0.0
