"""The compiled loop of the fast engine: from spike to spike, 32 pixels at a time.

    F(k) = i0 k + B k^2 + r k^2 / 2n                    grains collected before frame k (`light`, exact integers)
    next spike: smallest k with F(k) >= x               x: grains at which the pixel fires, counted from the key
    x <- x + GRAINS (1 + s z)                           s: relative spread of the threshold, z: standardised draw

k is the root of the quadratic in float32, rounded; the integers then decide on which side of it the crossing lies, so
the bits are those of the frame-by-frame sum.  z is a polynomial (`quantile`) of a sum of eight bytes hashed from
(seed, pixel, spike number): no generator has a state, so neither chunks nor threads change a draw.

Numba widens uint32 * uint32 to uint64: every operation is cast back.  No fastmath: bits must not depend on the machine.
All of it is in one file, because numba's cache looks only at the file of the function it compiles.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from spikecam_env.sensor.kernels.wide import use_widest_vectors
from spikecam_env.sensor.light import GRAINS, MAX_GRAINS_PER_FRAME, MAX_SEGMENT

TILE = 256
"""Pixels worked on between reading and writing memory; state arrays are padded to whole tiles."""

BAND = 8
"""Tiles that one thread takes at a time: 256 bytes of a packed frame, so threads do not write one cache line."""

_LANES = 32
"""Pixels that go from spike to spike together: LLVM makes vector instructions of it (8 it would unroll to scalars)."""

_U = np.uint32
_I = np.int32
_F = np.float32
_B = np.uint8
_Q = np.uint64

_GRAINS = _F(GRAINS)
_CAP = _F(MAX_GRAINS_PER_FRAME)
_LONGEST = _F(MAX_SEGMENT)
_GOLDEN = _U(0x9E3779B9)  # 2^32 / golden ratio: the counter's step from spike to spike

# Rows of a tile's scratch array: one array with fixed offsets, so that LLVM can prove that rows do not overlap.
_LEVEL, _CURVE, _REST, _X, _END, _COUNTER, _KEY, _SPIKES, _LOW, _HIGH, _FRAME, _DRAW = (r * TILE for r in range(12))
_SCRATCH = 12 * TILE


@njit(inline="always")
def scramble(x: Any) -> Any:
    """32-bit integer hash, a bijection: xor-shift-multiply with the `lowbias32` constants 21f0aaad, 735a2d97."""
    x = _U(x ^ (x >> _U(16)))
    x = _U(x * _U(0x21F0AAAD))
    x = _U(x ^ (x >> _U(15)))
    x = _U(x * _U(0x735A2D97))
    return _U(x ^ (x >> _U(15)))


@njit(inline="always")
def first_key(pixel: Any, seed_low: Any) -> Any:
    """Start of a pixel's counter."""
    return scramble(_U(_U(pixel) ^ seed_low))


@njit(inline="always")
def second_key(key: Any, seed_high: Any) -> Any:
    """Keeps pixels apart whose counters overlap."""
    return scramble(_U(_U(key + seed_high) ^ _U(0xA511E9B3)))


@njit(inline="always")
def byte_sum(a: Any, b: Any) -> Any:
    """Sum of the eight bytes of two words."""
    pairs = _U(0x00FF00FF)
    t = _U(_U(_U(a & pairs) + _U(_U(a >> _U(8)) & pairs)) + _U(_U(b & pairs) + _U(_U(b >> _U(8)) & pairs)))
    return _U(_U(t & _U(0xFFFF)) + _U(t >> _U(16)))


@njit(inline="always")
def bell(counter: Any, key: Any) -> Any:
    """A draw in (-4, 4): eight uniform bytes, summed, over 256; a ninth byte fills the step between two sums.

    The bytes are those of h2 and h1 + h2, independent words: h1 is uniform whatever h2, keyed apart, is.
    """
    h1 = scramble(counter)
    h2 = scramble(_U(h1 ^ key))
    fine = _I(_U(_U(byte_sum(h2, _U(h1 + h2)) << _U(8)) | _U(h1 >> _U(24))))
    return _F(fine) * _F(1 / 65536) + _F(0.5 / 65536 + 3.5 / 256 - 4.0)


