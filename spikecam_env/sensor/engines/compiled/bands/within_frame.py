"""Pixels whose references move within the frame: each fires at the first moment at which its charge is up to its own.

    level(u) = (phi factor(u) + grains_per_mV (common(u) + field)) load    u: 0 .. 1 of the frame, linear between nodes

Limits are the least of a frame; pixels above these are looked at again (`crossing`).
"""

from __future__ import annotations

import numpy as np

from spikecam_env.compiled import njit
from spikecam_env.sensor.engines.compiled.bands.arguments import FrameSway, SpikeLaw
from spikecam_env.sensor.engines.compiled.bands.lines import Lines
from spikecam_env.sensor.engines.compiled.bands.resets import reset_due
from spikecam_env.sensor.engines.compiled.bands.rows import (
    ARRIVES,
    AT,
    BAND,
    DUE,
    GROUP,
    HELD,
    INSIDE,
    LEAST,
    LIMIT,
    LOWEST,
    ONE,
    PHI,
    STANDS,
    Bytes,
    Places,
    Views,
    copy,
)
from spikecam_env.sensor.ground.crossing import NEVER, crossing_between
from spikecam_env.types import Floats, Pictures

PixelNumbers = tuple[float, float, float]
"""Field [mV], grains_per_mV and load of a pixel."""

between = njit(inline="always")(crossing_between)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def fire_within(
    band: Views, live: Places, groups: int, lines: Lines, begin: int, end: int, sway: FrameSway, law: SpikeLaw
) -> None:
    """As `fire`, of a band (lines begin .. end); row HIT is cut to pixels that fired."""
    x, words, hit, seen = band.x, band.words, band.hit, band.seen
    near = np.empty(BAND, np.int64)
    for g in range(groups):
        q = live[g] & INSIDE
        for j in range(q, q + GROUP):
            x[AT + j] = 0.0
    seen[:] = 0
    while groups:
        for line in range(begin, end):
            p0, n = lines.pixel[line], lines.width[line]
            of_pixels = sway.field[p0 : p0 + n], sway.grains_per_mV[p0 : p0 + n], sway.loads[lines.row[line]]
            find_crossings(x, hit, lines.slot[line], n, near, nodes_of(sway, lines.row[line]), of_pixels)
        for j in range(BAND):
            words[DUE + j] = hit[j]
            seen[j] |= hit[j]
        groups = reset_due(band, live, groups, law, True)
        for j in range(BAND):
            hit[j] &= x[HELD + j] >= x[LIMIT + j]
    copy(seen, hit)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def find_crossings(
    x: Floats,
    hit: Bytes,
    h0: int,
    n: int,
    near: Places,
    nodes: tuple[Floats, Floats, Floats],
    of_pixels: tuple[Pictures, Floats, float],
) -> None:
    """Crossings from moment AT on of the n pixels of a line at place h0 that hit their least limit.

    Args:
        x: rows AT, LIMIT and STANDS get moment, charge and level of the reference.
        hit: cut to pixels that fire.
        near: room for a band's places.
        nodes: moments, factor and common of the row.
        of_pixels: field, grains_per_mV and load.
    """
    at, factor, common = nodes
    field, grains_per_mV, load = of_pixels
    came = 0
    for i in range(n):
        near[came] = i
        came += hit[h0 + i]
    for c in range(came):
        i = near[c]
        j = h0 + i
        of_pixel = field[i], grains_per_mV[i], load
        moment, taken = next_crossing(x, j, x[AT + j], at, factor, common, of_pixel)
        hit[j] = moment != NEVER
        if moment != NEVER:
            x[AT + j], x[LIMIT + j] = moment, taken
            x[STANDS + j] = stands_at(moment, at, factor, common, of_pixel)


@njit(inline="always")
def nodes_of(sway: FrameSway, row: int) -> tuple[Floats, Floats, Floats]:
    """Moments, factor and common (n,) at the nodes of one row."""
    at, factor, common = sway.at, sway.factor, sway.common
    return (
        at[row if len(at) > 1 else 0],
        factor[row if len(factor) > 1 else 0],
        common[row if len(common) > 1 else 0],
    )


@njit(inline="always")
def limit_at(phi: float, factor: float, common: float, of_pixel: PixelNumbers) -> float:
    """Level of a threshold [grains], however low."""
    field, grains_per_mV, load = of_pixel
    return (phi * factor + grains_per_mV * (common + field)) * load


@njit(inline="always")
def next_crossing(
    x: Floats, j: int, since: float, at: Floats, factor: Floats, common: Floats, of_pixel: PixelNumbers
) -> tuple[float, float]:
    """`crossing.first_crossing` at place j of the scratch, without the nodes below its least limit."""
    held, gained, phi, least = x[HELD + j], x[ARRIVES + j], x[PHI + j], x[LIMIT + j]
    begin = held - gained
    last = at.size - 1
    k = int(max(min((least - begin) / max(gained, LEAST), 1.0), 0.0) * last)
    while k > 0 and begin + gained * at[k] >= least:
        k -= 1
    while k + 1 < last and begin + gained * at[k + 1] < least:
        k += 1
    low, moment, taken = max(limit_at(phi, factor[k], common[k], of_pixel), LOWEST), NEVER, 0.0
    while k < last and moment == NEVER:
        high = max(limit_at(phi, factor[k + 1], common[k + 1], of_pixel), LOWEST)
        moment, taken = between(begin, gained, since, at[k], at[k + 1], low, high)
        low = high
        k += 1
    return moment, taken


@njit(inline="always")
def stands_at(moment: float, at: Floats, factor: Floats, common: Floats, of_pixel: PixelNumbers) -> float:
    """Level of the reference of the nominal threshold at a moment [grains]."""
    last = at.size - 1
    k = int(moment * last)
    while k > 0 and at[k] > moment:
        k -= 1
    while k + 1 < last and at[k + 1] <= moment:
        k += 1
    share = (moment - at[k]) / (at[k + 1] - at[k]) if at[k + 1] > at[k] else 1.0
    low = limit_at(ONE, factor[k], common[k], of_pixel)
    high = limit_at(ONE, factor[k + 1], common[k + 1], of_pixel)
    return low + (high - low) * share
