"""Pixels that kick their neighbours at once: the spikes of a frame are taken in the order of their moments.

Pixels that wait are in rings by slots of the frame, so many that few share one.  Where many do, as those that are at
their limit when the frame begins, a heap puts them in order when it is the slot's turn.
"""

from __future__ import annotations

import math
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.sensor.engines.compiled.bands.arguments import FrameSway, SpikeLaw
from spikecam_env.sensor.engines.compiled.bands.lines import Lines
from spikecam_env.sensor.engines.compiled.bands.resets import reset_one
from spikecam_env.sensor.engines.compiled.bands.rows import (
    ARRIVES,
    FACTOR,
    HELD,
    HIT,
    JITTER,
    LIMIT,
    LOAD,
    MOVED,
    NOISE,
    ONE,
    PHI,
    SCRATCH,
    STANDS,
    Bytes,
    Words,
    limit_of,
)
from spikecam_env.sensor.engines.compiled.bands.within_frame import between, next_crossing, nodes_of, stands_at
from spikecam_env.sensor.ground.crossing import NEVER
from spikecam_env.sensor.ground.intrinsics import borrowed
from spikecam_env.types import Floats, Pictures

Links = NDArray[np.int32]
Heap = list[tuple[float, int]]
"""Moments and pixels of one slot."""


class Rooms(NamedTuple):
    """The scratch of all bands by the size of its rows: to make these views takes as long as a spike."""

    x: Floats
    words: Words
    draws: Pictures
    small: Bytes


class Turns(NamedTuple):
    """Who waits; nobody between frames."""

    numbers: Floats
    """(P, 4): moment, charge taken then, moment of the last spike, share of its noise a threshold keeps at a kick."""
    links: Links
    """(P + slots, 3) int32: of each pixel, and then of each slot, the next in its ring and the one before, itself where
    it is alone, and a pixel's place in the scratch."""


SLOTS = 2
"""Slots of a frame for each pixel that fires in turn; with fewer, more of them share one."""

FEW_WAIT = 16
"""Most pixels of one slot that are searched for the next, each time; more go through a heap."""

_MOMENT, _TAKEN, _LAST, _SHARE = range(4)  # of `Turns.numbers`
_AFTER, _BEFORE, _PLACE = range(3)  # of `Turns.links`
_NO_NOISE = -1.0  # instead of a share


@njit(inline="always")
def empty_turns(scratch: Floats, lines: Lines, pixels: int, kick: float) -> Turns:
    """Nobody waits; kicks in grains."""
    x = scratch.reshape(-1)
    numbers, links = np.zeros((pixels, 4)), np.empty((pixels + SLOTS * (pixels + 1), 3), np.int32)
    numbers[:, _MOMENT] = NEVER
    for p in range(len(links)):
        links[p] = p
    for line in range(lines.pixel.size):
        for i in range(lines.width[line]):
            p, at = lines.pixel[line] + i, lines.band[line] * SCRATCH + lines.slot[line] + i
            noise, jitter = x[NOISE + at], x[JITTER + at]
            links[p, _PLACE] = at
            numbers[p, _SHARE] = _NO_NOISE
            if noise > 0.0:
                numbers[p, _SHARE] = math.sqrt(max(1.0 - kick / ONE * noise / (noise + jitter), 0.0))
    return Turns(numbers, links)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def fire_in_turn(scratch: Floats, bits: Bytes, lines: Lines, turns: Turns, sway: FrameSway, law: SpikeLaw) -> None:
    """As `fire_within`, of all lines, in the order of moments: each spike kicks its neighbours at its own.

    Args:
        scratch: of all bands.
        bits: (P,), overwritten.
        lines: all.
        turns: nobody waits.
        sway: how references move in the frame.
        law: its kick in grains.
    """
    scratch, turns, sway = borrowed(scratch), borrowed(turns), borrowed(sway)
    numbers, links = turns
    rows, columns, pixels = sway.loads.size, sway.columns, bits.size
    still = stands_still(sway)
    x = borrowed(scratch.reshape(-1))
    rooms = borrowed(Rooms(scratch, scratch.view(np.uint32), scratch.view(np.float32), scratch.view(np.uint8)))
    slots = begin_turns(scratch, bits, lines, turns, sway, still)
    heap = [(0.0, 0) for _ in range(0)]
    now = crowd = 0  # crowd: its length, as to look at a list counts its uses, by locked instructions
    while True:
        if crowd > 0:
            u, p = heappop(heap)
            crowd -= 1
            if u != numbers[p, _MOMENT]:
                continue
        else:
            while now < slots and links[pixels + now, _AFTER] == pixels + now:
                now += 1
            if now == slots:
                break
            p, others = first_of_ring(pixels + now, numbers, links)
            leave(p, links)
            u = numbers[p, _MOMENT]
            if others > FEW_WAIT:
                crowd = all_to_heap(pixels + now, turns, heap)
        bits[p], numbers[p, _LAST] = 1, u
        moment, taken = fire_at(rooms, turns, p, u, sway, still, law)
        numbers[p, _MOMENT] = moment
        if moment != NEVER:
            numbers[p, _TAKEN] = taken
            slot = slot_of(moment, slots)
            if crowd > 0 and slot <= now:
                crowd = push(heap, moment, p)
            else:
                wait(p, max(slot, now), links, pixels)
        row = p // columns
        column = p - row * columns
        for side in range(4):
            down, right = (side == 3) - (side == 0), (side == 2) - (side == 1)
            if row + down < 0 or row + down >= rows or column + right < 0 or column + right >= columns:
                continue
            q = p + down * columns + right
            kicked, moment, taken = kick_at(x, turns, q, u, bits, sway, still, law)
            if kicked and (moment != NEVER or numbers[q, _MOMENT] != NEVER):
                leave(q, links)
                numbers[q, _MOMENT], numbers[q, _TAKEN] = moment, taken
                if moment != NEVER:
                    slot = slot_of(moment, slots)
                    if crowd > 0 and slot <= now:
                        crowd = push(heap, moment, q)
                    else:
                        wait(q, max(slot, now), links, pixels)