@njit(inline="always")
def drawn(counter: Any, key: Any, spread: Any, c: Any) -> Any:
    """Grains to the next spike."""
    x = bell(counter, key)
    z = ((((((c[7] * x + c[6]) * x + c[5]) * x + c[4]) * x + c[3]) * x + c[2]) * x + c[1]) * x + c[0]
    return _I(_GRAINS + spread * z)


@njit(inline="always")
def collected(level: Any, curve: Any, rest: Any, k: Any) -> Any:
    """F(k); level = i0, curve = B, rest = r / 2n in 2^-18."""
    square = _I(k * k)
    return _I(_I(_I(level * k) + _I(curve * square)) + _I(_I(rest * square) >> _I(18)))


@njit(inline="always")
def nearest_frame(level: Any, curve: Any, rest: Any, x: Any) -> Any:
    """The k nearest to where F reaches x; float32 is wrong by 0.03 at worst, where light fades to nothing."""
    a = _F(level)
    b = _F(curve) + _F(rest) * _F(1 / (1 << 18))
    x2 = _F(x) + _F(x)
    root = _F(np.sqrt(max(a * a + (b + b) * x2, _F(0.0))))
    return _I(min(x2 / (a + root), _LONGEST) + _F(0.5))


@njit(inline="always")
def transpose_bits(words: Any) -> None:
    """Transpose every word's 8 x 8 bits: bytes that hold a pixel's frames become bytes that hold a frame's pixels."""
    for j in range(words.size):
        w = words[j]
        t = (w ^ (w >> _Q(7))) & _Q(0x00AA00AA00AA00AA)
        w = w ^ t ^ (t << _Q(7))
        t = (w ^ (w >> _Q(14))) & _Q(0x0000CCCC0000CCCC)
        w = w ^ t ^ (t << _Q(14))
        t = (w ^ (w >> _Q(28))) & _Q(0x00000000F0F0F0F0)
        words[j] = w ^ t ^ (t << _Q(28))


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def advance(  # type: ignore[no-untyped-def]
    worker,
    workers,
    radiance0,
    radiance1,
    length,
    first,
    count,
    gain,
    dark,
    spread,
    polynomial,
    seed_low,
    seed_high,
    remaining,
    fired,
    packed,
):
    """Frames first .. first + count of a key interval, for every `workers`-th band of tiles from `worker` on.

    radiance0, radiance1: (P,) float32.  length, first, count: int32.  gain, dark: float32 [grains/frame]; spread:
    float32 [grains]; remaining: int32 [grains] and fired: uint32, updated; these five are padded to whole tiles.
    polynomial: 8 float32.  seed_low, seed_high: uint32.  packed: uint8 (count, ceil(P/8)), overwritten: pixel p is bit
    p % 8 of byte p // 8.
    """
    use_widest_vectors()
    pixels = radiance0.shape[0]
    stop = _I(first + count)
    twice = _I(2 * length)
    per_twice = _F(1.0 / twice)
    per = _I(((1 << 18) + twice - 1) // twice)
    flat = packed.reshape(-1)
    row = _Q(packed.shape[1])
    s = np.zeros(_SCRATCH, np.int32)
    planes = np.zeros(8 * TILE, np.uint8)
    eights = planes.view(np.uint64)
    for tile in range((pixels + TILE - 1) // TILE):
        if (tile // BAND) % workers != worker:
            continue
        p0 = tile * TILE
        n = min(TILE, pixels - p0)
        light0 = radiance0[p0 : p0 + n]
        light1 = radiance1[p0 : p0 + n]
        g = gain[p0 : p0 + TILE]
        d = dark[p0 : p0 + TILE]
        sd = spread[p0 : p0 + TILE]
        left = remaining[p0 : p0 + TILE]
        number = fired[p0 : p0 + TILE]

        for j in range(n, TILE):
            s[_LEVEL + j] = 0
            s[_CURVE + j] = 0
            s[_REST + j] = 0
        for j in range(n):
            i0 = _I(min(light0[j] * g[j] + d[j], _CAP) + _F(0.5))
            rise = _I(_I(min(light1[j] * g[j] + d[j], _CAP) + _F(0.5)) - i0)
            curve = _I(np.floor(_F(rise) * per_twice))
            s[_LEVEL + j] = i0
            s[_CURVE + j] = curve
            s[_REST + j] = _I(_I(rise - _I(curve * twice)) * per)
        for j in range(TILE):
            s[_X + j] = _I(left[j] + collected(s[_LEVEL + j], s[_CURVE + j], s[_REST + j], first))
            s[_END + j] = collected(s[_LEVEL + j], s[_CURVE + j], s[_REST + j], stop)
            s[_LOW + j] = 0
            s[_HIGH + j] = 0

        if count == 1:
            for j in range(TILE):
                if s[_X + j] <= s[_END + j]:
                    s[_LOW + j] = 1
                    key = first_key(p0 + j, seed_low)
                    while s[_X + j] <= s[_END + j]:
                        counter = _U(key + _U(number[j] * _GOLDEN))
                        s[_X + j] += drawn(counter, second_key(key, seed_high), sd[j], polynomial)
                        number[j] = _U(number[j] + _U(1))
        for q in range(0, TILE, _LANES):
            go = _I(0)
            for j in range(q, q + _LANES):
                go = _I(go | _I(s[_X + j] <= s[_END + j]))
            if not go:
                continue
            for j in range(q, q + _LANES):
                key = first_key(p0 + j, seed_low)
                s[_COUNTER + j] = _I(_U(key + _U(number[j] * _GOLDEN)))
                s[_KEY + j] = _I(second_key(key, seed_high))
                s[_SPIKES + j] = 0
            # Three short loops, each of independent lanes: the processor overlaps them; one long one it cannot.
            step = _U(0)
            while go:
                for j in range(q, q + _LANES):
                    s[_DRAW + j] = drawn(_U(_U(s[_COUNTER + j]) + step), _U(s[_KEY + j]), sd[j], polynomial)
                for j in range(q, q + _LANES):
                    s[_FRAME + j] = nearest_frame(s[_LEVEL + j], s[_CURVE + j], s[_REST + j], s[_X + j])
                go = _I(0)
                for j in range(q, q + _LANES):
                    x = s[_X + j]
                    active = _I(-_I(x <= s[_END + j]))
                    k = s[_FRAME + j]
                    before = _I(collected(s[_LEVEL + j], s[_CURVE + j], s[_REST + j], k) >= x)
                    at = _I(_I(k - first) - before)
                    late = _I(-_I(at >= _I(32)))
                    bit = _I(_I(1) << _I(at & _I(31)))
                    s[_LOW + j] |= _I(bit & _I(active & _I(~late)))
                    s[_HIGH + j] |= _I(bit & _I(active & late))
                    s[_SPIKES + j] = _I(s[_SPIKES + j] - active)
                    x = _I(x + _I(s[_DRAW + j] & active))
                    s[_X + j] = x
                    go = _I(go | _I(x <= s[_END + j]))
                step = _U(step + _GOLDEN)
            for j in range(q, q + _LANES):
                number[j] = _U(number[j] + _U(s[_SPIKES + j]))
        for j in range(TILE):
            left[j] = _I(s[_X + j] - s[_END + j])

        start = _Q(p0 // 8)
        for plane in range((count + 7) // 8):
            word = _HIGH if plane >= 4 else _LOW
            shift = _U(8 * (plane & 3))
            for j in range(TILE):
                planes[plane * TILE + j] = _B(_U(s[word + j]) >> shift)
            words = eights[plane * (TILE // 8) : (plane + 1) * (TILE // 8)]
            transpose_bits(words)
            for k in range(8 * plane, min(8 * plane + 8, count)):
                at_byte = start + row * _Q(k)
                byte = _Q(8 * (k & 7))
                for j in range((n + 7) // 8):
                    flat[at_byte + _Q(j)] = _B(words[j] >> byte)


@njit(cache=True, nogil=True, boundscheck=False)
def unpack(packed, spikes):  # type: ignore[no-untyped-def]
    """Bytes (n,) of bits, least significant first, to 0/1 in bytes: `spikes` is (n,) uint64, eight pixels to a word."""
    for i in range(packed.size):
        w = _Q(packed[i])
        w = (w | (w << _Q(28))) & _Q(0x0000000F0000000F)
        w = (w | (w << _Q(14))) & _Q(0x0003000300030003)
        spikes[i] = (w | (w << _Q(7))) & _Q(0x0101010101010101)
