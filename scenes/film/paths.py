"""Paths of the points of two pictures, from the motion that a simulator gives with each.

to_next      m(x): from here to the next picture                 c = m0(x)            b = (m1(y) - m0(x)) / 2
since_last   m(y): from the last picture to here                 c = m1(y)            b = (m1(y) - m0(x)) / 2
per_second   v(x): velocity at the picture's time                c = T (v0 + v1) / 2  b = T (v1 - v0) / 2

x in the earlier picture and y = x + c in the later one are the same point.  A point that only one of them sees keeps
its own motion: c = m, b = 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from spikecam_env.compiled import njit
from spikecam_env.types import Pictures
from scenes.film.along_motion import SAME_SURFACE

MOTIONS = ("to_next", "since_last", "per_second")
MATCHED = 0.5
"""Distance [pixels] at which the path of a point there ends here: the two are the same."""
ROUNDS = 4


def paths(motion0, motion1, near0, near1, kind: str):
    """Chords and bends of both pictures' points; motion in pixels over the interval."""
    out = [np.empty_like(motion0) for _ in range(4)]
    code = MOTIONS.index(kind)
    # share of own and other motion in the chord
    own0, own1 = {"to_next": (1.0, 0.0), "since_last": (0.0, 1.0), "per_second": (0.5, 0.5)}[kind]
    _pair(motion0, motion1, near0, near1, np.float32(own0), np.float32(own1), np.float32(1), out[0], out[1])
    _pair(motion1, motion0, near1, near0, np.float32(own1), np.float32(own0), np.float32(-1), out[2], out[3])
    return out


@njit(nogil=True, cache=True, error_model="numpy")
def _pair(mine: Pictures, theirs: Pictures, near: Pictures, their_near: Pictures, w: Any, v: Any, sign: Any, chord: Pictures, bend: Pictures) -> None:
    rows, columns = near.shape
    zero, half = np.float32(0), np.float32(0.5)
    for r in range(rows):
        for c in range(columns):
            mx, my = mine[r, c, 0], mine[r, c, 1]
            cx, cy = sign * mx, sign * my
            ox, oy = mx, my
            found = False
            for _ in range(ROUNDS):
                x, y = np.float32(c) + cx, np.float32(r) + cy
                u, q = int(np.round(x)), int(np.round(y))
                if not (0 <= u < columns and 0 <= q < rows):
                    found = False
                    break
                n = their_near[q, u]
                if n > near[r, c] * np.float32(1 + SAME_SURFACE) or near[r, c] > n * np.float32(1 + SAME_SURFACE):
                    found = False
                    break
                # bilinear
                left, top = int(np.floor(x)), int(np.floor(y))
                ox = oy = zero
                for i in range(top, top + 2):
                    for j in range(left, left + 2):
                        weight = (np.float32(1) - abs(x - np.float32(j))) * (np.float32(1) - abs(y - np.float32(i)))
                        a, b = i, j
                        if not (0 <= i < rows and 0 <= j < columns) or their_near[i, j] > n * np.float32(1 + SAME_SURFACE) or n > their_near[i, j] * np.float32(1 + SAME_SURFACE):
                            a, b = q, u
                        ox += weight * theirs[a, b, 0]
                        oy += weight * theirs[a, b, 1]
                nx, ny = sign * (w * mx + v * ox), sign * (w * my + v * oy)
                found = abs(nx - cx) < MATCHED and abs(ny - cy) < MATCHED
                cx, cy = nx, ny
            if found:
                chord[r, c, 0], chord[r, c, 1] = cx, cy
                bend[r, c, 0], bend[r, c, 1] = sign * half * (ox - mx), sign * half * (oy - my)
            else:
                chord[r, c, 0], chord[r, c, 1] = sign * mx, sign * my
                bend[r, c, 0] = bend[r, c, 1] = zero


@njit(nogil=True, cache=True, error_model="numpy")
def with_outlines(motion: Pictures, near: Pictures) -> Any:
    rows, columns = near.shape
    m, n = motion.copy(), near.copy()
    for r in range(rows):
        for c in range(columns):
            best = near[r, c] * np.float32(1 + SAME_SURFACE)
            for i in range(max(r - 1, 0), min(r + 2, rows)):
                for j in range(max(c - 1, 0), min(c + 2, columns)):
                    if near[i, j] > best:
                        best = near[i, j]
                        n[r, c] = near[i, j]
                        m[r, c] = motion[i, j]
    return m, n
