"""The compiled loop of the block kernel: frame by frame, as `reference` has it, a band of lines at a time.

    charge += max(light light_factor, 0) + max(dark dark_factor, 0)
    while charge >= limit = (threshold factor + grains_per_mV (common + field)) (1 + droop activity):
        spike;  residual = (charge - limit - loss of the reset) kept;  threshold = GRAINS (1 + s z)

The same operations in the same order, in float64, so that without noise the bits are the reference's.  With noise the
electrons still to come are drawn once a spike, as in the jump kernel (`fast`).  No fastmath.

Where references move within the frame, limits are their least; pixels above these are checked again (`crossing`).
Where spikes kick neighbours at once, a frame's spikes are taken in turn (`fire_in_turn`).
Where nothing moves from frame to frame but charge of single pixels, a pixel goes from spike to spike (`jump`).
Charge is held on a grid (`on_grid`) on which sums are exact: many frames at once give the bits of one by one.

A line is a row of pixels, or a piece of one that is wider than a band.  Where any of a group of pixels fires, a spike
is computed for all of them, and kept for those that fired: vector instructions for sixteen cost less than to gather,
one by one, the few that fired.

Names throughout: x, words, hit are a band's scratch as float64, uint32, and its row HIT as uint8; live lists the starts
of groups in which a pixel fires; reset, left and left_tau are numbers of `Feedback`.
"""

from __future__ import annotations

import math
from heapq import heappop, heappush
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.sensor.ground.crossing import MOST_AGAIN, NEVER, crossing_between
from spikecam_env.sensor.ground.decay import LONG, decayed
from spikecam_env.sensor.ground.draws import GOLDEN, first_key, second_key, standard
from spikecam_env.sensor.light import GRAINS, LEAST_LIMIT, MOST_GRAINS
from spikecam_env.sensor.light import on_grid as rounded
from spikecam_env.types import Floats, Pictures

Words = NDArray[np.uint32]
Bytes = NDArray[np.uint8]
Places = NDArray[np.int64]
Polynomial = tuple[np.float32, ...]
Reset = tuple[float, ...]
"""The first three numbers of `Feedback`: per_root_rate, per_rate, kept."""
Band = tuple[Places, Places, Places, Places]
"""Row, first pixel, width and place of its lines; see `lay_out`."""
Waves = tuple[Floats, Floats]
"""Factor and common [mV] at the nodes."""
PixelNumbers = tuple[float, float, float]
"""Field [mV], grains_per_mV and load of a pixel."""
References = tuple[bool, int, Floats, Waves, Pictures, Floats, Floats]
"""Whether they stand still within the frame, pixels of a row, nodes, waves, field, grains_per_mV, loads of rows."""
Wave = tuple[Floats, Floats, Floats, PixelNumbers]
"""Nodes, factor and common there, and the numbers of a pixel."""
Links = NDArray[np.int32]
Turns = tuple[Floats, Links]
"""Numbers of the pixels for `fire_in_turn`; see `empty_turns`."""
FewCharge = tuple[Floats, Floats, Floats, Floats, Floats]
"""Light, dark, their factors (n,), and extra dark charge (F, n) of the few pixels that have some."""

BAND = 1024
"""Pixels of a band: its scratch stays in the processor's cache, frame after frame."""

GROUP = 16
"""Pixels that are computed together where one of them fires (LLVM would make no vector instructions of fewer)."""

FEWEST_FRAMES, SPARSE = 4, 0.5
"""Fewest frames of a block, and most spikes a pixel and frame, for which going from spike to spike is faster."""

SLOTS = 2
"""Slots of a frame for each pixel that fires in turn; with fewer, more of them share one."""

FEW_WAIT = 16
"""Most pixels of one slot that are searched for the next, each time; more go through a heap."""

decay = njit(inline="always")(decayed)
on_grid = njit(inline="always")(rounded)
between = njit(inline="always")(crossing_between)

_U = np.uint32
_Q = np.uint64
_G = float(GRAINS)
_MOST = float(MOST_GRAINS)
_TRIPS = float(LEAST_LIMIT)

