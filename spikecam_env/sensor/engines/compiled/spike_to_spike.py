"""The fast engine's loop from spike to spike, and frame by frame where most pixels fire in most frames.

Jumping, the frame k of a spike is the root of the quadratic F(k) = x (`tile`) in float32, rounded; the integers then
decide on which side of it the crossing lies, so the bits are those of the frame-by-frame sum.  Streaming (`dense`), one
frame at a time is compared: cheaper where most pixels fire in most frames, and for a single frame.

Spikes are served in rounds, one spike of each pixel that has one to come.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from spikecam_env.compiled import njit
from spikecam_env.sensor.engines.compiled.tile import (
    BELL,
    COUNT,
    CURVE,
    DRAW,
    END,
    FIRST,
    FRAME,
    GROUP,
    INSIDE,
    LEVEL,
    REST,
    SPREAD,
    TILE,
    TileLaw,
    TileLight,
    TileScratch,
    X,
    charge_of,
    collected,
    draw,
    find_live,
    integrate,
    nearest_frame,
    reset,
    stream,
    wake,
)
from spikecam_env.sensor.light import GRAINS

_I = np.int32
_F = np.float32
_GRAINS = _F(GRAINS)


@njit(inline="always")
def pass_from_spike_to_spike(work: TileScratch, law: TileLaw, light: TileLight, frames: int, dense: float) -> None:
    """Pass all frames of a tile's light: rows X, SPIKES, LOW, HIGH.

    Args:
        frames: not used; the pieces say as much.
        dense: expected spikes a pixel and frame above which pixels are streamed.
    """
    s = work.s
    done: Any = 0
    for k in range(light.begin, light.stop):
        first, count = _I(light.pieces[k, FIRST]), _I(light.pieces[k, COUNT])
        stop = _I(first + count)
        integrate(s, law, light, k)
        for j in range(TILE):
            s[X + j] = _I(s[X + j] + collected(s[LEVEL + j], s[CURVE + j], s[REST + j], first))
        groups = find_live(work, stop)
        wake(work, work.live, groups, law)
        if count == 1 or expected(s, first, stop) >= dense * count * TILE:
            for at in range(count):
                if count > 1:
                    groups = find_live(work, _I(first + at + 1))
                while groups:
                    draw(work, groups)
                    groups = stream(work, groups, law.polynomial, _I(done + at))
        else:
            while groups:
                draw(work, groups)
                groups = jump(work, groups, law.polynomial, _I(first - done))
        for j in range(TILE):
            s[X + j] = _I(s[X + j] - s[END + j])
        done += count


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
def jump(work: Any, groups: Any, polynomial: Any, first: Any) -> Any:
    """Let each live pixel fire in the frame of its crossing; returns how many groups stay live.

    Args:
        first: frame of the key interval of bit 0.
    """
    s, f, live = work.s, work.f, work.live
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
