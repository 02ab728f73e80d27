"""Light between two pictures, carried along the motion of the points seen in them.

A point seen at pixel x of a picture has moved, a share t of the time to the other picture later, by

    d(t) = t c - t (1 - t) b                c: chord, to its place in the other picture; b: bend, half its change

an exact law for steady acceleration.  Both pictures are carried to the instant, each from its own time, and blended by
time.  Points that come to one place are ordered by nearness (1 / depth): the nearer one is seen, in a picture and of
both.  A place that one picture has no point for is seen in the other.

A pixel on an outline mixes two surfaces.  It moves with the nearer one, `with_outlines`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.types import Pictures

SAME_SURFACE = 0.03
"""Share by which the nearness of points on one surface differs from pixel to pixel at most: a plane seen at 85 degrees
from its normal by a lens of a focal length of 400 pixels."""

REACH = 0.75
"""Distance [pixels], in x and y, at which a point still covers a pixel's centre: surfaces that grow by up to a half
between two pictures have no holes."""

REFINEMENTS = 2
"""Steps of the search for the point that comes to a pixel's centre."""

NONE = -1
"""Number of the point where none comes."""


class Side(NamedTuple):
    """A picture and the paths of its points to another one."""

    picture: Pictures
    """(H, W)."""
    chord: Pictures
    """(H, W, 2), x then y [pixels]."""
    bend: Pictures
    """(H, W, 2) [pixels]."""
    near: Pictures
    """(H, W), 1 / depth; equal where depth is unknown."""


def carried(before: Side, after: Side, share: float, picture: Pictures) -> None:
    """Write the light at `share` of the time from one picture to the other into `picture` (H, W)."""
    _lay(*before, *after, np.float32(share), picture)


