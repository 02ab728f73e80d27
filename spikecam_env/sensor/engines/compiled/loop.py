"""The compiled loops of the fast engine: a tile of pixels at a time, from spike to spike or frame by frame.

    F(k) = i0 k + B k^2 + r k^2 / 2n                    grains collected before frame k (`light`, exact integers)
    next spike: smallest k with F(k) >= x               x: grains at which the pixel fires, counted from the key
    x <- x + GRAINS (1 + s z)                           s: relative spread of the threshold, z: standardised draw

Jumping, k is the root of the quadratic in float32, rounded; the integers then decide on which side of it the crossing
lies, so the bits are those of the frame-by-frame sum.  Streaming (`dense`), one frame at a time is compared: cheaper
where most pixels fire in most frames, and for a single frame.  z is a polynomial (`quantile`) of
a sum of eight bytes hashed from (seed, pixel, spike number): no generator has a state, so neither chunks nor threads,
nor the choice between the two, change a draw.

Spikes are served in rounds, one spike of each pixel that has one to come.  A round is short stages over the live groups
of pixels, with results in a tile's scratch.  A processor looks some hundred instructions ahead, and finds more to do at
once in many short chains than in a few long ones (a third faster).

No fastmath: bits must not depend on the machine.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.np.numpy_support import carray
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.sensor.ground.draws import GOLDEN, bell_of, first_key, scramble, second_key
from spikecam_env.sensor.ground.intrinsics import pointer_to, take_ticket, use_widest_vectors
from spikecam_env.sensor.light import GRAINS, MAX_GRAINS_PER_FRAME, MAX_SEGMENT

TILE = 256
"""Pixels worked on between reading and writing memory; state arrays are padded to whole tiles."""

BAND = 8
"""Tiles that one thread takes at a time; 2 kilobytes of a frame are then written in one go."""

WIDTH = BAND * TILE

GROUP = 32
"""Pixels that are live or idle together: LLVM makes vector instructions of it (16 it would unroll to scalars)."""

_U = np.uint32
_I = np.int32
_F = np.float32
_B = np.uint8
_Q = np.uint64

_GRAINS = _F(GRAINS)
_LEAST = _F(1.0)  # grain to the next spike: no draw takes a pixel back in time
CAP = _F(MAX_GRAINS_PER_FRAME)
_LONGEST = _F(MAX_SEGMENT)
GOLDEN_SIGNED = _I(0x9E3779B9 - (1 << 32))

# Rows of a tile's scratch array: one array with fixed offsets, so that LLVM can prove that rows do not overlap.
LEVEL, CURVE, REST, X, END, COUNTER, KEY, SPREAD = (r * TILE for r in range(8))
SPIKES, LOW, HIGH, FRAME, DRAW, WORD, BELL = (r * TILE for r in range(8, 15))
SCRATCH = 15 * TILE
INSIDE = TILE - 1  # masks a group's start: not negative, so that numba leaves wrapping indices out


@njit(inline="always")
def charge_of(x: Any, spread: Any, c: Any) -> Any:
    """Grains to the next spike, of a draw of `bell`."""
    z = ((((((c[7] * x + c[6]) * x + c[5]) * x + c[4]) * x + c[3]) * x + c[2]) * x + c[1]) * x + c[0]
    return _I(max(_GRAINS + spread * z, _LEAST))


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


@njit(inline="always")
def ramp_of(light0: Any, light1: Any, gain: Any, dark: Any, twice: Any, per_twice: Any, per: Any) -> Any:
    """(level, curve, rest) of one pixel: `light.ramp`."""
    i0 = _I(min(light0 * gain + dark, CAP) + _F(0.5))
    rise = _I(_I(min(light1 * gain + dark, CAP) + _F(0.5)) - i0)
    curve = _I(np.floor(_F(rise) * per_twice))
    return i0, curve, _I(_I(rise - _I(curve * twice)) * per)


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def ramp(light0: Any, light1: Any, gain: Any, dark: Any, length: Any) -> Any:
    """(level, curve, rest) of all pixels, each (P,) int32: `light.ramp`."""
    level, curve, rest = np.empty((3, light0.size), np.int32)
    twice = _I(2 * length)
    per_twice, per = _F(1.0 / twice), _I(((1 << 18) + twice - 1) // twice)
    for p in range(light0.size):
        level[p], curve[p], rest[p] = ramp_of(light0[p], light1[p], gain[p], dark[p], twice, per_twice, per)
    return level, curve, rest


@njit(inline="always")
def integrate(s: Any, light0: Any, light1: Any, gain: Any, dark: Any, n: Any, length: Any) -> None:
    """Rows LEVEL, CURVE, REST of a tile of n pixels: `light.ramp`.  Pixels beyond the array get no light."""
    twice = _I(2 * length)
    per_twice = _F(1.0 / twice)
    per = _I(((1 << 18) + twice - 1) // twice)
    for j in range(n, TILE):
        s[LEVEL + j] = 0
        s[CURVE + j] = 0
        s[REST + j] = 0
    for j in range(n):
        s[LEVEL + j], s[CURVE + j], s[REST + j] = ramp_of(light0[j], light1[j], gain[j], dark[j], twice, per_twice, per)


@njit(inline="always")
def expected(s: Any, first: Any, stop: Any) -> Any:
    """Spikes that a tile's light will bring, all pixels together."""
    total = _F(0.0)
    for q in range(0, TILE, GROUP):
        j = q + GROUP // 2
        a, b, c = s[LEVEL + j], s[CURVE + j], s[REST + j]
        total += _F(_I(collected(a, b, c, stop) - collected(a, b, c, first)))
    return total * (_F(GROUP) / _GRAINS)


