"""The fast engine's loop for light that is new in every frame, or every few: four frames at a time, without a root.

    x <- x - (F(k + 1) - F(k))              fires where x <= 0: then x <- x + charge of the next spike
    F(1) = (i0 + i1) >> 1                   of an interval of one frame, by `loop.ramp_of` and `collected`

The bits are those of `loop.advance`, whose rows, hash and law these are.  The charge of a spike depends on its number
alone, not on its time: so each pixel has a queue of its next charges, four at most.  Where the light of the next four
frames takes a pixel to the end of its queue, its group draws one more each.  Then all pixels pass the four frames by
selects, without a branch.  In most groups one pixel fires in every frame: a draw for each such frame would be
three times as many.  A tile in which a pixel may fire twice in a frame goes on frame by frame, as in `loop`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.np.numpy_support import carray
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.sensor.engines.compiled.loop import (
    BELL,
    CAP,
    COUNT,
    COUNTER,
    CURVE,
    DARK,
    END,
    FIRED,
    FIRST,
    FIRST_PIECE,
    FRAMES,
    GAIN,
    GOLDEN_SIGNED,
    GROUP,
    HIGH,
    INSIDE,
    LENGTH,
    LEVEL,
    LIGHT0,
    LIGHT1,
    LOW,
    OUT,
    PIXELS,
    POLYNOMIAL,
    REMAINING,
    REST,
    SCRATCH,
    SEED_HIGH,
    SEED_LOW,
    SPIKES,
    SPREAD,
    SPREAD_OF,
    STOP_PIECE,
    TILE,
    WIDTH,
    X,
    charge_of,
    collected,
    draw,
    integrate,
    stream,
    wake,
    write_bits,
    write_bytes,
)
from spikecam_env.sensor.ground.intrinsics import pointer_to, prefetch, take_ticket, use_widest_vectors
from spikecam_env.sensor.light import GRAINS

AT_ONCE = 4
"""Frames at a time, and charges of each pixel that are ready."""

_U = np.uint32
_I = np.int32
_F = np.float32
_B = np.uint8
_GRAINS = _I(GRAINS)

# Rows of a tile's scratch array beyond those of `loop`.
_READY, _REACH, _BEFORE, _LACKS, _QUEUE0, _QUEUE1, _QUEUE2, _QUEUE3, _CHARGE = (SCRATCH + r * TILE for r in range(9))
_CHARGE1, _CHARGE2, _CHARGE3 = _CHARGE + TILE, _CHARGE + 2 * TILE, _CHARGE + 3 * TILE
_SCRATCH = _CHARGE + AT_ONCE * TILE


@njit(inline="always")
def grains(light: Any, gain: Any, dark: Any) -> Any:
    """Grains of a frame in this light."""
    return _I(min(light * gain + dark, CAP) + _F(0.5))


@njit(inline="always")
def is_chain(pieces: Any, k: Any, stop: Any, known: Any) -> Any:
    """Whether the next AT_ONCE pieces are of one frame each and in a chain: each begins in the light of the last end.

    Args:
        stop: after the camera's last.
        known: address of the light of row LEVEL.
    """
    chain = k + AT_ONCE <= stop
    for piece in range(k, min(k + AT_ONCE, stop)):
        chain &= pieces[piece, LENGTH] == 1 and pieces[piece, LIGHT0] == known
        known = pieces[piece, LIGHT1]
    return chain


@njit(inline="always")
def chain(s: Any, light1: Any, light2: Any, light3: Any, light4: Any, gain: Any, dark: Any) -> Any:
    """Rows CHARGE of four such frames, and as `reach`; light1 to light4: at their ends."""
    most = _I(0)
    for j in range(len(light1)):
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
def find(s: Any, flags: Any, live: Any) -> Any:
    """List the groups in which a pixel is of row LACKS; returns their number."""
    for j in range(TILE):
        flags[j] = _B(s[_LACKS + j])
    eights = flags.view(np.uint64)
    groups: Any = 0
    for i in range(TILE // GROUP):
        go = np.uint64(0)
        for word in range(i * (GROUP // 8), (i + 1) * (GROUP // 8)):
            go |= eights[word]
        live[groups] = i * GROUP
        groups += _I(go != np.uint64(0))
    return groups


@njit(inline="always")
def fill(s: Any, f: Any, live: Any, groups: Any, polynomial: Any) -> Any:
    """Put a charge, of `draw`, at the end of every queue that is not full; returns how many groups lack more."""
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
    """As `loop.advance`, with the same bits; `dense` is not used."""
    use_widest_vectors()
    room = np.empty(_SCRATCH + 16, np.int32)
    begin = (-room.ctypes.data % 64) // 4
    s = room[begin : begin + _SCRATCH]
    f = s.view(np.float32)
    live = np.empty(TILE // GROUP + 1, np.int64)
    asleep = np.empty(TILE // GROUP + 1, np.int64)
    awake = np.empty(TILE // GROUP, np.int64)
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
            gains, darks, spreads = gain[p0 : p0 + TILE], dark[p0 : p0 + TILE], spread[p0 : p0 + TILE]
            for j in range(TILE):
                s[X + j] = left[j]
                s[_REACH + j] = left[j]
                s[SPIKES + j] = 0
                s[LOW + j] = 0
                s[HIGH + j] = 0
                s[_READY + j] = 0
            for i in range(TILE // GROUP):
                awake[i] = 0
            k = camera[FIRST_PIECE]
            at = pieces[k, FIRST]
            known = np.int64(0)
            calm = True
            for done in range(0, frames, AT_ONCE):
                calm &= done + AT_ONCE <= frames
                for soon in range(k + AT_ONCE, min(k + 2 * AT_ONCE, camera[STOP_PIECE])):
                    for line in range(4 * p0, 4 * (p0 + n), 64):
                        prefetch(pieces[soon, LIGHT1] + line)
                if calm and is_chain(pieces, k, camera[STOP_PIECE], known):
                    light1 = carray(pointer_to(pieces[k, LIGHT1], np.float32), (pixels,))[p0 : p0 + n]
                    light2 = carray(pointer_to(pieces[k + 1, LIGHT1], np.float32), (pixels,))[p0 : p0 + n]
                    light3 = carray(pointer_to(pieces[k + 2, LIGHT1], np.float32), (pixels,))[p0 : p0 + n]
                    light4 = carray(pointer_to(pieces[k + 3, LIGHT1], np.float32), (pixels,))[p0 : p0 + n]
                    calm = chain(s, light1, light2, light3, light4, gains, darks) < _GRAINS
                    known = pieces[k + AT_ONCE - 1, LIGHT1]
                    k = min(k + AT_ONCE, camera[STOP_PIECE] - 1)
                    at = pieces[k, FIRST]
                else:
                    for u in range(AT_ONCE):
                        charge = s[_CHARGE + u * TILE : _CHARGE + (u + 1) * TILE]
                        if done + u == frames:
                            break
                        light0 = carray(pointer_to(pieces[k, LIGHT0], np.float32), (pixels,))[p0 : p0 + n]
                        light1 = carray(pointer_to(pieces[k, LIGHT1], np.float32), (pixels,))[p0 : p0 + n]
                        charge[n:] = 0
                        if pieces[k, LENGTH] == 1:
                            if pieces[k, LIGHT0] != known:
                                for j in range(n):
                                    s[LEVEL + j] = grains(light0[j], gains[j], darks[j])
                            for j in range(n):
                                i1 = grains(light1[j], gains[j], darks[j])
                                charge[j] = _I(_I(s[LEVEL + j] + i1) >> _I(1))
                                s[LEVEL + j] = i1
                            known = pieces[k, LIGHT1]
                        else:
                            if (done == 0 and u == 0) or at == pieces[k, FIRST]:
                                integrate(s, light0, light1, gains, darks, n, _I(pieces[k, LENGTH]))
                            for j in range(n):
                                a, b, d = s[LEVEL + j], s[CURVE + j], s[REST + j]
                                charge[j] = _I(collected(a, b, d, _I(at + 1)) - collected(a, b, d, _I(at)))
                            known = 0
                        at += 1
                        if at == pieces[k, FIRST] + pieces[k, COUNT] and k + 1 < camera[STOP_PIECE]:
                            k += 1
                            at = pieces[k, FIRST]
                    if calm:
                        calm = reach(s) < _GRAINS
                if calm:
                    groups = find(s, flags, live)
                    sleepers: Any = 0
                    for i in range(groups):
                        q = live[i]
                        asleep[sleepers] = q
                        sleepers += 1 - awake[q // GROUP]
                        awake[q // GROUP] = 1
                    wake(s, f, asleep, sleepers, p0, number, spreads, low, high)
                    while groups:
                        draw(s, f, live, groups)
                        groups = fill(s, f, live, groups, polynomial)
                    word = HIGH if done >= 32 else LOW
                    bit = _I(done & 31)
                    calm = pass_frames(s, bit, word)
                    if not calm:
                        undo_frames(s, bit, word)
                if not calm:
                    for u in range(min(AT_ONCE, frames - done)):
                        for j in range(TILE):
                            s[END + j] = s[_CHARGE + u * TILE + j]
                            s[_LACKS + j] = _I(s[X + j] <= s[END + j])
                        groups = find(s, flags, live)
                        wake(s, f, live, groups, p0, number, spreads, low, high)
                        while groups:
                            draw(s, f, live, groups)
                            groups = stream(s, f, live, groups, polynomial, _I(done + u))
                        for j in range(TILE):
                            s[X + j] = _I(s[X + j] - s[END + j])
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