@njit(inline="always")
def begin_turns(scratch: Floats, bits: Bytes, lines: Lines, turns: Turns, sway: FrameSway, still: bool) -> int:
    """Let the pixels wait that are up to their references; returns the number of slots."""
    numbers, links = turns
    hits = scratch.reshape(-1).view(np.uint8)
    bits[:] = 0
    come = np.empty(bits.size, np.int32)
    came = 0
    for line in range(lines.pixel.size):
        p0, at = lines.pixel[line], 8 * lines.band[line] * SCRATCH + HIT + lines.slot[line]
        for i in range(lines.width[line]):
            come[came] = p0 + i
            came += hits[at + i]
            hits[at + i] = 0
    slots = min(SLOTS * (came + 1), len(links) - bits.size)
    for p in come[:came]:
        band, j = band_and_place(links[p, _PLACE])
        numbers[p, _MOMENT], numbers[p, _TAKEN] = crossing_of(scratch[band], j, 0.0, p, sway, still)
        if numbers[p, _MOMENT] != NEVER:
            wait(p, slot_of(numbers[p, _MOMENT], slots), links, bits.size)
    return slots


@njit(nogil=True, error_model="numpy", boundscheck=False)
def all_to_heap(head: int, turns: Turns, heap: Heap) -> int:
    """Move all pixels of a slot to the heap; returns its length."""
    numbers, links = turns
    while links[head, _AFTER] != head:
        q = np.int64(links[head, _AFTER])
        leave(q, links)
        heappush(heap, (numbers[q, _MOMENT], q))
    return len(heap)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def push(heap: Heap, moment: float, p: int) -> int:
    """Let a pixel wait for a moment in the heap; returns its length."""
    heappush(heap, (moment, p))
    return len(heap)


@njit(inline="always")
def fire_at(
    rooms: Rooms, turns: Turns, p: int, u: float, sway: FrameSway, still: bool, law: SpikeLaw
) -> tuple[float, float]:
    """Let pixel p fire at moment u; returns when it does next in this frame, and the charge taken then."""
    band, j = band_and_place(turns.links[p, _PLACE])
    x = rooms.x[band]
    rooms.small[band, HIT + j] = 1
    stands = x[STANDS + j]
    if not still:
        stands = stands_in_sway(u, p, sway)
    reset_one(x, rooms.words[band], rooms.draws[band], j, turns.numbers[p, _TAKEN], stands, law)
    if x[HELD + j] >= x[LIMIT + j]:
        return crossing_of(x, j, u, p, sway, still)
    return NEVER, 0.0


