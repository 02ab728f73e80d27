"""When a pixel fires whose reference moves within the frame: the first moment at which its charge is up to it.

    q(u) = begin + gained u,  u: 0 .. 1 of the frame;   fires at the first u at which q(u) >= limit(u)

The limit is linear between nodes; where it jumps there are two nodes at the same moment.  A reset clears the pixel: it
takes q(u), with the charge that a jump of the limit or a neighbour's kick left above it.  Charge that comes afterwards
is kept.  At a frame's start the reset takes the limit: a reference that holds for a frame is sampled once a frame.

Plain arithmetic, so that numpy and a compiled loop give the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence

from spikecam_env.types import Floats

Numbers = Sequence[float] | Floats

NEVER = 2.0
"""The moment of a crossing that is not in the frame."""

MOST_AGAIN = 8
"""Times at most that charge left by a reset takes a pixel to its threshold once more in a frame.  A reset leaves half a
threshold at most, so that six use up the three thresholds a frame can hold.  A reference far below the nominal would go
on for ever; charge above it is kept for the next frame."""


def first_crossing(begin: float, gained: float, since: float, at: Numbers, limits: Numbers) -> tuple[float, float]:
    """When a pixel is first at its limit.

    Args:
        begin: charge at the frame's start, if it came as now since then [grains].
        gained: charge of the frame [grains].
        since: earliest moment.
        at: moments of the nodes, 0 .. 1, ascending.
        limits: at each node [grains].

    Returns:
        The moment, NEVER if there is none, and the charge that the reset takes [grains].
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