@njit(inline="always")
def find_live(s: Any, flags: Any, end: Any, live: Any) -> Any:
    """Fill row END with F(end); list the groups in which a pixel fires before; returns their number."""
    for j in range(TILE):
        s[END + j] = collected(s[LEVEL + j], s[CURVE + j], s[REST + j], end)
        flags[j] = _B(s[X + j] <= s[END + j])
    eights = flags.view(np.uint64)
    groups: Any = 0
    for i in range(TILE // GROUP):
        go = _Q(0)
        for word in range(i * (GROUP // 8), (i + 1) * (GROUP // 8)):
            go |= eights[word]
        live[groups] = i * GROUP
        groups += _I(go != _Q(0))
    return groups


@njit(inline="always")
def wake(s: Any, f: Any, live: Any, groups: Any, p0: Any, number: Any, spread: Any, low: Any, high: Any) -> None:
    """Rows COUNTER, KEY, SPREAD of the live groups; number: spikes before those of row SPIKES; low, high: the seed."""
    for i in range(groups):
        q = live[i] & INSIDE
        for j in range(q, q + GROUP):
            key = first_key(p0 + j, low)
            s[COUNTER + j] = _I(_U(key + _U(_U(number[j] + _U(s[SPIKES + j])) * GOLDEN)))
            s[KEY + j] = _I(second_key(key, high))
            f[SPREAD + j] = spread[j]


@njit(inline="always")
def draw(s: Any, f: Any, live: Any, groups: Any) -> None:
    """Row BELL of the live groups: the draw of each pixel's next spike."""
    for i in range(groups):
        q = live[i] & INSIDE
        for j in range(q, q + GROUP):
            s[WORD + j] = _I(scramble(_U(s[COUNTER + j])))
    for i in range(groups):
        q = live[i] & INSIDE
        for j in range(q, q + GROUP):
            s[BELL + j] = _I(scramble(_U(_U(s[WORD + j]) ^ _U(s[KEY + j]))))
    for i in range(groups):
        q = live[i] & INSIDE
        for j in range(q, q + GROUP):
            f[BELL + j] = bell_of(_U(s[WORD + j]), _U(s[BELL + j]))


@njit(inline="always")
def reset(s: Any, j: Any, active: Any, charge: Any, low: Any, high: Any) -> Any:
    """Note an active pixel's spike (active: -1, else 0) in the frame of this bit; whether it fires again."""
    s[LOW + j] |= _I(low & active)
    s[HIGH + j] |= _I(high & active)
    s[SPIKES + j] = _I(s[SPIKES + j] - active)
    s[COUNTER + j] = _I(s[COUNTER + j] + _I(GOLDEN_SIGNED & active))
    x = _I(s[X + j] + _I(charge & active))
    s[X + j] = x
    return _I(x <= s[END + j])


@njit(inline="always")
def jump(s: Any, f: Any, live: Any, groups: Any, polynomial: Any, first: Any) -> Any:
    """Let each live pixel fire in the frame of its crossing; returns how many groups stay live.

    Args:
        first: frame of the key interval of bit 0.
    """
    for i in range(groups):
        q = live[i] & INSIDE
        for j in range(q, q + GROUP):
            s[DRAW + j] = charge_of(f[BELL + j], f[SPREAD + j], polynomial)
    for i in range(groups):
        q = live[i] & INSIDE
        for j in range(q, q + GROUP):
            s[FRAME + j] = nearest_frame(s[LEVEL + j], s[CURVE + j], s[REST + j], s[X + j])
    still: Any = 0
    for i in range(groups):
        q = live[i] & INSIDE
        go = _I(0)
        for j in range(q, q + GROUP):
            x = s[X + j]
            active = _I(-_I(x <= s[END + j]))
            k = s[FRAME + j]
            before = _I(collected(s[LEVEL + j], s[CURVE + j], s[REST + j], k) >= x)
            at = _I(_I(k - first) - before)
            late = _I(-_I(at >= _I(32)))
            bit = _I(_I(1) << _I(at & _I(31)))
            go = _I(go | reset(s, j, active, s[DRAW + j], _I(bit & _I(~late)), _I(bit & late)))
        live[still] = q
        still += go
    return still


@njit(inline="always")
def stream(s: Any, f: Any, live: Any, groups: Any, polynomial: Any, at: Any) -> Any:
    """As `jump`, where every live pixel fires in the frame of bit `at`."""
    bit = _I(_I(1) << _I(at & _I(31)))
    low = _I(bit * _I(at < _I(32)))
    high = _I(bit * _I(at >= _I(32)))
    still: Any = 0
    for i in range(groups):
        q = live[i] & INSIDE
        go = _I(0)
        for j in range(q, q + GROUP):
            active = _I(-_I(s[X + j] <= s[END + j]))
            charge = charge_of(f[BELL + j], f[SPREAD + j], polynomial)
            go = _I(go | reset(s, j, active, charge, low, high))
        live[still] = q
        still += go
    return still


@njit(inline="always")
def write_bits(eights: Any, start: Any, words: Any, out: Any) -> None:
    """Planes of a band, a byte of eight frames for each pixel, to frames of bits (F, ceil(P/8)) uint8."""
    for plane in range((out.shape[0] + 7) // 8):
        of_plane = eights[plane * (WIDTH // 8) : plane * (WIDTH // 8) + words]
        transpose_bits(of_plane)
        for k in range(8 * plane, min(8 * plane + 8, out.shape[0])):
            bits = out[k, start : start + words]
            byte = _Q(8 * (k & 7))
            for j in range(words):
                bits[j] = _B(of_plane[j] >> byte)


@njit(inline="always")
def write_bytes(eights: Any, start: Any, words: Any, out: Any) -> None:
    """The same to frames of bytes, (F, ceil(P/8)) uint64 of eight pixels each."""
    for plane in range((out.shape[0] + 7) // 8):
        of_plane = eights[plane * (WIDTH // 8) : plane * (WIDTH // 8) + words]
        for k in range(8 * plane, min(8 * plane + 8, out.shape[0])):
            pixels = out[k, start : start + words]
            bit = _Q(k & 7)
            for j in range(words):
                pixels[j] = (of_plane[j] >> bit) & _Q(0x0101010101010101)


# Columns of a table of cameras: addresses of arrays, then numbers.
CAMERA_COLUMNS = 13
GAIN, DARK, SPREAD_OF, POLYNOMIAL, REMAINING, FIRED, OUT = range(7)
SEED_LOW, SEED_HIGH, PIXELS, FRAMES, FIRST_PIECE, STOP_PIECE = range(7, 13)

# Columns of a table of pieces: addresses of the light at both ends of a key interval, then which frames of it.
PIECE_COLUMNS = 5
LIGHT0, LIGHT1, LENGTH, FIRST, COUNT = range(5)


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def advance(
    worker: int,
    tickets: NDArray[np.int64],
    cameras: NDArray[np.int64],
    bands: NDArray[np.int32],
    pieces: NDArray[np.int64],
    dense: float,
    packed: bool,
) -> None:
    """Advance one or more cameras, for the bands of tiles that this thread gets hold of.

    Args:
        worker: number of this thread.
        tickets: int64 (threads, 8), shared: in [:, 0] the next band of each one's share.  A thread that has finished
            its own takes those of others.
        cameras: int64 (C, CAMERA_COLUMNS).  Addresses of gain, dark: float32 [grains/frame]; spread: float32 [grains];
            polynomial: 8 float32; remaining: int32 [grains] and fired: uint32, updated; out, overwritten.  All but
            polynomial and out are padded to whole tiles.  Then the seed's two words, pixels P, frames F (at most
            MAX_SEGMENT), and the first piece of the camera and the piece after its last.
        bands: int32 (B, 2), every camera's bands: the camera, and which of its bands.
        pieces: int64 (S, PIECE_COLUMNS), those of a camera one after another, F frames together: addresses of the
            light at the start and at the end of a key interval, (P,) float32 each, its length, and which of its frames:
            from, count.
        dense: expected spikes a pixel and frame above which a tile is streamed.
        packed: out is uint8 (F, ceil(P/8)), pixel p is bit p % 8 of byte p // 8; or else uint64 (F, ceil(P/8)), pixel p
            is byte p % 8 of word p // 8, 0 or 1.
    """
    use_widest_vectors()
    s = np.empty(SCRATCH, np.int32)
    f = s.view(np.float32)
    live = np.empty(TILE // GROUP + 1, np.int64)
    flags = np.empty(TILE, np.uint8)
    planes = np.empty(8 * WIDTH, np.uint8)
    eights = planes.view(np.uint64)
    workers = tickets.shape[0]
    share = worker
    ticket = take_ticket(tickets, share)
    while True:
        while ticket >= len(bands) * (share + 1) // workers:
            share = (share + 1) % workers
            if share == worker:
                return
            ticket = take_ticket(tickets, share)
        camera, band = cameras[bands[ticket, 0]], bands[ticket, 1]
        pixels, frames = camera[PIXELS], camera[FRAMES]
        low, high = _U(camera[SEED_LOW]), _U(camera[SEED_HIGH])
        whole = (pixels + TILE - 1) // TILE * TILE
        gain = carray(pointer_to(camera[GAIN], np.float32), (whole,))
        dark = carray(pointer_to(camera[DARK], np.float32), (whole,))
        spread = carray(pointer_to(camera[SPREAD_OF], np.float32), (whole,))
        remaining = carray(pointer_to(camera[REMAINING], np.int32), (whole,))
        fired = carray(pointer_to(camera[FIRED], np.uint32), (whole,))
        c = carray(pointer_to(camera[POLYNOMIAL], np.float32), (8,))
        polynomial = (c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7])
        for p0 in range(band * WIDTH, min(pixels, (band + 1) * WIDTH), TILE):
            n = min(TILE, pixels - p0)
            left = remaining[p0 : p0 + TILE]
            number = fired[p0 : p0 + TILE]
            for j in range(TILE):
                s[X + j] = left[j]
                s[SPIKES + j] = 0
                s[LOW + j] = 0
                s[HIGH + j] = 0
            done: Any = 0
            for k in range(camera[FIRST_PIECE], camera[STOP_PIECE]):
                first, count = _I(pieces[k, FIRST]), _I(pieces[k, COUNT])
                stop = _I(first + count)
                light0 = carray(pointer_to(pieces[k, LIGHT0], np.float32), (pixels,))
                light1 = carray(pointer_to(pieces[k, LIGHT1], np.float32), (pixels,))
                integrate(
                    s,
                    light0[p0 : p0 + n],
                    light1[p0 : p0 + n],
                    gain[p0 : p0 + TILE],
                    dark[p0 : p0 + TILE],
                    n,
                    _I(pieces[k, LENGTH]),
                )
                for j in range(TILE):
                    s[X + j] = _I(s[X + j] + collected(s[LEVEL + j], s[CURVE + j], s[REST + j], first))
                groups = find_live(s, flags, stop, live)
                wake(s, f, live, groups, p0, number, spread[p0 : p0 + TILE], low, high)
                if count == 1 or expected(s, first, stop) >= dense * count * TILE:
                    for at in range(count):
                        if count > 1:
                            groups = find_live(s, flags, _I(first + at + 1), live)
                        while groups:
                            draw(s, f, live, groups)
                            groups = stream(s, f, live, groups, polynomial, _I(done + at))
                else:
                    while groups:
                        draw(s, f, live, groups)
                        groups = jump(s, f, live, groups, polynomial, _I(first - done))
                for j in range(TILE):
                    s[X + j] = _I(s[X + j] - s[END + j])
                done += count
            for j in range(TILE):
                left[j] = s[X + j]
                number[j] = _U(number[j] + _U(s[SPIKES + j]))
            for plane in range((frames + 7) // 8):
                word = HIGH if plane >= 4 else LOW
                shift = _U(8 * (plane & 3))
                column = plane * WIDTH + (p0 - band * WIDTH)
                of_tile = planes[column : column + TILE]
                for j in range(TILE):
                    of_tile[j] = _B(_U(s[word + j]) >> shift)
        start, words = band * (WIDTH // 8), (pixels + 7) // 8
        wide = min(WIDTH // 8, words - start)
        if packed:
            write_bits(eights, start, wide, carray(pointer_to(camera[OUT], np.uint8), (frames, words)))
        else:
            write_bytes(eights, start, wide, carray(pointer_to(camera[OUT], np.uint64), (frames, words)))
        ticket = take_ticket(tickets, share)


@njit(cache=True, nogil=True, boundscheck=False)
def unpack(packed: NDArray[np.uint8], spikes: NDArray[np.uint64]) -> None:
    """Bytes (n,) of bits, least significant first, to 0/1 in bytes: `spikes` is (n,) uint64, eight pixels to a word."""
    use_widest_vectors()
    for i in range(packed.size):
        w = _Q(packed[i])
        w = (w | (w << _Q(28))) & _Q(0x0000000F0000000F)
        w = (w | (w << _Q(14))) & _Q(0x0003000300030003)
        spikes[i] = (w | (w << _Q(7))) & _Q(0x0101010101010101)
