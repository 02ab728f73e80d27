"""A tile of pixels of the fast engine: its scratch, the law of its charge, and the stages that both of its loops use.

    F(k) = i0 k + B k^2 + r k^2 / 2n                    grains collected before frame k (`light`, exact integers)
    next spike: smallest k with F(k) >= x               x: grains at which the pixel fires, counted from the key
    x <- x + GRAINS (1 + s z)                           s: relative spread of the threshold, z: standardised draw

z is a polynomial (`quantile`) of a sum of eight bytes hashed from (seed, pixel, spike number): no generator has a
state, so neither chunks nor threads, nor the choice between the loops, change a draw.

Stages are short and go over the live groups of pixels, with results in a tile's scratch.  A processor looks some
hundred instructions ahead, and finds more to do at once in many short chains than in a few long ones (a third faster).

No fastmath: bits must not depend on the machine.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.np.numpy_support import carray
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.sensor.ground.draws import GOLDEN, bell_of, first_key, scramble, second_key
from spikecam_env.sensor.ground.intrinsics import pointer_to
from spikecam_env.sensor.light import GRAINS, MAX_GRAINS_PER_FRAME, MAX_SEGMENT
from spikecam_env.types import Floats, Pictures

TILE = 256
"""Pixels worked on between reading and writing memory; state arrays are padded to whole tiles."""


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

# Columns of a table of pieces: addresses of the light at both ends of a key interval, then which frames of it.
PIECE_COLUMNS = 5
LIGHT0, LIGHT1, LENGTH, FIRST, COUNT = range(5)


class TileScratch(NamedTuple):
    """Room of a thread for a tile: rows as above."""

    s: NDArray[np.int32]
    f: Pictures
    """The same as float32."""
    flags: NDArray[np.uint8]
    live: NDArray[np.int64]
    """First pixels of the groups that a stage is for."""
    asleep: NDArray[np.int64]
    """Likewise, of those without keys yet."""
    awake: NDArray[np.int64]
    """Whether a group has its keys."""


class TileLaw(NamedTuple):
    """Numbers of a tile's pixels (TILE,), and of their camera."""

    gain: Pictures
    dark: Pictures
    spread: Pictures
    """[grains], as gain and dark, which are a frame's."""
    fired: NDArray[np.uint32]
    """Spikes before this call."""
    polynomial: tuple[np.float32, ...]
    seed_low: np.uint32
    seed_high: np.uint32
    first: int
    """Number of the tile's first pixel."""


class TileLight(NamedTuple):
    """Light of a tile: rows of the table of pieces."""

    pieces: NDArray[np.int64]
    begin: int
    stop: int
    """Row after the last."""
    pixels: int
    """Of a whole picture."""
    first: int
    """Number of the tile's first pixel."""
    used: int
    """Pixels of the tile that a picture has."""


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
            row[p] = np.int32(np.int32(level[p] + np.int32(curve[p] * np.int32(s1 - s0))) + bend) * (1.0 / GRAINS)


@njit(inline="always")
def integrate(s: Any, law: Any, light: Any, k: Any) -> None:
    """Rows LEVEL, CURVE, REST of a tile in piece k of its light (`light.ramp`); none beyond the picture."""
    light0, light1 = light_at(light, light.pieces[k, LIGHT0]), light_at(light, light.pieces[k, LIGHT1])
    gain, dark, n, length = law.gain, law.dark, light.used, _I(light.pieces[k, LENGTH])
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
def find_live(work: Any, end: Any) -> Any:
    """Fill row END with F(end); list the groups in which a pixel fires before; returns their number."""
    s, flags = work.s, work.flags
    for j in range(TILE):
        s[END + j] = collected(s[LEVEL + j], s[CURVE + j], s[REST + j], end)
        flags[j] = _B(s[X + j] <= s[END + j])
    return list_flagged(work)


@njit(inline="always")
def list_flagged(work: Any) -> Any:
    """List the groups in which a pixel has a flag; returns their number."""
    live, eights = work.live, work.flags.view(np.uint64)
    groups: Any = 0
    for i in range(TILE // GROUP):
        go = _Q(0)
        for word in range(i * (GROUP // 8), (i + 1) * (GROUP // 8)):
            go |= eights[word]
        live[groups] = i * GROUP
        groups += _I(go != _Q(0))
    return groups


@njit(inline="always")
def wake(work: Any, live: Any, groups: Any, law: Any) -> None:
    """Rows COUNTER, KEY, SPREAD of groups."""
    s, f, fired, spread = work.s, work.f, law.fired, law.spread
    for i in range(groups):
        q = live[i] & INSIDE
        for j in range(q, q + GROUP):
            key = first_key(law.first + j, law.seed_low)
            s[COUNTER + j] = _I(_U(key + _U(_U(fired[j] + _U(s[SPIKES + j])) * GOLDEN)))
            s[KEY + j] = _I(second_key(key, law.seed_high))
            f[SPREAD + j] = spread[j]


@njit(inline="always")
def draw(work: Any, groups: Any) -> None:
    """Row BELL of the live groups: the draw of each pixel's next spike."""
    s, f, live = work.s, work.f, work.live
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
def stream(work: Any, groups: Any, polynomial: Any, at: Any) -> Any:
    """Let each live pixel fire in the frame of bit `at`; returns how many groups stay live."""
    s, f, live = work.s, work.f, work.live
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
def light_at(light: Any, address: Any) -> Any:
    """Light of a tile's pixels, in the picture at an address."""
    return carray(pointer_to(address, np.float32), (light.pixels,))[light.first : light.first + light.used]
