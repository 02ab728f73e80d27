"""The fast engine's loop for light that is new in every frame, or every few: four frames at a time, without a root.

    x <- x - (F(k + 1) - F(k))              fires where x <= 0: then x <- x + charge of the next spike
    F(1) = (i0 + i1) >> 1                   of an interval of one frame, by `tile.ramp_of` and `collected`

The bits are those of `spike_to_spike`.  The charge of a spike depends on its number alone, not on its time: so each
pixel has a queue of its next charges, four at most.  Where the light of the next four frames takes a pixel to the end
of its queue, its group draws one more each.  Then all pixels pass the four frames by selects, without a branch.  In
most groups one pixel fires in every frame: a draw for each such frame would be three times as many.  A tile in which a
pixel may fire twice in a frame goes on frame by frame.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from spikecam_env.compiled import njit
from spikecam_env.sensor.engines.compiled.tile import (
    BELL,
    CAP,
    COUNT,
    COUNTER,
    CURVE,
    END,
    FIRST,
    GOLDEN_SIGNED,
    GROUP,
    HIGH,
    INSIDE,
    LENGTH,
    LEVEL,
    LIGHT0,
    LIGHT1,
    LOW,
    REST,
    SCRATCH,
    SPIKES,
    SPREAD,
    TILE,
    TileLaw,
    TileLight,
    TileScratch,
    X,
    charge_of,
    collected,
    draw,
    integrate,
    light_at,
    list_flagged,
    stream,
    wake,
)
from spikecam_env.sensor.ground.intrinsics import prefetch
from spikecam_env.sensor.light import GRAINS

AT_ONCE = 4
"""Frames at a time, and charges of each pixel that are ready."""

_I = np.int32
_F = np.float32
_B = np.uint8
_GRAINS = _I(GRAINS)

# Rows of a tile's scratch array beyond those of `tile`.
_READY, _REACH, _BEFORE, _LACKS, _QUEUE0, _QUEUE1, _QUEUE2, _QUEUE3, _CHARGE = (SCRATCH + r * TILE for r in range(9))
_CHARGE1, _CHARGE2, _CHARGE3 = _CHARGE + TILE, _CHARGE + 2 * TILE, _CHARGE + 3 * TILE
LONGEST_SCRATCH = _CHARGE + AT_ONCE * TILE


@njit(inline="always")
def pass_frame_by_frame(work: TileScratch, law: TileLaw, light: TileLight, frames: int, dense: float) -> None:
    """As `pass_from_spike_to_spike`, with the same bits; `dense` is not used."""
    s = work.s
    for j in range(TILE):
        s[_REACH + j] = s[X + j]
        s[_READY + j] = 0
    work.awake[:] = 0
    k, known, calm = light.begin, np.int64(0), True
    at = light.pieces[k, FIRST]
    for done in range(0, frames, AT_ONCE):
        calm &= done + AT_ONCE <= frames
        prefetch_light(light, k)
        if calm and is_chain(light, k, known):
            calm = chain(s, law, light, k) < _GRAINS
            known = light.pieces[k + AT_ONCE - 1, LIGHT1]
            k = min(k + AT_ONCE, light.stop - 1)
            at = light.pieces[k, FIRST]
        else:
            for u in range(min(AT_ONCE, frames - done)):
                known = read_frame(s, law, light, k, at, known, done + u == 0, u)
                k, at = next_frame(light, k, at)
            if calm:
                calm = reach(s) < _GRAINS
        if calm:
            fill_queues(work, law)
            word = HIGH if done >= 32 else LOW
            calm = pass_frames(s, _I(done & 31), word)
            if not calm:
                undo_frames(s, _I(done & 31), word)
        if not calm:
            pass_singly(work, law, done, min(AT_ONCE, frames - done))


@njit(inline="always")
def grains(light: Any, gain: Any, dark: Any) -> Any:
    """Grains of a frame in this light."""
    return _I(min(light * gain + dark, CAP) + _F(0.5))


@njit(inline="always")
def prefetch_light(light: Any, k: Any) -> None:
    """Ask for the light of the four pieces after the next four."""
    for soon in range(k + AT_ONCE, min(k + 2 * AT_ONCE, light.stop)):
        for line in range(4 * light.first, 4 * (light.first + light.used), 64):
            prefetch(light.pieces[soon, LIGHT1] + line)


@njit(inline="always")
def next_frame(light: Any, k: Any, at: Any) -> Any:
    """Piece and frame after frame `at` of piece k; the last piece goes on."""
    at += 1
    if at == light.pieces[k, FIRST] + light.pieces[k, COUNT] and k + 1 < light.stop:
        k += 1
        at = light.pieces[k, FIRST]
    return k, at


@njit(inline="always")
def is_chain(light: Any, k: Any, known: Any) -> Any:
    """Whether the next AT_ONCE pieces are of one frame each and in a chain: each begins in the light of the last end.

    Args:
        known: address of the light of row LEVEL.
    """
    chain = k + AT_ONCE <= light.stop
    for piece in range(k, min(k + AT_ONCE, light.stop)):
        chain &= light.pieces[piece, LENGTH] == 1 and light.pieces[piece, LIGHT0] == known
        known = light.pieces[piece, LIGHT1]
    return chain


@njit(inline="always")
def chain(s: Any, law: Any, light: Any, k: Any) -> Any:
    """Rows CHARGE of four such frames from piece k on, and as `reach`."""
    light1, light2 = light_at(light, light.pieces[k, LIGHT1]), light_at(light, light.pieces[k + 1, LIGHT1])
    light3, light4 = light_at(light, light.pieces[k + 2, LIGHT1]), light_at(light, light.pieces[k + 3, LIGHT1])
    gain, dark = law.gain, law.dark
    most = _I(0)
    for j in range(light.used):
        i0 = s[LEVEL + j]
        i1, i2 = grains(light1[j], gain[j], dark[j]), grains(light2[j], gain[j], dark[j])
        i3, i4 = grains(light3[j], gain[j], dark[j]), grains(light4[j], gain[j], dark[j])
        s[LEVEL + j] = i4
        c0, c1, c2, c3 = (
            _I(_I(i0 + i1) >> _I(1)),
            _I(_I(i1 + i2) >> _I(1)),
            _I(_I(i2 + i3) >> _I(1)),
            _I(_I(i3 + i4) >> _I(1)),
        )
        s[_CHARGE + j], s[_CHARGE1 + j], s[_CHARGE2 + j], s[_CHARGE3 + j] = c0, c1, c2, c3
        left = _I(s[_REACH + j] - _I(_I(c0 + c1) + _I(c2 + c3)))
        s[_REACH + j] = left
        s[_LACKS + j] = _I(left <= _I(0))
        most = max(most, max(max(c0, c1), max(c2, c3)))
    return most


@njit(inline="always")
def read_frame(s: Any, law: Any, light: Any, k: Any, at: Any, known: Any, begins: Any, u: Any) -> Any:
    """Row CHARGE of the u-th of four frames, which is frame `at` of piece k.

    Args:
        known: address of the light of row LEVEL, 0 if it has another.
        begins: whether it is the first of a call, so that no row is of this piece yet.

    Returns:
        The address of the light of row LEVEL.
    """
    gain, dark = law.gain, law.dark
    charge = s[_CHARGE + u * TILE : _CHARGE + (u + 1) * TILE]
    charge[light.used :] = 0
    if light.pieces[k, LENGTH] == 1:
        light0, light1 = light_at(light, light.pieces[k, LIGHT0]), light_at(light, light.pieces[k, LIGHT1])
        if light.pieces[k, LIGHT0] != known:
            for j in range(light.used):
                s[LEVEL + j] = grains(light0[j], gain[j], dark[j])
        for j in range(light.used):
            i1 = grains(light1[j], gain[j], dark[j])
            charge[j] = _I(_I(s[LEVEL + j] + i1) >> _I(1))
            s[LEVEL + j] = i1
        return light.pieces[k, LIGHT1]
    if begins or at == light.pieces[k, FIRST]:
        integrate(s, law, light, k)
    for j in range(light.used):
        a, b, d = s[LEVEL + j], s[CURVE + j], s[REST + j]
        charge[j] = _I(collected(a, b, d, _I(at + 1)) - collected(a, b, d, _I(at)))
    return np.int64(0)


@njit(inline="always")
def reach(s: Any) -> Any:
    """Rows REACH, the queued charge less that of four frames, and LACKS, whether none is left.

    Returns:
        The most charge of a frame.
    """
    most = _I(0)
    for j in range(TILE):
        c0, c1, c2, c3 = s[_CHARGE + j], s[_CHARGE1 + j], s[_CHARGE2 + j], s[_CHARGE3 + j]
        left = _I(s[_REACH + j] - _I(_I(c0 + c1) + _I(c2 + c3)))
        s[_REACH + j] = left
        s[_LACKS + j] = _I(left <= _I(0))
        most = max(most, max(max(c0, c1), max(c2, c3)))
    return most


@njit(inline="always")
def find_lacking(work: Any) -> Any:
    """List the groups in which a pixel is of row LACKS; returns their number."""
    s, flags = work.s, work.flags
    for j in range(TILE):
        flags[j] = _B(s[_LACKS + j])
    return list_flagged(work)


@njit(inline="always")
def fill_queues(work: Any, law: Any) -> None:
    """Draw charges until the queues reach beyond the next four frames."""
    groups = find_lacking(work)
    sleepers: Any = 0
    for i in range(groups):
        q = work.live[i]
        work.asleep[sleepers] = q
        sleepers += 1 - work.awake[q // GROUP]
        work.awake[q // GROUP] = 1
    wake(work, work.asleep, sleepers, law)
    while groups:
        draw(work, groups)
        groups = fill(work, groups, law.polynomial)


@njit(inline="always")
def fill(work: Any, groups: Any, polynomial: Any) -> Any:
    """Put a charge, of `draw`, at the end of every queue that is not full; returns how many groups lack more."""
    s, f, live = work.s, work.f, work.live
    still: Any = 0
    for i in range(groups):
        q = live[i] & INSIDE
        go = _I(0)
        for j in range(q, q + GROUP):
            charge = charge_of(f[BELL + j], f[SPREAD + j], polynomial)
            ready = s[_READY + j]
            at0, at1 = _I(-_I(ready == _I(0))), _I(-_I(ready == _I(1)))
            at2, at3 = _I(-_I(ready == _I(2))), _I(-_I(ready == _I(3)))
            q0, q1, q2, q3 = s[_QUEUE0 + j], s[_QUEUE1 + j], s[_QUEUE2 + j], s[_QUEUE3 + j]
            s[_QUEUE0 + j] = _I(q0 ^ _I(_I(q0 ^ charge) & at0))
            s[_QUEUE1 + j] = _I(q1 ^ _I(_I(q1 ^ charge) & at1))
            s[_QUEUE2 + j] = _I(q2 ^ _I(_I(q2 ^ charge) & at2))
            s[_QUEUE3 + j] = _I(q3 ^ _I(_I(q3 ^ charge) & at3))
            active = _I(-_I(ready < _I(AT_ONCE)))
            s[COUNTER + j] = _I(s[COUNTER + j] + _I(GOLDEN_SIGNED & active))
            s[_READY + j] = _I(ready - active)
            left = _I(s[_REACH + j] + _I(charge & active))
            s[_REACH + j] = left
            go = _I(go | _I(_I(left <= _I(0)) & _I(ready < _I(AT_ONCE - 1))))
        live[still] = q
        still += go
    return still


@njit(inline="always")
def pass_frames(s: Any, bit: Any, word: Any) -> Any:
    """Pass four frames of all pixels: rows X, READY, SPIKES, and bits from `bit` on of row `word`.

    Returns:
        Whether no pixel fired twice in a frame.
    """
    least = _I(1)
    for j in range(TILE):
        x = s[X + j]
        s[_BEFORE + j] = x
        q0, q1, q2, q3 = s[_QUEUE0 + j], s[_QUEUE1 + j], s[_QUEUE2 + j], s[_QUEUE3 + j]
        x = _I(x - s[_CHARGE + j])
        a0 = _I(-_I(x <= _I(0)))
        x = _I(x + _I(q0 & a0))
        least = min(least, x)
        q0 = _I(q0 ^ _I(_I(q0 ^ q1) & a0))
        q1 = _I(q1 ^ _I(_I(q1 ^ q2) & a0))
        q2 = _I(q2 ^ _I(_I(q2 ^ q3) & a0))
        x = _I(x - s[_CHARGE1 + j])
        a1 = _I(-_I(x <= _I(0)))
        x = _I(x + _I(q0 & a1))
        least = min(least, x)
        q0 = _I(q0 ^ _I(_I(q0 ^ q1) & a1))
        q1 = _I(q1 ^ _I(_I(q1 ^ q2) & a1))
        q2 = _I(q2 ^ _I(_I(q2 ^ q3) & a1))
        x = _I(x - s[_CHARGE2 + j])
        a2 = _I(-_I(x <= _I(0)))
        x = _I(x + _I(q0 & a2))
        least = min(least, x)
        q0 = _I(q0 ^ _I(_I(q0 ^ q1) & a2))
        q1 = _I(q1 ^ _I(_I(q1 ^ q2) & a2))
        q2 = _I(q2 ^ _I(_I(q2 ^ q3) & a2))
        x = _I(x - s[_CHARGE3 + j])
        a3 = _I(-_I(x <= _I(0)))
        x = _I(x + _I(q0 & a3))
        least = min(least, x)
        s[_QUEUE0 + j] = _I(q0 ^ _I(_I(q0 ^ q1) & a3))
        s[_QUEUE1 + j] = _I(q1 ^ _I(_I(q1 ^ q2) & a3))
        s[_QUEUE2 + j] = _I(q2 ^ _I(_I(q2 ^ q3) & a3))
        s[X + j] = x
        taken = _I(_I(a0 + a1) + _I(a2 + a3))
        s[_READY + j] = _I(s[_READY + j] + taken)
        s[SPIKES + j] = _I(s[SPIKES + j] - taken)
        bits = _I(_I(_I(a0 & _I(1)) | _I(a1 & _I(2))) | _I(_I(a2 & _I(4)) | _I(a3 & _I(8))))
        s[word + j] = _I(s[word + j] | _I(bits << bit))
    return least > _I(0)


@njit(inline="always")
def undo_frames(s: Any, bit: Any, word: Any) -> None:
    """Restore rows X, SPIKES and the bits from before `pass_frames`."""
    for j in range(TILE):
        s[X + j] = s[_BEFORE + j]
        bits = _I(s[word + j] >> bit)
        s[SPIKES + j] = _I(
            s[SPIKES + j]
            - _I(
                _I(_I(bits & _I(1)) + _I(_I(bits >> _I(1)) & _I(1)))
                + _I(_I(_I(bits >> _I(2)) & _I(1)) + _I(_I(bits >> _I(3)) & _I(1)))
            )
        )
        s[word + j] = _I(s[word + j] & _I(~_I(_I(15) << bit)))


@njit(inline="always")
def pass_singly(work: Any, law: Any, done: Any, count: Any) -> None:
    """Pass frames whose charge is in rows CHARGE one after another: pixels may fire twice in one."""
    s = work.s
    for u in range(count):
        for j in range(TILE):
            s[END + j] = s[_CHARGE + u * TILE + j]
            s[_LACKS + j] = _I(s[X + j] <= s[END + j])
        groups = find_lacking(work)
        wake(work, work.live, groups, law)
        while groups:
            draw(work, groups)
            groups = stream(work, groups, law.polynomial, _I(done + u))
        for j in range(TILE):
            s[X + j] = _I(s[X + j] - s[END + j])