@njit(inline="always")
def kick_at(
    x: Floats, turns: Turns, q: int, u: float, bits: Bytes, sway: FrameSway, still: bool, law: SpikeLaw
) -> tuple[bool, float, float]:
    """Kick pixel q at moment u.

    Returns:
        Whether it is kicked: not where it would fire twice at one moment; when it fires then, and the charge taken.
    """
    j = np.int64(turns.links[q, _PLACE])
    held, phi, limit = x[HELD + j], x[PHI + j], x[LIMIT + j]
    kick_pixel(x, j, law.feedback.kick_at_once, turns.numbers[q, _SHARE])
    moment, taken = NEVER, 0.0
    if x[HELD + j] >= x[LIMIT + j]:
        moment, taken = crossing_of(x, j, u, q, sway, still)
    if moment == u and bits[q] != 0 and turns.numbers[q, _LAST] == u:
        x[HELD + j], x[PHI + j], x[LIMIT + j] = held, phi, limit
        return False, moment, taken
    return True, moment, taken


@njit(inline="always")
def kick_pixel(x: Floats, j: int, kick: float, share: float) -> None:
    """Give a pixel charge [grains] that brings no shot noise: its threshold keeps a share of its noise."""
    x[HELD + j] += kick
    if share != _NO_NOISE:
        x[PHI + j] = ONE + (x[PHI + j] - ONE) * share
        x[LIMIT + j] = limit_of(x[PHI + j], x[FACTOR + j], x[MOVED + j], x[LOAD + j])


@njit(inline="always")
def crossing_of(x: Floats, j: int, since: float, p: int, sway: FrameSway, still: bool) -> tuple[float, float]:
    """`next_crossing` of pixel p, which is at place j of the scratch."""
    if still:
        gained, limit = x[ARRIVES + j], x[LIMIT + j]
        return between(x[HELD + j] - gained, gained, since, 0.0, 1.0, limit, limit)
    return crossing_in_sway(x, j, since, p, sway)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def crossing_in_sway(x: Floats, j: int, since: float, p: int, sway: FrameSway) -> tuple[float, float]:
    """As `crossing_of`, where references move."""
    sway = borrowed(sway)
    row = p // sway.columns
    at, factor, common = nodes_of(sway, row)
    of_pixel = sway.field[p], sway.grains_per_mV[p], sway.loads[row]
    return next_crossing(x, j, since, at, factor, common, of_pixel)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def stands_in_sway(u: float, p: int, sway: FrameSway) -> float:
    """Level of pixel p's reference at moment u, where references move."""
    sway = borrowed(sway)
    row = p // sway.columns
    at, factor, common = nodes_of(sway, row)
    return stands_at(u, at, factor, common, (sway.field[p], sway.grains_per_mV[p], sway.loads[row]))


@njit(inline="always")
def stands_still(sway: FrameSway) -> bool:
    """Whether no reference moves within the frame, so that each pixel's limit is that of the frame."""
    factor, common = sway.factor, sway.common
    level = (factor[:, 0] == factor[:, 1]).all() and (common[:, 0] == common[:, 1]).all()
    return bool(sway.at.shape[1] == 2 and level)


@njit(inline="always")
def band_and_place(at: int) -> tuple[int, int]:
    """A pixel's band, and its place in that."""
    band = np.int64(at) // SCRATCH
    return band, np.int64(at) - band * SCRATCH


@njit(inline="always")
def slot_of(moment: float, slots: int) -> int:
    """The slot of pixels that wait for such a moment, 0 .. 1."""
    return min(int(moment * slots), slots - 1)


@njit(inline="always")
def wait(p: int, slot: int, links: Links, pixels: int) -> None:
    """Put a pixel into the ring of a slot."""
    head = pixels + slot
    other = links[head, _AFTER]
    links[p, _AFTER], links[p, _BEFORE] = other, head
    links[other, _BEFORE], links[head, _AFTER] = p, p


@njit(inline="always")
def leave(p: int, links: Links) -> None:
    """Take a pixel out of its ring."""
    after, before = links[p, _AFTER], links[p, _BEFORE]
    links[before, _AFTER], links[after, _BEFORE] = after, before
    links[p, _AFTER], links[p, _BEFORE] = p, p


@njit(inline="always")
def first_of_ring(head: int, numbers: Floats, links: Links) -> tuple[int, int]:
    """The pixel of the earliest moment in a slot's ring, of several the first; and the number of the others."""
    p, others = np.int64(links[head, _AFTER]), 0
    q = np.int64(links[p, _AFTER])
    while q != head:
        here, there = numbers[q, _MOMENT], numbers[p, _MOMENT]
        p = q if here < there or (here == there and q < p) else p
        others += 1
        q = np.int64(links[q, _AFTER])
    return p, others