@njit(nogil=True, cache=True, error_model="numpy")
def _lay(
    picture0: Pictures,
    chord0: Pictures,
    bend0: Pictures,
    near0: Pictures,
    picture1: Pictures,
    chord1: Pictures,
    bend1: Pictures,
    near1: Pictures,
    share: Any,
    out: Pictures,
) -> None:
    """See `carried`."""
    rows, columns = out.shape
    shift0, shift1 = np.empty_like(chord0), np.empty_like(chord1)
    point0, point1 = np.empty(out.shape, np.int32), np.empty(out.shape, np.int32)
    _move(chord0, bend0, share, shift0)
    _move(chord1, bend1, np.float32(1) - share, shift1)
    _arrive(shift0, near0, point0)
    _arrive(shift1, near1, point1)
    one, margin = np.float32(1), np.float32(1 + SAME_SURFACE)
    for row in range(rows):
        for column in range(columns):
            p0, p1 = point0[row, column], point1[row, column]
            weight = share
            if p0 == NONE and p1 == NONE:
                out[row, column] = (one - share) * picture0[row, column] + share * picture1[row, column]
                continue
            if p0 == NONE:
                weight = one
            elif p1 == NONE:
                weight = np.float32(0)
            else:
                n0, n1 = near0[p0 // columns, p0 % columns], near1[p1 // columns, p1 % columns]
                if n0 > n1 * margin:
                    weight = np.float32(0)
                elif n1 > n0 * margin:
                    weight = one
            light = np.float32(0)
            if weight < one:
                light += (one - weight) * _seen(picture0, shift0, near0, p0, row, column)
            if weight > 0:
                light += weight * _seen(picture1, shift1, near1, p1, row, column)
            out[row, column] = light


@njit(nogil=True, cache=True, error_model="numpy")
def _move(chord: Pictures, bend: Pictures, t: Any, shift: Pictures) -> None:
    """shift (H, W, 2): the law of the module at t."""
    bow = t * (np.float32(1) - t)
    for row in range(chord.shape[0]):
        for column in range(chord.shape[1]):
            for axis in range(2):
                shift[row, column, axis] = t * chord[row, column, axis] - bow * bend[row, column, axis]


@njit(nogil=True, cache=True, error_model="numpy")
def _arrive(shift: Pictures, near: Pictures, point: NDArray[np.int32]) -> None:
    """point (H, W): number of the point that is seen at each pixel, the nearest, of one surface the closest."""
    rows, columns = near.shape
    reach, margin = np.float32(REACH), np.float32(1 + SAME_SURFACE)
    distance = np.empty(near.shape, np.float32)
    point[:] = NONE
    for row in range(rows):
        for column in range(columns):
            x, y = np.float32(column) + shift[row, column, 0], np.float32(row) + shift[row, column, 1]
            left, right = max(int(np.ceil(x - reach)), 0), min(int(np.floor(x + reach)), columns - 1)
            top, bottom = max(int(np.ceil(y - reach)), 0), min(int(np.floor(y + reach)), rows - 1)
            mine = near[row, column]
            for v in range(top, bottom + 1):
                for u in range(left, right + 1):
                    away = (u - x) ** 2 + (v - y) ** 2
                    there = point[v, u]
                    if there != NONE:
                        theirs = near[there // columns, there % columns]
                        if theirs > mine * margin or (mine <= theirs * margin and distance[v, u] <= away):
                            continue
                    point[v, u] = row * columns + column
                    distance[v, u] = away


@njit(inline="always")
def _seen(picture: Pictures, shift: Pictures, near: Pictures, point: Any, row: Any, column: Any) -> Any:
    """Light of the place of the picture that comes to a pixel's centre; `point` is the pixel of it next to there."""
    rows, columns = picture.shape
    r, c = point // columns, point % columns
    x, y = np.float32(column) - shift[r, c, 0], np.float32(row) - shift[r, c, 1]
    for _ in range(REFINEMENTS):
        across, down = _shift_at(shift, near, r, c, x, y)
        x, y = np.float32(column) - across, np.float32(row) - down
    return _light_at(picture, x, y)


@njit(inline="always")
def _shift_at(shift: Pictures, near: Pictures, r: Any, c: Any, x: Any, y: Any) -> Any:
    """Shift at a place of the surface that pixel (r, c) shows, bilinear; that of (r, c) beyond the surface."""
    rows, columns = near.shape
    one, mine, margin = np.float32(1), near[r, c], np.float32(1 + SAME_SURFACE)
    left, top = int(np.floor(x)), int(np.floor(y))
    across = down = np.float32(0)
    for v in range(top, top + 2):
        for u in range(left, left + 2):
            weight = (one - abs(x - np.float32(u))) * (one - abs(y - np.float32(v)))
            i, j = r, c
            if 0 <= v < rows and 0 <= u < columns and near[v, u] <= mine * margin and mine <= near[v, u] * margin:
                i, j = v, u
            across += weight * shift[i, j, 0]
            down += weight * shift[i, j, 1]
    return across, down


@njit(inline="always")
def _light_at(picture: Pictures, x: Any, y: Any) -> Any:
    """Light at a place, by cubic convolution; not negative."""
    rows, columns = picture.shape
    left, top = int(np.floor(x)), int(np.floor(y))
    h, v = _cubic(x - np.float32(left)), _cubic(y - np.float32(top))
    light = np.float32(0)
    for i in range(4):
        row = min(max(top - 1 + i, 0), rows - 1)
        line = np.float32(0)
        for j in range(4):
            line += h[j] * picture[row, min(max(left - 1 + j, 0), columns - 1)]
        light += v[i] * line
    return max(light, np.float32(0))


@njit(inline="always")
def _cubic(f: Any) -> Any:
    """Weights of four neighbours.  Source: Keys 1981, cubic convolution, a = -1/2."""
    half, one = np.float32(0.5), np.float32(1)
    g = one - f
    return (
        -half * f * g * g,
        one + f * f * (np.float32(1.5) * f - np.float32(2.5)),
        one + g * g * (np.float32(1.5) * g - np.float32(2.5)),
        -half * g * f * f,
    )