# Rows of a band's scratch: one array with fixed offsets, so that LLVM can prove that rows do not overlap.
_HELD, _LIMIT, _PHI, _ARRIVES, _STANDS, _MOVED, _FACTOR, _LOAD, _NOISE, _JITTER, _ELECTRONS, _CROSSED, _AT, _UNTIL = (
    row * BAND for row in range(14)
)
_PIXEL, _FIRST, _SECOND, _FIRED, _DRAW, _DUE, _AWAKE, _AGAIN, _EXTRA = (
    (28 + row) * BAND for row in range(9)
)  # of 32 bits
_HIT, _SEEN = (8 * 19 * BAND + row * BAND for row in range(2))  # of 8 bits
_SCRATCH = 20 * BAND
_MOMENT, _TAKEN, _LAST, _SHARE = range(4)  # of `Turns`
_AFTER, _BEFORE, _PLACE = range(3)
_NO_NOISE = -1.0  # instead of a share
_NONE = 0xFFFFFFFF
_LEAST = 1e-30  # divides where no charge arrives
_INSIDE = BAND - 1  # masks a group's start: not negative, so that numba leaves wrapping indices out


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def ramp_charge(
    level: NDArray[np.int32], curve: NDArray[np.int32], rest: NDArray[np.int32], first: int, out: Floats
) -> None:
    """Charge of frames first .. of a key interval: out (F, P) float64 [thresholds], overwritten; see `light.Ramp`."""
    frames, pixels = out.shape
    for t in range(frames):
        k0 = np.int32(first + t)
        k1 = np.int32(k0 + 1)
        s0, s1 = np.int32(k0 * k0), np.int32(k1 * k1)
        row = out[t]
        for p in range(pixels):
            bend = np.int32(
                np.int32(np.int32(rest[p] * s1) >> np.int32(18)) - np.int32(np.int32(rest[p] * s0) >> np.int32(18))
            )
            row[p] = np.int32(np.int32(level[p] + np.int32(curve[p] * np.int32(s1 - s0))) + bend) * (1.0 / _G)


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def advance(
    top: int,
    bottom: int,
    number: int,
    columns: int,
    light: Floats,
    dark: Floats,
    few: Places,
    extra: Floats,
    light_factor: Floats,
    dark_factor: Floats,
    factor: Floats,
    common: Floats,
    field: Pictures,
    grains_per_mV: Floats,
    at: Floats,
    swayed_factor: Floats,
    swayed_common: Floats,
    feedback: tuple[float, ...],
    per_electron: Floats,
    kappa_squared: Floats,
    polynomial: Polynomial,
    seed_low: np.uint32,
    seed_high: np.uint32,
    charge: Floats,
    threshold: Floats,
    fired: Words,
    activity: Floats,
    crossing: Floats,
    spikes: Bytes,
) -> None:
    """Frames of the rows top .. bottom: F frames, H rows of `columns` pixels, P pixels in all; float64 unless stated.

    Args:
        top, bottom: first row, and row after the last.
        number: of the first frame.
        columns: pixels of a row.
        light, dark: (F or 1, P) [thresholds].
        few, extra: pixels (n,), ascending, with extra dark charge (F, n).
        light_factor, dark_factor: (F, H).
        factor, common: (F, H), common in mV; the least of each frame.
        field: (F or 1, P) float32 [mV].
        grains_per_mV, per_electron, kappa_squared: (P,), per_electron 1/N.
        at, swayed_factor, swayed_common: nodes of `drive.Sway`, none where no reference moves within a frame.
        feedback: the numbers of `Feedback`, in its order.
        polynomial: 8 float32, law of a spike's charge.
        seed_low, seed_high: uint32.
        charge, threshold, fired, crossing: (P,) [grains, frames], fired uint32; updated.
        activity: (H,), updated.
        spikes: (F, P) uint8, overwritten.
    """
    kick, left, left_tau, droop, at_once = feedback[3:]
    at_once = on_grid(at_once * _G)
    reset = feedback[:3]
    frames = spikes.shape[0]
    light_moves, dark_moves, field_moves = light.shape[0] > 1, dark.shape[0] > 1, field.shape[0] > 1
    moves = light_moves or dark_moves or field_moves or droop != 0.0
    moves = moves or differ(light_factor) or differ(dark_factor) or differ(factor) or differ(common)
    sways = at.shape[1] > 0
    f_moves, c_moves = swayed_factor.shape[0] > 1, swayed_common.shape[0] > 1
    alone = not moves and not sways and kick == 0.0 and frames >= FEWEST_FRAMES
    whole = kick != 0.0 or at_once != 0.0
    jumps = False
    pieces = (columns + BAND - 1) // BAND
    pitch = (min(columns, BAND) + 7) // 8 * 8
    lines = BAND // pitch
    bands = ((bottom - top) * pieces + lines - 1) // lines
    together = bands if whole or (droop != 0.0 and pieces > 1) else 1
    row_of, pixel_of, width_of, slot_of = lay_out(top, bottom, columns, pieces, lines, pitch)
    lay = np.stack((pixel_of, width_of, np.arange(row_of.size) // lines * _SCRATCH, slot_of))
    scratch = np.zeros((together, _SCRATCH))
    scratch[:, _LIMIT : _LIMIT + BAND] = np.inf  # padding of a line never fires
    stood = np.empty((together, lines, 5))
    live = np.empty(BAND // GROUP, np.int64)
    around = np.empty(columns, np.uint8)
    place = np.empty(few.size, np.int64)
    few_row = few // columns
    few_of = np.empty(together + 1, np.int64)
    for line0 in range(0, row_of.size, together * lines):
        stop = min(line0 + together * lines, row_of.size)
        stood[:] = np.nan
        for b in range(together):
            scratch[b].view(np.uint32)[_AWAKE : _AWAKE + BAND // GROUP] = 0
            scratch[b].view(np.uint8)[_HIT : _HIT + BAND] = 0
        for line in range(line0, stop):
            p0, n, h0 = pixel_of[line], width_of[line], slot_of[line]
            x = scratch[(line - line0) // lines]
            words = x.view(np.uint32)
            copy(charge[p0 : p0 + n], x[_HELD + h0 : _HELD + h0 + n])
            copy(threshold[p0 : p0 + n], x[_PHI + h0 : _PHI + h0 + n])
            copy(crossing[p0 : p0 + n], x[_CROSSED + h0 : _CROSSED + h0 + n])
            copy(fired[p0 : p0 + n], words[_FIRED + h0 : _FIRED + h0 + n])
            for j in range(n):
                words[_PIXEL + h0 + j] = _U(p0 + j)
        for b in range(together + 1):
            line = min(line0 + b * lines, stop) - 1
            few_of[b] = np.searchsorted(few, pixel_of[line] + width_of[line] if b else pixel_of[line0])
        line = line0
        for i in range(few_of[0], few_of[together]):
            while few[i] >= pixel_of[line] + width_of[line]:
                line += 1
            place[i] = slot_of[line] + few[i] - pixel_of[line]
        for t in range(frames):
            lights, darks, fields = light[t * light_moves], dark[t * dark_moves], field[t * field_moves]
            bits = spikes[t]
            for b in range(together):
                x, words, hit = scratch[b], scratch[b].view(np.uint32), scratch[b].view(np.uint8)[_HIT : _HIT + BAND]
                begin, end = line0 + b * lines, min(line0 + (b + 1) * lines, stop)
                arrived = False
                for line in range(begin, end if t == 0 or moves else begin):
                    r, p0, n, h0 = row_of[line], pixel_of[line], width_of[line], slot_of[line]
                    a, d, f, m = light_factor[t, r], dark_factor[t, r], factor[t, r], common[t, r]
                    load = 1.0 + droop * activity[r]
                    was = stood[b, line - begin]
                    if light_moves or dark_moves or a != was[0] or d != was[1]:
                        was[0], was[1], arrived = a, d, True
                        charge_of_line(
                            lights[p0 : p0 + n], darks[p0 : p0 + n], a, d, x[_ARRIVES + h0 : _ARRIVES + h0 + n]
                        )
                    if f != was[2] or load != was[4]:
                        x[_FACTOR + h0 : _FACTOR + h0 + n] = f
                        x[_LOAD + h0 : _LOAD + h0 + n] = load
                    if field_moves or f != was[2] or m != was[3] or load != was[4]:
                        was[2], was[3], was[4] = f, m, load
                        references(
                            grains_per_mV[p0 : p0 + n],
                            fields[p0 : p0 + n],
                            x[_PHI + h0 : _PHI + h0 + n],
                            f,
                            m,
                            load,
                            x[_MOVED + h0 : _MOVED + h0 + n],
                            x[_STANDS + h0 : _STANDS + h0 + n],
                            x[_LIMIT + h0 : _LIMIT + h0 + n],
                        )
                for i in range(few_of[b], few_of[b + 1]):
                    if not arrived and extra[t, i] == extra[t - 1, i]:
                        continue
                    p, r = few[i], few_row[i]
                    at_light, at_dark = lights[p] * light_factor[t, r], (darks[p] + extra[t, i]) * dark_factor[t, r]
                    x[_ARRIVES + place[i]] = frame_charge(at_light, at_dark)
                used = (end - begin) * pitch
                jumps = alone and t == 0 and x[_ARRIVES : _ARRIVES + used].sum() < SPARSE * _G * used
                if jumps:
                    groups = (used + GROUP - 1) // GROUP
                    for g in range(groups):
                        live[g] = g * GROUP
                    x[_LIMIT + used : _LIMIT + groups * GROUP] = np.inf
                    for line in range(begin, end):
                        p0, n, h0 = pixel_of[line], width_of[line], slot_of[line]
                        x[_LIMIT + h0 + n : _LIMIT + h0 + pitch] = np.inf
                        spikes[:, p0 : p0 + n] = 0
                    words[_EXTRA : _EXTRA + BAND] = _NONE
                    for i in range(few_of[b], few_of[b + 1]):
                        words[_EXTRA + place[i]] = i
                    of_few = lights[few], darks[few], light_factor[0, few_row], dark_factor[0, few_row], extra
                    wake(x, words, live, groups, per_electron, kappa_squared, seed_low, seed_high)
                    jump(x, words, live, groups, of_few, reset, polynomial, number, left, left_tau, spikes)
                    break
                collect(x[_HELD:], x[_ARRIVES:], x[_LIMIT:], used, hit)
                groups = find_live(hit.view(np.uint64), (used + GROUP - 1) // GROUP, live)
                if at_once != 0.0:
                    if t == 0:
                        groups = (used + GROUP - 1) // GROUP
                        for g in range(groups):
                            live[g] = g * GROUP
                        wake(x, words, live, groups, per_electron, kappa_squared, seed_low, seed_high)
                    continue
                wake(x, words, live, groups, per_electron, kappa_squared, seed_low, seed_high)
                if sways and groups:
                    waves = swayed_factor[t * f_moves], swayed_common[t * c_moves]
                    band = row_of[begin:end], pixel_of[begin:end], width_of[begin:end], slot_of[begin:end]
                    loads = 1.0 + droop * activity
                    fire_within(
                        x, words, hit, live, groups, band, at, waves, fields, grains_per_mV, loads, reset, polynomial
                    )
                elif groups and fire(x, words, hit, live, groups, reset, polynomial):
                    while groups:
                        find_due(x, words, live, groups)
                        groups = fire_due(x, words, live, groups, reset, polynomial)
                for line in range(begin, end):
                    p0, n, h0 = pixel_of[line], width_of[line], slot_of[line]
                    copy(hit[h0 : h0 + n], bits[p0 : p0 + n])
            if jumps:
                break
            if at_once != 0.0:
                waves = swayed_factor[t * f_moves], swayed_common[t * c_moves]
                loads = 1.0 + droop * activity
                if t == 0:
                    turns = empty_turns(scratch, lay, bits.size, at_once)
                fire_in_turn(
                    scratch, bits, lay, turns, at, waves, fields, grains_per_mV, loads, at_once, reset, polynomial
                )
            if kick != 0.0:
                for r in range(top, bottom):
                    count_neighbours(bits, r, columns, around)
                    for line in range((r - top) * pieces, (r - top + 1) * pieces):
                        p0, n, h0 = pixel_of[line], width_of[line], _HELD + slot_of[line]
                        couple(kick, around[p0 - r * columns :], scratch[line // lines, h0 : h0 + n])
            if left != 0.0:
                for b in range(together):
                    x, words, hit = (
                        scratch[b],
                        scratch[b].view(np.uint32),
                        scratch[b].view(np.uint8)[_HIT : _HIT + BAND],
                    )
                    groups = find_live(hit.view(np.uint64), BAND // GROUP, live)
                    once_more = not sways and at_once == 0.0
                    add_left_charge(
                        x, words, hit, live, groups, number + t + 1.0, left, left_tau, once_more, reset, polynomial
                    )
            if droop != 0.0:
                for r in range(row_of[line0], row_of[stop - 1] + 1):
                    activity[r] = bits[r * columns : (r + 1) * columns].sum() / columns
        for line in range(line0, stop):
            p0, n, h0 = pixel_of[line], width_of[line], slot_of[line]
            x = scratch[(line - line0) // lines]
            words = x.view(np.uint32)
            copy(x[_HELD + h0 : _HELD + h0 + n], charge[p0 : p0 + n])
            copy(x[_PHI + h0 : _PHI + h0 + n], threshold[p0 : p0 + n])
            copy(x[_CROSSED + h0 : _CROSSED + h0 + n], crossing[p0 : p0 + n])
            copy(words[_FIRED + h0 : _FIRED + h0 + n], fired[p0 : p0 + n])


@njit(inline="always")
def frame_charge(light: float, dark: float) -> float:
    """Charge [grains] of a pixel in one frame, from light and dark [thresholds], neither below zero."""
    return on_grid(min((max(light, 0.0) + max(dark, 0.0)) * _G, _MOST))  # type: ignore[no-any-return]


@njit(inline="always")
def differ(values: Floats) -> bool:
    """Whether any frame's values differ from the first's."""
    return bool((values != values[0]).any())


@njit(inline="always")
def lay_out(top: int, bottom: int, columns: int, pieces: int, lines: int, pitch: int) -> Band:
    """Row, first pixel, width and place in its band of each line."""
    line = np.arange((bottom - top) * pieces)
    rows, starts = top + line // pieces, line % pieces * BAND
    return rows, rows * columns + starts, np.minimum(columns - starts, BAND), line % lines * pitch


@njit(inline="always")
def copy(values: NDArray[Any], out: NDArray[Any]) -> None:
    for j in range(out.size):
        out[j] = values[j]


@njit(inline="always")
def charge_of_line(light: Floats, dark: Floats, light_factor: float, dark_factor: float, out: Floats) -> None:
    """Charge of a line in one frame [grains]."""
    for j in range(out.size):
        out[j] = frame_charge(light[j] * light_factor, dark[j] * dark_factor)


@njit(inline="always")
def references(
    grains_per_mV: Floats,
    field: Pictures,
    phi: Floats,
    factor: float,
    common: float,
    load: float,
    moved: Floats,
    stands: Floats,
    limit: Floats,
) -> None:
    """Of a line in one frame [grains]: shifts of the references, their levels at a reset, and limits of the pixels."""
    for j in range(limit.size):
        moved[j] = grains_per_mV[j] * (common + field[j])
    for j in range(limit.size):
        stands[j] = (_G * factor + moved[j]) * load
    for j in range(limit.size):
        limit[j] = max((phi[j] * factor + moved[j]) * load, _TRIPS)


@njit(inline="always")
def collect(held: Floats, arrives: Floats, limit: Floats, used: int, hit: Bytes) -> None:
    """Add one frame's charge; hit: pixels at their limit."""
    for j in range(used):
        c = held[j] + arrives[j]
        held[j] = c
        hit[j] = c >= limit[j]


@njit(inline="always")
def find_live(eights: NDArray[np.uint64], groups: int, live: Places) -> int:
    """List the groups in which a pixel fires; returns their number."""
    n = 0
    for g in range(groups):
        live[n] = g * GROUP
        n += (eights[_Q(2 * g)] | eights[_Q(2 * g + 1)]) != 0
    return n


@njit(nogil=True, error_model="numpy", boundscheck=False)
def wake(
    x: Floats,
    words: Words,
    live: Places,
    groups: int,
    per_electron: Floats,
    kappa_squared: Floats,
    seed_low: np.uint32,
    seed_high: np.uint32,
) -> None:
    """Noise and keys of pixels, in groups in which one fires for the first time."""
    for g in range(groups):
        q = live[g] & _INSIDE
        if words[_AWAKE + q // GROUP] == 0:
            words[_AWAKE + q // GROUP] = 1
            for j in range(q, q + GROUP):
                p = words[_PIXEL + j]
                x[_NOISE + j] = per_electron[p]
                x[_JITTER + j] = kappa_squared[p]
                words[_FIRST + j] = first_key(p, seed_low)
                words[_SECOND + j] = second_key(words[_FIRST + j], seed_high)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def fire(x: Floats, words: Words, hit: Bytes, live: Places, groups: int, reset: Reset, polynomial: Polynomial) -> int:
    """Reset the pixels that fire, draw their next thresholds; returns how many are at these already."""
    per_root_rate, per_rate, kept = reset
    whole = per_root_rate == 0.0 and per_rate == 0.0 and kept == 1.0
    floats = words.view(np.float32)
    again = 0
    for g in range(groups):
        q = live[g] & _INSIDE
        for j in range(q, q + GROUP):
            floats[_DRAW + j] = drawn(words[_FIRST + j], words[_SECOND + j], words[_FIRED + j], polynomial)
        for j in range(q, q + GROUP):
            over, electrons = on_grid(x[_HELD + j] - x[_LIMIT + j]), x[_STANDS + j] * (1.0 / _G)
            if not whole:
                over, electrons = after_reset(over, x[_ARRIVES + j] / _G, x[_STANDS + j], per_root_rate, per_rate, kept)
            phi = next_threshold(electrons, x[_NOISE + j], x[_JITTER + j], floats[_DRAW + j])
            limit = max((phi * x[_FACTOR + j] + x[_MOVED + j]) * x[_LOAD + j], _TRIPS)
            fires = hit[j] != 0
            words[_FIRED + j] = _U(words[_FIRED + j] + _U(hit[j]))
            x[_ELECTRONS + j] = electrons
            x[_HELD + j] = over if fires else x[_HELD + j]
            x[_PHI + j] = phi if fires else x[_PHI + j]
            x[_LIMIT + j] = limit if fires else x[_LIMIT + j]
            again += fires & (over >= limit)
    return again


@njit(inline="always")
def find_due(x: Floats, words: Words, live: Places, groups: int) -> None:
    """Mark the pixels of live groups that are at their limit."""
    for g in range(groups):
        q = live[g] & _INSIDE
        for j in range(q, q + GROUP):
            words[_DUE + j] = _U(x[_HELD + j] >= x[_LIMIT + j])


@njit(nogil=True, error_model="numpy", boundscheck=False)
def fire_due(x: Floats, words: Words, live: Places, groups: int, reset: Reset, polynomial: Polynomial) -> int:
    """As `fire`, of the pixels that are due; the others keep all rows, as after an earlier spike in the frame.

    The law is that of `fire`, written out: of a function that returned it LLVM would make no vector instructions.

    Returns:
        Number of groups, listed, in which some are at their limit again.
    """
    per_root_rate, per_rate, kept = reset
    whole = per_root_rate == 0.0 and per_rate == 0.0 and kept == 1.0
    floats = words.view(np.float32)
    still = 0
    for g in range(groups):
        q = live[g] & _INSIDE
        for j in range(q, q + GROUP):
            draw = drawn(words[_FIRST + j], words[_SECOND + j], words[_FIRED + j], polynomial)
            floats[_DRAW + j] = draw if words[_DUE + j] != 0 else floats[_DRAW + j]
            words[_FIRED + j] = _U(words[_FIRED + j] + words[_DUE + j])
        again = 0
        for j in range(q, q + GROUP):
            over, electrons = on_grid(x[_HELD + j] - x[_LIMIT + j]), x[_STANDS + j] * (1.0 / _G)
            if not whole:
                over, electrons = after_reset(over, x[_ARRIVES + j] / _G, x[_STANDS + j], per_root_rate, per_rate, kept)
            phi = next_threshold(electrons, x[_NOISE + j], x[_JITTER + j], floats[_DRAW + j])
            limit = max((phi * x[_FACTOR + j] + x[_MOVED + j]) * x[_LOAD + j], _TRIPS)
            fires = words[_DUE + j] != 0
            x[_ELECTRONS + j] = electrons if fires else x[_ELECTRONS + j]
            x[_HELD + j] = over if fires else x[_HELD + j]
            x[_PHI + j] = phi if fires else x[_PHI + j]
            x[_LIMIT + j] = limit if fires else x[_LIMIT + j]
            again += fires & (over >= limit)
        live[still] = q
        still += again != 0
    return still


@njit(nogil=True, error_model="numpy", boundscheck=False)
def fire_within(
    x: Floats,
    words: Words,
    hit: Bytes,
    live: Places,
    groups: int,
    band: Band,
    at: Floats,
    waves: Waves,
    field: Pictures,
    grains_per_mV: Floats,
    loads: Floats,
    reset: Reset,
    polynomial: Polynomial,
) -> None:
    """As `fire` and `fire_due`, of a band whose references move within the frame; hit is cut to pixels that fired."""
    seen = words.view(np.uint8)[_SEEN : _SEEN + BAND]
    near = np.empty(BAND, np.int64)
    for g in range(groups):
        q = live[g] & _INSIDE
        for j in range(q, q + GROUP):
            x[_AT + j] = 0.0
    seen[:] = 0
    while groups:
        for line in range(band[0].size):
            r, p0, n, h0 = band[0][line], band[1][line], band[2][line], band[3][line]
            of_row = at[r if len(at) > 1 else 0], row_waves(r, waves)
            find_crossings(x, hit, h0, n, near, of_row, field[p0 : p0 + n], grains_per_mV[p0 : p0 + n], loads[r])
        for j in range(BAND):
            words[_DUE + j] = hit[j]
            seen[j] |= hit[j]
        groups = fire_due(x, words, live, groups, reset, polynomial)
        for j in range(BAND):
            hit[j] &= x[_HELD + j] >= x[_LIMIT + j]
    copy(seen, hit)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def find_crossings(
    x: Floats,
    hit: Bytes,
    h0: int,
    n: int,
    near: Places,
    of_row: tuple[Floats, Waves],
    field: Pictures,
    grains_per_mV: Floats,
    load: float,
) -> None:
    """Crossings from moment AT on of the n pixels of a line at place h0 that hit their least limit.

    Args:
        x: rows AT, LIMIT and STANDS get moment, charge and level of the reference.
        hit: cut to pixels that fire.
    """
    at, (factor, common) = of_row
    came = 0
    for i in range(n):
        near[came] = i
        came += hit[h0 + i]
    for c in range(came):
        i = near[c]
        j = h0 + i
        of_pixel = field[i], grains_per_mV[i], load
        moment, taken = next_crossing(x, 0, j, x[_AT + j], at, factor, common, of_pixel)
        hit[j] = moment != NEVER
        if moment != NEVER:
            x[_AT + j], x[_LIMIT + j] = moment, taken
            x[_STANDS + j] = stands_at(moment, at, factor, common, of_pixel)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def fire_in_turn(
    scratch: Floats,
    bits: Bytes,
    lines: Places,
    turns: Turns,
    at: Floats,
    waves: Waves,
    field: Pictures,
    grains_per_mV: Floats,
    loads: Floats,
    kick: float,
    reset: Reset,
    polynomial: Polynomial,
) -> None:
    """As `fire_within`, of all lines, in the order of moments: each spike kicks its neighbours [grains] at its own.

    Args:
        lines: first pixel, width, band and place of each, (4, L) int64.
        turns: of the pixels, all without a moment; left so.
        bits: (P,), overwritten.
    """
    x, words, hits = scratch.reshape(-1), scratch.reshape(-1).view(np.uint32), scratch.reshape(-1).view(np.uint8)
    rows, columns = loads.size, bits.size // loads.size
    numbers, links = turns
    references = stands_still(at, waves), columns, at, waves, field, grains_per_mV, loads
    heap = [(0.0, 0) for _ in range(0)]
    bits[:] = 0
    come = np.empty(bits.size, np.int32)
    came = 0
    for line in range(lines.shape[1]):
        p0, n, o, h0 = lines[0, line], lines[1, line], lines[2, line], lines[3, line]
        for i in range(n):
            come[came] = p0 + i
            came += hits[8 * o + _HIT + h0 + i]
            hits[8 * o + _HIT + h0 + i] = 0
    slots = min(SLOTS * (came + 1), len(links) - bits.size)
    for p in come[:came]:
        o, j = band_and_place(links[p, _PLACE])
        numbers[p, _MOMENT], numbers[p, _TAKEN] = crossing_of(x, o, j, 0.0, p, references)
        if numbers[p, _MOMENT] != NEVER:
            wait(p, slot_of(numbers[p, _MOMENT], slots), links, bits.size)
    now = 0
    while True:
        if len(heap) > 0:
            u, p = heappop(heap)
            if u != numbers[p, _MOMENT]:
                continue
        else:
            while now < slots and links[bits.size + now, _AFTER] == bits.size + now:
                now += 1
            if now == slots:
                break
            p, others = first_of_ring(bits.size + now, numbers, links)
            u = numbers[p, _MOMENT]
            leave(p, links)
            while others > FEW_WAIT and links[bits.size + now, _AFTER] != bits.size + now:
                q = np.int64(links[bits.size + now, _AFTER])
                leave(q, links)
                heappush(heap, (numbers[q, _MOMENT], q))
        row = p // columns
        column = p - row * columns
        o, j = band_and_place(links[p, _PLACE])
        bits[p], hits[8 * o + _HIT + j], numbers[p, _LAST] = 1, 1, u
        spike(x, words, o, j, u, numbers[p, _TAKEN], p, references, reset, polynomial)
        moment = NEVER
        if x[o + _HELD + j] >= x[o + _LIMIT + j]:
            moment, taken = crossing_of(x, o, j, u, p, references)
            numbers[p, _TAKEN] = taken
        numbers[p, _MOMENT] = moment
        if moment != NEVER:
            if len(heap) > 0 and slot_of(moment, slots) <= now:
                heappush(heap, (moment, p))
            else:
                wait(p, max(slot_of(moment, slots), now), links, bits.size)
        for side in range(4):
            down, right = (side == 3) - (side == 0), (side == 2) - (side == 1)
            if row + down < 0 or row + down >= rows or column + right < 0 or column + right >= columns:
                continue
            q = p + down * columns + right
            o, j = band_and_place(links[q, _PLACE])
            held, phi, limit = x[o + _HELD + j], x[o + _PHI + j], x[o + _LIMIT + j]
            kick_pixel(x, o, j, kick, numbers[q, _SHARE])
            moment, taken = NEVER, 0.0
            if x[o + _HELD + j] >= x[o + _LIMIT + j]:
                moment, taken = crossing_of(x, o, j, u, q, references)
            if moment == u and bits[q] != 0 and numbers[q, _LAST] == u:
                x[o + _HELD + j], x[o + _PHI + j], x[o + _LIMIT + j] = held, phi, limit
                continue
            leave(q, links)
            numbers[q, _MOMENT], numbers[q, _TAKEN] = moment, taken
            if moment != NEVER:
                if len(heap) > 0 and slot_of(moment, slots) <= now:
                    heappush(heap, (moment, q))
                else:
                    wait(q, max(slot_of(moment, slots), now), links, bits.size)


@njit(inline="always")
def empty_turns(scratch: Floats, lines: Places, pixels: int, kick: float) -> Turns:
    """Numbers of the pixels for `fire_in_turn`: nobody waits.

    Pixels that wait are in rings by slots of the frame, so many that few share one.  Where many do, as those that are
    at their limit when the frame begins, a heap puts them in order when it is the slot's turn.

    Returns:
        (P, 4) float64: moment, charge taken then, moment of the last spike, and share of its noise that a threshold
            keeps at a kick; (P + slots, 3) int32: of each pixel, and then of each slot, the next in its ring and the
            one before, itself where it is alone, and a pixel's place in the scratch.
    """
    x = scratch.reshape(-1)
    numbers, links = np.zeros((pixels, 4)), np.empty((pixels + SLOTS * (pixels + 1), 3), np.int32)
    numbers[:, _MOMENT] = NEVER
    for p in range(len(links)):
        links[p] = p
    for line in range(lines.shape[1]):
        for i in range(lines[1, line]):
            p, at = lines[0, line] + i, lines[2, line] + lines[3, line] + i
            noise, jitter = x[_NOISE + at], x[_JITTER + at]
            links[p, _PLACE] = at
            numbers[p, _SHARE] = _NO_NOISE
            if noise > 0.0:
                numbers[p, _SHARE] = math.sqrt(max(1.0 - kick / _G * noise / (noise + jitter), 0.0))
    return numbers, links


@njit(inline="always")
def band_and_place(at: int) -> tuple[int, int]:
    """Where a pixel's band begins in the scratch, and its place in that."""
    band = np.int64(at) // _SCRATCH * _SCRATCH
    return band, np.int64(at) - band


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


@njit(inline="always")
def stands_still(at: Floats, waves: Waves) -> bool:
    """Whether no reference moves within the frame, so that each pixel's limit is that of the frame."""
    factor, common = waves
    level = (factor[:, 0] == factor[:, 1]).all() and (common[:, 0] == common[:, 1]).all()
    return bool(at.shape[1] == 2 and level)


@njit(inline="always")
def crossing_of(x: Floats, o: int, j: int, since: float, p: int, references: References) -> tuple[float, float]:
    """`next_crossing` of pixel p, which is at place j of the scratch at o."""
    still, columns, at, waves, field, grains_per_mV, loads = references
    if still:
        gained, limit = x[o + _ARRIVES + j], x[o + _LIMIT + j]
        return between(x[o + _HELD + j] - gained, gained, since, 0.0, 1.0, limit, limit)
    nodes, factor, common, of_pixel = pixel_law(p, columns, at, waves, field, grains_per_mV, loads)
    return next_crossing(x, o, j, since, nodes, factor, common, of_pixel)


@njit(inline="always")
def kick_pixel(x: Floats, o: int, j: int, kick: float, share: float) -> None:
    """Give a pixel charge [grains] that brings no shot noise: its threshold keeps a share of its noise."""
    x[o + _HELD + j] += kick
    if share != _NO_NOISE:
        x[o + _PHI + j] = _G + (x[o + _PHI + j] - _G) * share
        x[o + _LIMIT + j] = max((x[o + _PHI + j] * x[o + _FACTOR + j] + x[o + _MOVED + j]) * x[o + _LOAD + j], _TRIPS)


@njit(inline="always")
def row_waves(row: int, waves: Waves) -> Waves:
    """Factor and common (n,) of one row at its nodes."""
    factor, common = waves
    return factor[row if len(factor) > 1 else 0], common[row if len(common) > 1 else 0]


@njit(inline="always")
def pixel_law(
    p: int, columns: int, at: Floats, waves: Waves, field: Pictures, grains_per_mV: Floats, loads: Floats
) -> Wave:
    """How one pixel's reference moves: nodes, factor and common there, field, grains_per_mV, load."""
    row = p // columns
    factor, common = row_waves(row, waves)
    return at[row if len(at) > 1 else 0], factor, common, (field[p], grains_per_mV[p], loads[row])


@njit(inline="always")
def limit_at(phi: float, factor: float, common: float, of_pixel: PixelNumbers) -> float:
    """Level of a threshold [grains], however low."""
    field, grains_per_mV, load = of_pixel
    return (phi * factor + grains_per_mV * (common + field)) * load


@njit(inline="always")
def next_crossing(
    x: Floats, o: int, j: int, since: float, at: Floats, factor: Floats, common: Floats, of_pixel: PixelNumbers
) -> tuple[float, float]:
    """`crossing.first_crossing` at place j of the scratch at o, without the nodes below its least limit."""
    held, gained, phi, least = x[o + _HELD + j], x[o + _ARRIVES + j], x[o + _PHI + j], x[o + _LIMIT + j]
    begin = held - gained
    last = at.size - 1
    k = int(max(min((least - begin) / max(gained, _LEAST), 1.0), 0.0) * last)
    while k > 0 and begin + gained * at[k] >= least:
        k -= 1
    while k + 1 < last and begin + gained * at[k + 1] < least:
        k += 1
    low, moment, taken = max(limit_at(phi, factor[k], common[k], of_pixel), _TRIPS), NEVER, 0.0
    while k < last and moment == NEVER:
        high = max(limit_at(phi, factor[k + 1], common[k + 1], of_pixel), _TRIPS)
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
    low = limit_at(_G, factor[k], common[k], of_pixel)
    high = limit_at(_G, factor[k + 1], common[k + 1], of_pixel)
    return low + (high - low) * share


@njit(inline="always")
def spike(
    x: Floats,
    words: Words,
    o: int,
    j: int,
    moment: float,
    taken: float,
    p: int,
    references: References,
    reset: Reset,
    polynomial: Polynomial,
) -> None:
    """Reset a pixel that fires at that moment, and draw its next threshold; the law is that of `fire`."""
    per_root_rate, per_rate, kept = reset
    w, stands = 2 * o, x[o + _STANDS + j]
    still, columns, at, waves, field, grains_per_mV, loads = references
    if not still:
        nodes, factor, common, of_pixel = pixel_law(p, columns, at, waves, field, grains_per_mV, loads)
        stands = stands_at(moment, nodes, factor, common, of_pixel)
    over, electrons = on_grid(x[o + _HELD + j] - taken), stands * (1.0 / _G)
    if not (per_root_rate == 0.0 and per_rate == 0.0 and kept == 1.0):
        over, electrons = after_reset(over, x[o + _ARRIVES + j] / _G, stands, per_root_rate, per_rate, kept)
    draw = drawn(words[w + _FIRST + j], words[w + _SECOND + j], words[w + _FIRED + j], polynomial)
    phi = next_threshold(electrons, x[o + _NOISE + j], x[o + _JITTER + j], draw)
    words[w + _FIRED + j] = _U(words[w + _FIRED + j] + _U(1))
    words.view(np.float32)[w + _DRAW + j] = draw
    x[o + _ELECTRONS + j], x[o + _HELD + j], x[o + _PHI + j] = electrons, over, phi
    x[o + _LIMIT + j] = max((phi * x[o + _FACTOR + j] + x[o + _MOVED + j]) * x[o + _LOAD + j], _TRIPS)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def add_left_charge(
    x: Floats,
    words: Words,
    hit: Bytes,
    live: Places,
    groups: int,
    end: float,
    left: float,
    left_tau: float,
    once_more: bool,
    reset: Reset,
    polynomial: Polynomial,
) -> None:
    """Add the charge that stays on the photodiode at the resets of the pixels that fired, in the frame before `end`.

    Args:
        once_more: take pixels to their threshold again; where references move within the frame, the next one does.
    """
    draws = x.view(np.float32)
    for g in range(groups):
        q = live[g] & _INSIDE
        for j in range(q, q + GROUP):
            held, rate = x[_HELD + j] / _G, x[_ARRIVES + j] / _G
            crossed = end - min(max(held / max(rate, 1e-12), 0.0), 1.0)
            stays = left * (decay(min((crossed - x[_CROSSED + j]) / left_tau, LONG)) - 1.0)
            phi = next_threshold(x[_ELECTRONS + j] + stays, x[_NOISE + j], x[_JITTER + j], draws[_DRAW + j])
            limit = max((phi * x[_FACTOR + j] + x[_MOVED + j]) * x[_LOAD + j], _TRIPS)
            fires = hit[j] != 0
            x[_CROSSED + j] = crossed if fires else x[_CROSSED + j]
            x[_HELD + j] = on_grid((held - stays) * _G) if fires else x[_HELD + j]
            x[_PHI + j] = phi if fires else x[_PHI + j]
            x[_LIMIT + j] = limit if fires else x[_LIMIT + j]
        for j in range(q, q + GROUP):
            if once_more and hit[j] != 0 and x[_HELD + j] >= x[_LIMIT + j]:
                cross_again(x, words, j, end, left, left_tau, reset, polynomial)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def cross_again(
    x: Floats, words: Words, j: int, end: float, left: float, left_tau: float, reset: Reset, polynomial: Polynomial
) -> None:
    """Reset a pixel that charge left takes to its threshold again, MOST_AGAIN times at most, by the law of `fire`."""
    per_root_rate, per_rate, kept = reset
    rate = x[_ARRIVES + j] / _G
    for _ in range(MOST_AGAIN):
        if x[_HELD + j] < x[_LIMIT + j]:
            break
        over, electrons = on_grid(x[_HELD + j] - x[_LIMIT + j]), x[_STANDS + j] * (1.0 / _G)
        if not (per_root_rate == 0.0 and per_rate == 0.0 and kept == 1.0):
            over, electrons = after_reset(over, rate, x[_STANDS + j], per_root_rate, per_rate, kept)
        draw = drawn(words[_FIRST + j], words[_SECOND + j], words[_FIRED + j], polynomial)
        words[_FIRED + j] = _U(words[_FIRED + j] + _U(1))
        words.view(np.float32)[_DRAW + j] = draw
        crossed = end - min(max(over / _G / max(rate, 1e-12), 0.0), 1.0)
        stays = left * (decay(min(max(crossed - x[_CROSSED + j], 0.0) / left_tau, LONG)) - 1.0)
        phi = next_threshold(electrons + stays, x[_NOISE + j], x[_JITTER + j], draw)
        x[_ELECTRONS + j], x[_CROSSED + j], x[_PHI + j] = electrons, crossed, phi
        x[_HELD + j] = on_grid((over / _G - stays) * _G)
        x[_LIMIT + j] = max((phi * x[_FACTOR + j] + x[_MOVED + j]) * x[_LOAD + j], _TRIPS)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def jump(
    x: Floats,
    words: Words,
    live: Places,
    groups: int,
    of_few: FewCharge,
    reset: Reset,
    polynomial: Polynomial,
    number: int,
    left: float,
    left_tau: float,
    spikes: Bytes,
) -> None:
    """All frames of a band in which every pixel goes from event to event: a spike, or a change of its charge.

    The law is that of `fire` and `add_left_charge`, written out as in `fire_due`.

    Args:
        of_few: charge of the pixels whose number is in row EXTRA.
        spikes: (F, P), set where a pixel fires.
    """
    per_root_rate, per_rate, kept = reset
    whole = per_root_rate == 0.0 and per_rate == 0.0 and kept == 1.0
    floats = words.view(np.float32)
    frames = spikes.shape[0]
    for j in range(groups * GROUP):
        x[_AT + j], x[_UNTIL + j], words[_AGAIN + j] = 0.0, frames, 0
    for j in range(groups * GROUP):
        if words[_EXTRA + j] != _NONE:
            x[_UNTIL + j] = unchanged_until(of_few[4], words[_EXTRA + j], 0)
    while groups:
        for g in range(groups):
            q = live[g] & _INSIDE
            for j in range(q, q + GROUP):
                held, more, limit = x[_HELD + j], x[_ARRIVES + j], x[_LIMIT + j]
                n = np.floor(max(min((limit - held) / max(more, _LEAST), frames + 1.0), 0.0))
                n = n + 1.0 if held + n * more < limit else n
                n = 0.0 if words[_AGAIN + j] != 0 else max(n, 1.0)
                rest = x[_UNTIL + j] - x[_AT + j]
                words[_DUE + j] = n <= rest
                n = min(n, rest)
                x[_AT + j] += n
                x[_HELD + j] = held + n * more
        groups = record_events(x, words, live, groups, of_few, spikes)
        for g in range(groups):
            q = live[g] & _INSIDE
            for j in range(q, q + GROUP):
                floats[_DRAW + j] = drawn(words[_FIRST + j], words[_SECOND + j], words[_FIRED + j], polynomial)
                words[_FIRED + j] = _U(words[_FIRED + j] + words[_DUE + j])
        for g in range(groups):
            q = live[g] & _INSIDE
            for j in range(q, q + GROUP):
                over, electrons = on_grid(x[_HELD + j] - x[_LIMIT + j]), x[_STANDS + j] * (1.0 / _G)
                if not whole:
                    over, electrons = after_reset(
                        over, x[_ARRIVES + j] / _G, x[_STANDS + j], per_root_rate, per_rate, kept
                    )
                phi = next_threshold(electrons, x[_NOISE + j], x[_JITTER + j], floats[_DRAW + j])
                limit = max((phi * x[_FACTOR + j] + x[_MOVED + j]) * x[_LOAD + j], _TRIPS)
                due = words[_DUE + j] != 0
                x[_ELECTRONS + j] = electrons
                x[_HELD + j] = over if due else x[_HELD + j]
                x[_PHI + j] = phi if due else x[_PHI + j]
                x[_LIMIT + j] = limit if due else x[_LIMIT + j]
                words[_AGAIN + j] = due & (over >= limit)
        if left != 0.0:
            for g in range(groups):
                q = live[g] & _INSIDE
                for j in range(q, q + GROUP):
                    held, rate = x[_HELD + j] / _G, x[_ARRIVES + j] / _G
                    crossed = number + x[_AT + j] - min(max(held / max(rate, 1e-12), 0.0), 1.0)
                    stays = left * (decay(min((crossed - x[_CROSSED + j]) / left_tau, LONG)) - 1.0)
                    phi = next_threshold(x[_ELECTRONS + j] + stays, x[_NOISE + j], x[_JITTER + j], floats[_DRAW + j])
                    limit = max((phi * x[_FACTOR + j] + x[_MOVED + j]) * x[_LOAD + j], _TRIPS)
                    due = words[_DUE + j] > words[_AGAIN + j]
                    x[_CROSSED + j] = crossed if due else x[_CROSSED + j]
                    x[_HELD + j] = on_grid((held - stays) * _G) if due else x[_HELD + j]
                    x[_PHI + j] = phi if due else x[_PHI + j]
                    x[_LIMIT + j] = limit if due else x[_LIMIT + j]
                for j in range(q, q + GROUP):
                    if words[_DUE + j] > words[_AGAIN + j] and x[_HELD + j] >= x[_LIMIT + j]:
                        end = number + x[_AT + j]
                        cross_again(x, words, j, end, left, left_tau, reset, polynomial)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def record_events(x: Floats, words: Words, live: Places, groups: int, of_few: FewCharge, spikes: Bytes) -> int:
    """Events of the pixels of live groups: a spike where they are due, else another charge from here on.

    Returns:
        Number of groups, listed, in which events may follow.
    """
    light, dark, light_factor, dark_factor, extra = of_few
    still = 0
    for g in range(groups):
        q = live[g] & _INSIDE
        goes_on = False
        for j in range(q, q + GROUP):
            at = np.int64(x[_AT + j])
            if words[_DUE + j] != 0:
                spikes[at - 1, words[_PIXEL + j]] = 1
                goes_on = True
            elif at < spikes.shape[0]:
                i = words[_EXTRA + j]
                at_light, at_dark = light[i] * light_factor[i], (dark[i] + extra[at, i]) * dark_factor[i]
                x[_ARRIVES + j] = frame_charge(at_light, at_dark)
                x[_UNTIL + j] = unchanged_until(extra, i, at)
                goes_on = True
        live[still] = q
        still += goes_on
    return still


@njit(inline="always")
def unchanged_until(extra: Floats, i: int, at: int) -> int:
    """First frame after `at` with other extra charge (F, n) of pixel i of the few; F if none."""
    until = at + 1
    while until < extra.shape[0] and extra[until, i] == extra[at, i]:
        until += 1
    return until


@njit(inline="always")
def drawn(first: np.uint32, second: np.uint32, number: np.uint32, polynomial: Polynomial) -> float:
    """The draw of a pixel of these keys for its spike of that number: standardised."""
    return standard(_U(first + _U(number * GOLDEN)), second, polynomial)  # type: ignore[no-any-return]


@njit(inline="always")
def after_reset(
    over: float, rate: float, limit: float, per_root_rate: float, per_rate: float, kept: float
) -> tuple[float, float]:
    """Charge after a reset [grains], and the electrons of which the next spike has noise [thresholds].

    Returns:
        The charge, and electrons up to the limit: light that falls while the node is held never reaches it, nor does
            its noise; a part of the charge that is lost leaves a rest that is known less well.
    """
    root, over = math.sqrt(rate), over / _G
    left = ((over - root * per_root_rate) - rate * per_rate) * kept
    return on_grid(left * _G), limit * (1.0 / _G) - kept * (1.0 - kept) * over


@njit(inline="always")
def next_threshold(electrons: float, per_electron: float, kappa_squared: float, draw: float) -> float:
    """Threshold [grains] with the spread of so many electrons [thresholds] and of the reset."""
    return _G + _G * math.sqrt(max(electrons, 0.0) * per_electron + kappa_squared) * draw


@njit(inline="always")
def count_neighbours(bits: Bytes, row: int, columns: int, around: Bytes) -> None:
    """How many of the four neighbours of each pixel of a row fired: around (columns,), overwritten."""
    here = bits[row * columns : (row + 1) * columns]
    around[:] = 0
    add(here[:-1], around[1:])
    add(here[1:], around[:-1])
    if row > 0:
        add(bits[(row - 1) * columns : row * columns], around)
    if (row + 1) * columns < bits.size:
        add(bits[(row + 1) * columns : (row + 2) * columns], around)


@njit(inline="always")
def add(values: Bytes, out: Bytes) -> None:
    for j in range(values.size):
        out[j] += values[j]


@njit(inline="always")
def couple(kick: float, around: Bytes, charge: Floats) -> None:
    """Add kicks of neighbours that fired to charge [grains]."""
    for j in range(charge.size):
        charge[j] = (charge[j] / _G + kick * around[j]) * _G
