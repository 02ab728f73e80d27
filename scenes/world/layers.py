"""Layers: a body's two keys around an instant, warped to it, blended by time and laid over the picture.

The error of either key grows with the distance in time and has opposite sign in the two, so to first order it cancels.
At the time of a key that key alone is seen, so nothing pops.

Each pixel's place in a key follows from the polynomial of `carried.py`.  A `solid` body goes on in `STEPS`: the depth
that the key has at s tells how far off, z, the pixel x is now, and the motion where that was.  Each step reduces the
error of the polynomial to its product with the slope of the surface and the turn of the line of sight; none may lead
further than the polynomial is off where it is worst.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.world.carried import Carried
from spikecam_env.compiled import njit
from spikecam_env.types import Masks, Pictures

STEPS = 2
"""Times that depth is read to find a place.  Where that does not settle, at rims, even numbers come out nearer."""


def lay(
    pictures: Pictures,
    depths: Pictures,
    boxes: NDArray[np.int64],
    before: Carried,
    after: Carried,
    share: Pictures,
    solid: bool,
    tested: bool,
    marked: bool,
) -> None:
    """Lay a body over pictures (n, H, W), in place: out = light + (1 - coverage) x picture.

    Args:
        depths: (n, H, W), of the layers so far; used if `tested` (hide where deeper) or `marked` (write).
        boxes: (n, 4) where it may be seen: top, left, bottom, right.
        before: the earlier of two keys.
        after: the later one.
        share: (n,) of the later key, 0..1.
        solid: whether depth carries the keys too.
    """
    _lay(pictures, depths, boxes, before.arrays(), after.arrays(), share, solid, tested, marked)


@njit(nogil=True, cache=True, error_model="numpy", fastmath=True)
def _add(
    layer: Pictures, box: NDArray[np.int64], weight: np.float32, carried: Any, n: int, solid: bool, deep: bool
) -> None:
    """Add weight x key, read bilinear, to a layer (3, h, w) of light, coverage and distance, the box of the picture.

    Each row goes through short loops over arrays of its own, places, texels, light: all but those that fetch are
    vectors then.  Pixels at either end that read nothing of the key are left out.
    """
    tints, depth, brightest, references, coefficients, motions = carried
    top, left, bottom, right = box
    most, cells, depths = right - left, tints.reshape(-1), depth.reshape(-1)
    x, y = np.empty(most, np.float32), np.empty(most, np.float32)
    first_x, first_y = np.empty(most, np.float32), np.empty(most, np.float32)
    right_share, lower_share = np.empty(most, np.float32), np.empty(most, np.float32)
    cell, z = np.empty(most, np.uint32), np.empty(most, np.float32)
    corners = np.empty(most, np.uint32), np.empty(most, np.uint32), np.empty(most, np.uint32), np.empty(most, np.uint32)
    corner_depths = (
        np.empty(most, np.float32),
        np.empty(most, np.float32),
        np.empty(most, np.float32),
        np.empty(most, np.float32),
    )
    last = np.float32(tints.shape[1] - 1.001), np.float32(tints.shape[0] - 1.001)
    width, below = np.int32(tints.shape[1]), np.uint32(tints.shape[1])
    steps = weight * brightest / np.float32(65535), weight / np.float32(65535)
    law, scale, column = coefficients[n], references[n, 2], np.float32(left)
    bend, u_first = (law[0, 3] * scale * scale, law[1, 3] * scale * scale), column - references[n, 0]
    motion = motions[n]
    now = motion[0], motion[1], motion[2], motion[3]
    step, shift = (motion[4], motion[8], motion[12]), (motion[7], motion[11], motion[15], motion[16])
    for row in range(bottom - top):
        line = np.float32(top + row)
        v = (line - references[n, 1]) * scale
        level = law[0, 0] + v * (law[0, 2] + v * law[0, 5]), law[1, 0] + v * (law[1, 2] + v * law[1, 5])
        slope = (law[0, 1] + v * law[0, 4]) * scale, (law[1, 1] + v * law[1, 4]) * scale
        _place_by_polynomial(level, slope, bend, u_first, last, x, y)
        if solid:
            of_row = (
                step[0] * column + motion[5] * line + motion[6],
                step[1] * column + motion[9] * line + motion[10],
                step[2] * column + motion[13] * line + motion[14],
            )
            for i in range(most):
                first_x[i], first_y[i] = x[i], y[i]
            for _ in range(STEPS):
                _fetch_depth(depths, width, x, y, cell, z)
                _place_by_depth(now, of_row, step, shift, last, z, first_x, first_y, x, y)
        _split_places(width, x, y, cell, right_share, lower_share)
        start, stop = 0, most
        while start < stop and _empty(cells, cell[start], below):
            start += 1
        while start < stop and _empty(cells, cell[stop - 1], below):
            stop -= 1
        seen, shares = cell[start:stop], (right_share[start:stop], lower_share[start:stop])
        _add_tints(cells, below, seen, shares, steps, corners, layer[0, row, start:stop], layer[1, row, start:stop])
        if deep:
            places, away = (x[start:stop], y[start:stop]), layer[2, row, start:stop]
            _add_distance(depths, below, seen, shares, weight, now, places, corner_depths, away)


@njit(inline="always")
def _place_by_polynomial(level: Any, slope: Any, bend: Any, u_first: Any, last: Any, x: Pictures, y: Pictures) -> None:
    """Texels (x, y) of the key at the pixels of a row: level + slope u + bend u^2, inside the key.

    All but the arrays and u_first, of the first pixel, are of x and y.
    """
    zero, level_x, level_y, slope_x, slope_y = np.float32(0), level[0], level[1], slope[0], slope[1]
    bend_x, bend_y, last_x, last_y = bend[0], bend[1], last[0], last[1]
    for i in range(len(x)):
        u = u_first + np.float32(i)
        x[i] = min(max(level_x + u * (slope_x + u * bend_x), zero), last_x)
        y[i] = min(max(level_y + u * (slope_y + u * bend_y), zero), last_y)


@njit(inline="always")
def _fetch_depth(
    depths: Pictures, width: np.int32, x: Pictures, y: Pictures, cell: NDArray[np.uint32], z: Pictures
) -> None:
    """Depth z that the key has at the texels next to (x, y)."""
    half = np.float32(0.5)
    for i in range(len(x)):
        cell[i] = np.int32(y[i] + half) * width + np.int32(x[i] + half)
    for i in range(len(x)):
        z[i] = depths[cell[i]]


@njit(inline="always")
def _place_by_depth(
    now: Any,
    of_row: Any,
    step: Any,
    shift: Any,
    last: Any,
    z: Pictures,
    first_x: Pictures,
    first_y: Pictures,
    x: Pictures,
    y: Pictures,
) -> None:
    """Move texels (x, y) to their places by depth z, at most as far as the polynomial is off (`Carried.rigid`).

    Args:
        now: four numbers that give the depth now.
        of_row: the matrix times the row's first pixel.
        step: its change from pixel to pixel.
        shift: its last column, and the largest error of the polynomial.
        last: last texel in x and y.
    """
    zero, one, nearest, last_x, last_y = np.float32(0), np.float32(1), np.float32(1e-9), last[0], last[1]
    now_x, now_y, now_rest, nearer = now[0], now[1], now[2], now[3]
    row_x, row_y, row_w, step_x, step_y, step_w = of_row[0], of_row[1], of_row[2], step[0], step[1], step[2]
    shift_x, shift_y, shift_w, astray = shift[0], shift[1], shift[2], shift[3]
    for i in range(len(x)):
        away, along = z[i] * (now_x * x[i] + now_y * y[i] + now_rest) + nearer, np.float32(i)
        w = one / max(away * (row_w + step_w * along) + shift_w, nearest)
        by_depth_x = (away * (row_x + step_x * along) + shift_x) * w
        by_depth_y = (away * (row_y + step_y * along) + shift_y) * w
        x[i] = min(max(by_depth_x, first_x[i] - astray, zero), first_x[i] + astray, last_x)
        y[i] = min(max(by_depth_y, first_y[i] - astray, zero), first_y[i] + astray, last_y)


@njit(inline="always")
def _split_places(
    width: np.int32, x: Pictures, y: Pictures, cell: NDArray[np.uint32], right_share: Pictures, lower_share: Pictures
) -> None:
    """Texels (x, y) as the cell to their upper left, and the shares of the cells to the right of it and below."""
    for i in range(len(x)):
        row, column = np.int32(y[i]), np.int32(x[i])
        cell[i] = row * width + column
        right_share[i], lower_share[i] = x[i] - np.float32(column), y[i] - np.float32(row)


@njit(inline="always")
def _fetch_corners(table: Any, below: np.uint32, seen: NDArray[np.uint32], corners: Any) -> None:
    """Values of a table at the cells seen, and at their right, lower and lower right neighbours."""
    here, right, lower, lower_right = corners
    to_right = np.uint32(1)
    for i in range(len(seen)):
        cell = seen[i]
        here[i], right[i] = table[cell], table[cell + to_right]
        lower[i], lower_right[i] = table[cell + below], table[cell + below + to_right]


@njit(inline="always")
def _add_tints(
    cells: NDArray[np.uint32],
    below: np.uint32,
    seen: NDArray[np.uint32],
    shares: tuple[Pictures, Pictures],
    steps: tuple[np.float32, np.float32],
    corners: Any,
    light: Pictures,
    cover: Pictures,
) -> None:
    """Add light and coverage of the cells seen, each in steps of the tints."""
    (right_share, lower_share), (light_step, cover_step) = shares, steps
    bits, half = np.uint32(0xFFFF), np.uint32(16)
    here, right, lower, lower_right = corners
    _fetch_corners(cells, below, seen, corners)
    for i in range(len(seen)):
        high, low = np.float32(np.int32(here[i] & bits)), np.float32(np.int32(lower[i] & bits))
        high += right_share[i] * (np.float32(np.int32(right[i] & bits)) - high)
        low += right_share[i] * (np.float32(np.int32(lower_right[i] & bits)) - low)
        light[i] += light_step * (high + lower_share[i] * (low - high))
        high, low = np.float32(np.int32(here[i] >> half)), np.float32(np.int32(lower[i] >> half))
        high += right_share[i] * (np.float32(np.int32(right[i] >> half)) - high)
        low += right_share[i] * (np.float32(np.int32(lower_right[i] >> half)) - low)
        cover[i] += cover_step * (high + lower_share[i] * (low - high))


@njit(inline="always")
def _add_distance(
    depths: Pictures,
    below: np.uint32,
    seen: NDArray[np.uint32],
    shares: tuple[Pictures, Pictures],
    weight: np.float32,
    now: Any,
    places: tuple[Pictures, Pictures],
    corners: Any,
    away: Pictures,
) -> None:
    """Add weight x the distance now of the cells seen."""
    (right_share, lower_share), (x, y) = shares, places
    here, right, lower, lower_right = corners
    now_x, now_y, now_rest, nearer = now
    _fetch_corners(depths, below, seen, corners)
    for i in range(len(seen)):
        high = here[i] + right_share[i] * (right[i] - here[i])
        low = lower[i] + right_share[i] * (lower_right[i] - lower[i])
        depth = high + lower_share[i] * (low - high)
        away[i] += weight * (depth * (now_x * x[i] + now_y * y[i] + now_rest) + nearer)


@njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _empty(cells: NDArray[np.uint32], at: np.uint32, under: np.uint32) -> bool:
    one = np.uint32(1)
    return cells[at] | cells[at + one] | cells[at + under] | cells[at + under + one] == 0  # type: ignore[no-any-return]


@njit(nogil=True, cache=True, error_model="numpy")
def _lay(
    pictures: Pictures,
    depths: Pictures,
    boxes: NDArray[np.int64],
    before: Any,
    after: Any,
    share: Pictures,
    solid: bool,
    tested: bool,
    marked: bool,
) -> None:
    """See `lay`; keys as `Carried.arrays` gives them."""
    zero, half, one = np.float32(0), np.float32(0.5), np.float32(1)
    deep = tested or marked
    resting = _resting(boxes, before[3], before[4], share)
    rows, columns = max((boxes[:, 2] - boxes[:, 0]).max(), 0), max((boxes[:, 3] - boxes[:, 1]).max(), 0)
    layer = np.empty((3, rows, columns), np.float32)
    for n in range(len(pictures)):
        top, left, bottom, right = boxes[n]
        if top >= bottom or left >= right:
            continue
        if not resting[n]:
            layer[:, : bottom - top, : right - left] = zero
            if share[n] < one:
                _add(layer, boxes[n], one - share[n], before, n, solid, deep)
            if share[n] > zero:
                _add(layer, boxes[n], share[n], after, n, solid, deep)
        for row in range(bottom - top):
            light, cover, away = layer[0, row], layer[1, row], layer[2, row]
            picture = pictures[n, top + row, left:right]
            if not deep:
                for x in range(len(picture)):
                    picture[x] = light[x] + max(one - cover[x], zero) * picture[x]
                continue
            nearest = depths[n, top + row, left:right]
            for x in range(len(picture)):
                if cover[x] <= zero or (tested and away[x] > nearest[x]):
                    continue
                picture[x] = light[x] + max(one - cover[x], zero) * picture[x]
                if marked and cover[x] > half:
                    nearest[x] = away[x]


@njit(nogil=True, cache=True)
def _resting(boxes: NDArray[np.int64], reference: Pictures, coefficients: Pictures, share: Pictures) -> Masks:
    """Whether a body is seen just as at the instant before: its rows need not be read again."""
    resting = np.zeros(len(boxes), np.bool_)
    for n in range(1, len(boxes)):
        resting[n] = (
            share[n] == 0
            and share[n - 1] == 0
            and (boxes[n] == boxes[n - 1]).all()
            and (reference[n] == reference[n - 1]).all()
            and (coefficients[n] == coefficients[n - 1]).all()
        )
    return resting
