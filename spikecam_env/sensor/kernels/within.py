"""Compiled: pixels whose reference moves within the frame (`crossing`), one by one.

A band's row of pixels has the least of its references over the frame as limits (`block_loop`): who is not up to that at
the frame's end does not fire.  Those that are, are looked at here; some only came near.
"""

from __future__ import annotations

from spikecam_env.compiled import njit
from spikecam_env.sensor.light import GRAINS, LEAST_LIMIT

NEVER = 2.0

_G = float(GRAINS)
_TRIPS = float(LEAST_LIMIT)


@njit(inline="always")
def stands(k, phi, waves, field, grains_per_mV, load):  # type: ignore[no-untyped-def]
    """Where the reference of a pixel of threshold phi [grains] stands at node k."""
    return (phi * waves[0][k] + grains_per_mV * (waves[1][k] + field)) * load


@njit(inline="always")
def between(k, u, at, low, high):  # type: ignore[no-untyped-def]
    """At u, of what is low at node k - 1 and high at node k."""
    return low + (high - low) * ((u - at[k - 1]) / (at[k] - at[k - 1])) if u > at[k - 1] else low


@njit(inline="always")
def node_after(since, at):  # type: ignore[no-untyped-def]
    """The first node after a moment; of the frame's start, the second of all."""
    k = 1
    while since > 0.0 and k < at.size and at[k] <= since:
        k += 1
    return k


@njit(nogil=True, error_model="numpy", boundscheck=False)
def first_crossing(begin, gained, since, phi, at, waves, field, grains_per_mV, load):  # type: ignore[no-untyped-def]
    """As `crossing.first_crossing`, of one pixel, with the node at or after the crossing.

    phi, begin, gained [grains].  at, waves (factor, common [mV]): (n,).
    """
    k = node_after(since, at)
    if k == at.size:
        return NEVER, 0.0, k
    low = max(stands(k - 1, phi, waves, field, grains_per_mV, load), _TRIPS)
    high = max(stands(k, phi, waves, field, grains_per_mV, load), _TRIPS)
    limit = between(k, since, at, low, high)
    u, over = since, (begin + gained * since) - limit
    if over >= 0.0:
        return u, limit if since == 0.0 else begin + gained * since, k
    while k < at.size:
        limit = max(stands(k, phi, waves, field, grains_per_mV, load), _TRIPS)
        before, over = over, (begin + gained * at[k]) - limit
        if over >= 0.0:
            here = u + (at[k] - u) * (before / (before - over))
            return here, begin + gained * here, k
        u = at[k]
        k += 1
    return NEVER, 0.0, k
