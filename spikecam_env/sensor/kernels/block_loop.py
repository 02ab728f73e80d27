"""The compiled loop of the block kernel: frame by frame, as `reference` has it, a band of rows at a time.

    charge += max(light light_factor, 0) + max(dark dark_factor, 0)
    while charge >= limit = (threshold factor + grains_per_mV (common + field)) (1 + droop activity):
        spike;  residual = (charge - limit - what the reset loses) kept;  threshold = GRAINS (1 + s z)

The same operations in the same order, in float64, so that without noise the bits are the reference's.  With noise the
electrons still to come are drawn once a spike, as in the jump kernel (`fast`).  No fastmath.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from spikecam_env.sensor.kernels.draws import GOLDEN, first_key, second_key, standard
from spikecam_env.sensor.light import GRAINS

BAND = 1024
"""Pixels of a band, about: what is worked on frame after frame stays in the first-level cache."""

DRAWS = 0x3BD9BCE3
"""Checksum of the draws compiled in: numba's cache sees a change of this file, not of those it imports from."""

_U = np.uint32
_Q = np.uint64
_G = float(GRAINS)

_COUNT = np.array([byte.bit_count() for byte in range(256)])
"""How many bits of a byte are one, and which, first ones first."""
_ONES = np.argsort(1 - (np.arange(256)[:, None] >> np.arange(8)) % 2, axis=1, kind="stable").astype(np.uint32)


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def ramp_charge(level, curve, rest, first, out):  # type: ignore[no-untyped-def]
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
def advance(  # type: ignore[no-untyped-def]
    top,
    bottom,
    number,
    columns,
    light,
    dark,
    light_factor,
    dark_factor,
    factor,
    common,
    field,
    grains_per_mV,
    feedback,
    per_electron,
    kappa_squared,
    polynomial,
    seed_low,
    seed_high,
    charge,
    threshold,
    fired,
    activity,
    crossing,
    spikes,
):
    """Frames `number` .. of the rows top .. bottom.  F frames, H rows of `columns` pixels, P pixels in all.

    light, dark: (F or 1, P) [thresholds].  light_factor, dark_factor, factor, common [mV]: (F, H).  field: (F or 1, P)
    float32 [mV].  grains_per_mV: (P,).  feedback: the numbers of `Feedback`, in its order.  per_electron (1/N),
    kappa_squared: (P,).  polynomial: 8 float32.  seed_low, seed_high: uint32.
    charge, threshold: (P,) [grains], fired: (P,) uint32, activity: (H,), crossing: (P,) [frames]; updated.
    spikes: (F, P) uint8, overwritten.  What is not said to be otherwise is float64.
    """
    per_root_rate, per_rate, kept, kick, left, left_tau, droop = feedback
    whole = per_root_rate == 0.0 and per_rate == 0.0 and kept == 1.0
    frames = spikes.shape[0]
    light_moves, dark_moves, field_moves = light.shape[0] > 1, dark.shape[0] > 1, field.shape[0] > 1
    rows = bottom - top if kick != 0.0 else max(1, min(bottom - top, BAND // columns))
    pitch = (columns + 7) // 8 * 8
    most = rows * pitch
    hit = np.zeros(most, np.uint8)
    eights = hit.view(np.uint64)
    arrives, held, phi, limit = np.zeros((4, most), np.float64)
    line_of, pixel_of = np.zeros((2, most), np.uint32)
    at = np.empty(most + 8, np.uint32)
    pixel, times = np.empty(most, np.uint32), np.empty(most, np.uint32)
    draw = np.empty(most, np.float32)
    rate, over, shift, stands = np.empty(most), np.empty(most), np.empty(most), np.empty(most)
    electrons, noise, jitter = np.empty(most), np.empty(most), np.empty(most)
    around = np.empty(columns, np.uint8)
    stood = np.empty((5, rows), np.float64)
    limit[:] = np.inf
    for i in range(rows):
        for j in range(columns):
            line_of[i * pitch + j], pixel_of[i * pitch + j] = i, i * columns + j
    for row0 in range(top, bottom, rows):
        row1 = min(row0 + rows, bottom)
        used = (row1 - row0) * pitch
        stood[:] = np.nan
        for r in range(row0, row1):
            p0, h0 = r * columns, (r - row0) * pitch
            copy(charge[p0 : p0 + columns], held[h0 : h0 + columns])
            copy(threshold[p0 : p0 + columns], phi[h0 : h0 + columns])
        for t in range(frames):
            lights, darks, fields = light[t * light_moves], dark[t * dark_moves], field[t * field_moves]
            light_scale, dark_scale, factors, commons = light_factor[t], dark_factor[t], factor[t], common[t]
            for r in range(row0, row1):
                i, p0, h0 = r - row0, r * columns, (r - row0) * pitch
                a, d, f, m = light_scale[r], dark_scale[r], factors[r], commons[r]
                load = 1.0 + droop * activity[r]
                if light_moves or dark_moves or a != stood[0, i] or d != stood[1, i]:
                    stood[0, i], stood[1, i] = a, d
                    arrive(lights[p0 : p0 + columns], darks[p0 : p0 + columns], a, d, arrives[h0 : h0 + columns])
                if field_moves or f != stood[2, i] or m != stood[3, i] or load != stood[4, i]:
                    stood[2, i], stood[3, i], stood[4, i] = f, m, load
                    references(
                        grains_per_mV[p0 : p0 + columns],
                        fields[p0 : p0 + columns],
                        phi[h0 : h0 + columns],
                        f,
                        m,
                        load,
                        limit[h0 : h0 + columns],
                    )
            for j in range(used):
                c = held[j] + arrives[j]
                held[j] = c
                hit[j] = c >= limit[j]
            n = listed(eights[: used // 8], at)
            bits = spikes[t]
            for r in range(row0, row1):
                row_bits, row_hit = bits[r * columns : (r + 1) * columns], hit[(r - row0) * pitch :]
                for j in range(columns):
                    row_bits[j] = row_hit[j]
            for i in range(n):
                h = _Q(at[i])
                p = _Q(row0 * columns + pixel_of[h])
                pixel[i] = p
                times[i] = fired[p]
                fired[p] = _U(fired[p] + _U(1))
                rate[i] = arrives[h] / _G
                over[i] = held[h] - limit[h]
                line = _Q(row0 + line_of[h])
                shift[i] = grains_per_mV[p] * (commons[line] + fields[p])
                stands[i] = (_G * factors[line] + shift[i]) * (1.0 + droop * activity[line])
                noise[i] = per_electron[p]
                jitter[i] = kappa_squared[p]
            for i in range(n):
                draw[i] = drawn(pixel[i], times[i], seed_low, seed_high, polynomial)
            if whole:
                for i in range(n):
                    electrons[i] = stands[i] * (1.0 / _G)
            else:
                for i in range(n):
                    over[i], electrons[i] = after_reset(over[i], rate[i], stands[i], per_root_rate, per_rate, kept)
            for i in range(n):
                stands[i] = needed(electrons[i], noise[i], jitter[i], draw[i])
            for i in range(n):
                h = _Q(at[i])
                line = _Q(row0 + line_of[h])
                f, load = factors[line], 1.0 + droop * activity[line]
                now = (stands[i] * f + shift[i]) * load
                while over[i] >= now:
                    p = _Q(pixel[i])
                    draw[i] = drawn(pixel[i], fired[p], seed_low, seed_high, polynomial)
                    fired[p] = _U(fired[p] + _U(1))
                    level = (_G * f + shift[i]) * load
                    over[i], electrons[i] = after_reset(over[i] - now, rate[i], level, per_root_rate, per_rate, kept)
                    stands[i] = needed(electrons[i], noise[i], jitter[i], draw[i])
                    now = (stands[i] * f + shift[i]) * load
                held[h], phi[h], limit[h] = over[i], stands[i], now

            if kick != 0.0:
                for r in range(top, bottom):
                    count_neighbours(bits, r, columns, around)
                    couple(kick, around, held[(r - top) * pitch : (r - top) * pitch + columns])
            if left != 0.0:
                for i in range(n):
                    h, p = _Q(at[i]), _Q(pixel[i])
                    late = min(max(held[h] / _G / max(rate[i], 1e-12), 0.0), 1.0)
                    crossed = number + t + 1.0 - late
                    stays = left * math.expm1(-(crossed - crossing[p]) / left_tau)
                    crossing[p] = crossed
                    held[h] = (held[h] / _G - stays) * _G
                    phi[h] = needed(electrons[i] + stays, noise[i], jitter[i], draw[i])
                    line = _Q(row0 + line_of[h])
                    limit[h] = (phi[h] * factors[line] + shift[i]) * (1.0 + droop * activity[line])
            if droop != 0.0:
                for r in range(row0, row1):
                    activity[r] = 0.0
                for i in range(n):
                    activity[row0 + line_of[at[i]]] += 1.0
                for r in range(row0, row1):
                    activity[r] /= columns
        for r in range(row0, row1):
            p0, h0 = r * columns, (r - row0) * pitch
            copy(held[h0 : h0 + columns], charge[p0 : p0 + columns])
            copy(phi[h0 : h0 + columns], threshold[p0 : p0 + columns])


@njit(inline="always")
def copy(values, out):  # type: ignore[no-untyped-def]
    for j in range(out.size):
        out[j] = values[j]


@njit(inline="always")
def arrive(light, dark, light_factor, dark_factor, out):  # type: ignore[no-untyped-def]
    """Charge of a row in one frame [grains]."""
    for j in range(out.size):
        out[j] = (max(light[j] * light_factor, 0.0) + max(dark[j] * dark_factor, 0.0)) * _G


@njit(inline="always")
def references(grains_per_mV, field, phi, factor, common, load, out):  # type: ignore[no-untyped-def]
    """Charge at which the pixels of a row fire in one frame [grains]."""
    for j in range(out.size):
        out[j] = (phi[j] * factor + grains_per_mV[j] * (common + field[j])) * load


@njit(inline="always")
def listed(eights, at):  # type: ignore[no-untyped-def]
    """Write to `at` the numbers of the bytes that are one; returns how many there are.

    The bytes of a word are gathered to eight bits, and the table says at once where the ones are.
    """
    n = 0
    for word in range(eights.size):
        which = (eights[word] * _Q(0x0102040810204080)) >> _Q(56)
        if which == 0:
            continue
        for k in range(8):
            at[_Q(n + k)] = _U(_U(8 * word) + _ONES[which, k])
        n += _COUNT[which]
    return n


@njit(inline="always")
def drawn(pixel, number, seed_low, seed_high, polynomial):  # type: ignore[no-untyped-def]
    """A pixel's draw for its spike of that number: standardised."""
    key = first_key(pixel, seed_low)
    return standard(_U(key + _U(number * GOLDEN)), second_key(key, seed_high), polynomial)


@njit(inline="always")
def after_reset(over, rate, limit, per_root_rate, per_rate, kept):  # type: ignore[no-untyped-def]
    """Charge after a reset [grains], and how many electrons the next spike still needs [thresholds].

    Those up to the limit and those lost; of charge thrown away in part, the rest is known less well than it was.
    """
    root, over = math.sqrt(rate), over / _G
    left = ((over - root * per_root_rate) - rate * per_rate) * kept
    lost = kept * (root * per_root_rate + rate * per_rate)
    return left * _G, limit * (1.0 / _G) + lost - kept * (1.0 - kept) * over


@njit(inline="always")
def needed(electrons, per_electron, kappa_squared, draw):  # type: ignore[no-untyped-def]
    """The threshold [grains] whose charge is spread as that of so many electrons [thresholds] and the reset."""
    return _G + _G * math.sqrt(max(electrons, 0.0) * per_electron + kappa_squared) * draw


@njit(inline="always")
def count_neighbours(bits, row, columns, around):  # type: ignore[no-untyped-def]
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
def add(values, out):  # type: ignore[no-untyped-def]
    for j in range(values.size):
        out[j] += values[j]


@njit(inline="always")
def couple(kick, around, charge):  # type: ignore[no-untyped-def]
    """Charge [grains] with what the neighbours that fired couple in."""
    for j in range(around.size):
        charge[j] = (charge[j] / _G + kick * around[j]) * _G
