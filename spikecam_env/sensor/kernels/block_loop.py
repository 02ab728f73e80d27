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

_U = np.uint32
_G = float(GRAINS)


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
            bend = np.int32(np.int32(np.int32(rest[p] * s1) >> np.int32(18)) - np.int32(np.int32(rest[p] * s0) >> np.int32(18)))
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
    frames = spikes.shape[0]
    light_step = 0 if light.shape[0] == 1 else 1
    dark_step = 0 if dark.shape[0] == 1 else 1
    field_step = 0 if field.shape[0] == 1 else 1
    rows = bottom - top if kick != 0.0 else max(1, min(bottom - top, BAND // columns))
    most = rows * columns
    hit = np.zeros((most + 7) // 8 * 8, np.uint8)
    eights = hit.view(np.uint64)
    at = np.empty(most, np.int32)
    draw = np.empty(most, np.float32)
    variance = np.empty(most, np.float64)
    for row0 in range(top, bottom, rows):
        row1 = min(row0 + rows, bottom)
        p0, p1 = row0 * columns, row1 * columns
        hit[:] = 0
        for t in range(frames):
            lights, darks, fields = light[light_step * t], dark[dark_step * t], field[field_step * t]
            for r in range(row0, row1):
                a, d = light_factor[t, r], dark_factor[t, r]
                f, m = factor[t, r], common[t, r]
                load = 1.0 + droop * activity[r]
                q = r * columns
                for p in range(q, q + columns):
                    x = max(lights[p] * a, 0.0) + max(darks[p] * d, 0.0)
                    c = charge[p] + x * _G
                    charge[p] = c
                    hit[p - p0] = c >= (threshold[p] * f + grains_per_mV[p] * (m + fields[p])) * load

            n = 0
            for word in range((p1 - p0 + 7) // 8):
                if eights[word]:
                    for j in range(8 * word, 8 * word + 8):
                        at[n] = p0 + j
                        n += hit[j]
            row = spikes[t]
            for p in range(p0, p1):
                row[p] = hit[p - p0]
            for i in range(n):
                p = at[i]
                key = first_key(p, seed_low)
                counter = _U(key + _U(fired[p] * GOLDEN))
                draw[i] = standard(counter, second_key(key, seed_high), polynomial)

            for i in range(n):
                p = at[i]
                r = p // columns
                rate = max(lights[p] * light_factor[t, r], 0.0) + max(darks[p] * dark_factor[t, r], 0.0)
                f, offset = factor[t, r], grains_per_mV[p] * (common[t, r] + fields[p])
                load = 1.0 + droop * activity[r]
                limit = (threshold[p] * f + offset) * load
                lost = per_root_rate * math.sqrt(rate) + per_rate * rate
                z = draw[i]
                while True:
                    over = (charge[p] - limit) / _G
                    residual = ((over - math.sqrt(rate) * per_root_rate) - rate * per_rate) * kept
                    charge[p] = residual * _G
                    # Electrons still to come: to the reference as it stands, and what is lost; of charge thrown away in
                    # part, the part kept is known less well than it was collected.
                    electrons = (f + offset / _G) * load + kept * lost - kept * (1.0 - kept) * over
                    threshold[p] = drawn_threshold(electrons, per_electron[p], kappa_squared[p], z)
                    fired[p] = _U(fired[p] + _U(1))
                    limit = (threshold[p] * f + offset) * load
                    if not charge[p] >= limit:
                        break
                    key = first_key(p, seed_low)
                    counter = _U(key + _U(fired[p] * GOLDEN))
                    z = standard(counter, second_key(key, seed_high), polynomial)
                draw[i] = z
                variance[i] = electrons

            if kick != 0.0:
                for r in range(row0, row1):
                    for x in range(columns):
                        p = r * columns + x
                        j = p - p0
                        around = 0
                        if r > row0:
                            around += hit[j - columns]
                        if r < row1 - 1:
                            around += hit[j + columns]
                        if x > 0:
                            around += hit[j - 1]
                        if x < columns - 1:
                            around += hit[j + 1]
                        charge[p] = (charge[p] / _G + kick * around) * _G
            if left != 0.0:
                for i in range(n):
                    p = at[i]
                    r = p // columns
                    rate = max(lights[p] * light_factor[t, r], 0.0) + max(darks[p] * dark_factor[t, r], 0.0)
                    over = min(max(charge[p] / _G / max(rate, 1e-12), 0.0), 1.0)
                    now = number + t + 1.0 - over
                    stays = left * math.expm1(-(now - crossing[p]) / left_tau)
                    charge[p] = (charge[p] / _G - stays) * _G
                    crossing[p] = now
                    threshold[p] = drawn_threshold(variance[i] + stays, per_electron[p], kappa_squared[p], draw[i])
            if droop != 0.0:
                for r in range(row0, row1):
                    count = 0
                    for j in range((r - row0) * columns, (r - row0 + 1) * columns):
                        count += hit[j]
                    activity[r] = count / columns


@njit(inline="always")
def drawn_threshold(electrons, per_electron, kappa_squared, z):  # type: ignore[no-untyped-def]
    """The charge that the next spike will need [grains], of which `electrons` thresholds must still arrive."""
    return _G * (1.0 + math.sqrt(max(electrons, 0.0) * per_electron + kappa_squared) * z)
