"""The scratch of a band of lines, row by row, and its groups of pixels.

A band has BAND places.  Its scratch is one array with fixed offsets, so that LLVM can prove that rows do not overlap:
rows of one size, of an array that it sees to be one.  Functions that are not inlined therefore take the scratch as
`Views`, one array a size, whose rows it compares at run time; and they make draws (float32) of the words themselves.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.sensor.light import GRAINS, LEAST_LIMIT, MOST_GRAINS
from spikecam_env.sensor.light import on_grid as rounded
from spikecam_env.types import Floats

Words = NDArray[np.uint32]
Bytes = NDArray[np.uint8]
Places = NDArray[np.int64]

BAND = 1024
"""Pixels of a band: its scratch stays in the processor's cache, frame after frame."""

GROUP = 16
"""Pixels that are computed together where one of them fires (LLVM would make no vector instructions of fewer)."""

# Rows of float64: charge [grains], limit, threshold, charge of the frame, level of the reference at a reset, its shift.
HELD, LIMIT, PHI, ARRIVES, STANDS, MOVED = (row * BAND for row in range(6))
# Factor and load of the reference, noise per electron, that of the reset, and electrons of the next spike's noise.
FACTOR, LOAD, NOISE, JITTER, ELECTRONS = (row * BAND for row in range(6, 11))
# Time of the last crossing, moment of this one, frame in which charge changes [frames].
CROSSED, AT, UNTIL = (row * BAND for row in range(11, 14))
# Rows of 32 bits: number of a pixel, its two keys, spikes so far, draw, whether it fires, whether its noise is read (a
# number a group), whether it fires again, and its number among those with extra dark charge.
PIXEL, FIRST, SECOND, FIRED, DRAW, DUE, AWAKE, AGAIN, EXTRA = ((28 + row) * BAND for row in range(9))
# Rows of 8 bits: whether a pixel fired, or is at its least limit; whether it has fired in this frame.
HIT, SEEN = (8 * 19 * BAND + row * BAND for row in range(2))
SCRATCH = 20 * BAND
NONE = 0xFFFFFFFF  # in row EXTRA
LEAST = 1e-30  # divides where no charge arrives
INSIDE = BAND - 1  # masks a group's start: not negative, so that numba leaves wrapping indices out

ONE = float(GRAINS)
"""A nominal threshold [grains]."""

LOWEST = float(LEAST_LIMIT)
"""Of limits [grains]."""

_MOST = float(MOST_GRAINS)
_Q = np.uint64

on_grid = njit(inline="always")(rounded)


class Views(NamedTuple):
    """A band's scratch by the size of its rows."""

    x: Floats
    words: Words
    hit: Bytes
    seen: Bytes


@njit(inline="always")
def views(x: Floats) -> Views:
    """Of the scratch of a band (SCRATCH,)."""
    small = x.view(np.uint8)
    return Views(x, x.view(np.uint32), small[HIT : HIT + BAND], small[SEEN : SEEN + BAND])


@njit(inline="always")
def copy(values: NDArray[Any], out: NDArray[Any]) -> None:
    """Values to `out`, of the same length."""
    for j in range(out.size):
        out[j] = values[j]


@njit(inline="always")
def frame_charge(light: float, dark: float) -> float:
    """Charge [grains] of a pixel in one frame, from light and dark [thresholds], neither below zero."""
    return on_grid(min((max(light, 0.0) + max(dark, 0.0)) * ONE, _MOST))  # type: ignore[no-any-return]


@njit(inline="always")
def limit_of(phi: float, factor: float, moved: float, load: float) -> float:
    """Charge [grains] at which a pixel of threshold phi fires."""
    return max((phi * factor + moved) * load, LOWEST)


@njit(inline="always")
def find_live(hit: Bytes, groups: int, live: Places) -> int:
    """List the groups in which a pixel is hit; returns their number."""
    eights = hit.view(np.uint64)
    n = 0
    for g in range(groups):
        live[n] = g * GROUP
        n += (eights[_Q(2 * g)] | eights[_Q(2 * g + 1)]) != 0
    return n


@njit(inline="always")
def list_all(groups: int, live: Places) -> None:
    """List so many groups."""
    for g in range(groups):
        live[g] = g * GROUP
