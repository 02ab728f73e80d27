"""Layers: a body rendered alone at a key time, then warped to any time near it and laid over the picture.

A key is a sprite: premultiplied light, coverage and depth at `DENSITY` texels a pixel.  Of each body the two keys
around an instant are carried to it by the true motion of the points they show, and blended by time.  The error of
either grows with the distance in time and has opposite sign in the two, so to first order it cancels.  At the time of a
key that key alone is seen, so nothing pops.

The motion of the points is summed up by a polynomial of second degree from picture to sprite,

    s = C (1, u, v, u^2, u v, v^2),   (u, v): the pixel relative to the points' middle, in units of their spread

fitted by least squares: exact for planes seen in parallel, and close for the dome that a ball is.  A `solid` body goes
on in `STEPS`: the depth that the key has at s tells how far off, z, the pixel x is now, and the motion where that was,

    s' = K (R z K^-1 x + t),   K: lenses, (R, t): from the camera now to the camera at the key

Each step reduces the error of the polynomial to its product with the slope of the surface and the turn of the line of
sight; none may lead further than the polynomial is off where it is worst.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.camera import intrinsic
from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole, Renderer, Sprite, Surface
from spikecam_env.compiled import njit
from spikecam_env.types import Floats, Masks, Pictures

DENSITY = 3
"""Texels a pixel, one ray each.  On the scene `tumble` 0.9 % rms off 16 x 16 rays a pixel where things move."""

_BLUR = (DENSITY**2 / 12 - 1 / 4) / 2
_FILTER = np.array([_BLUR, 1 - 2 * _BLUR, _BLUR])
"""A texel's box and bilinear interpolation blur by (1 / 12 + 1 / 6) / DENSITY^2 pixels^2; this makes up the 1 / 12 of a
pixel's area."""

SAMPLES = 10
"""Points of a sprite's side whose motion is followed."""

STEPS = 2
"""Times that depth is read to find a place.  Where that does not settle, at rims, even numbers come out nearer."""

RIDGE = 1e-4
"""Weight, against one point, that keeps the turn and bend of a sprite seen in few points at rest."""


@dataclass(frozen=True, eq=False)
class BodyKey:
    """A body seen alone at one instant."""

    tints: NDArray[np.uint32]
    """(h, w) uint32: light x coverage in the lower 16 bits, full at `brightest`, and coverage in the upper, full at 1.
    Four are fetched for a pixel, which takes most of the time."""
    brightest: float
    depth: Pictures
    """(h, w) float32; beside the body, that of its nearest texel."""
    points: Floats
    """(J, 3) of the body that it shows, in the body's coordinates."""
    texels: Floats
    """(J, 2) where these are, x then y."""
    lens: Floats
    """(3, 3) directions (right, down, 1) to texels."""

    @cached_property
    def to_directions(self) -> Floats:
        """(3, 3) texels to directions."""
        return np.asarray(np.linalg.inv(self.lens))


def render_key(
    renderer: Renderer,
    surface: Surface,
    pose: Floats,
    camera: Pinhole,
    lighting: Lighting,
    window: PictureWindow,
    gain: float,
) -> BodyKey:
    """The surface at a pose in a window of the picture [pixels], its light multiplied by a gain."""
    if not (window.rows and window.columns):
        return _NOTHING
    dense = Pinhole(camera.focal * DENSITY, _dense(camera.centre), camera.pose)
    left, top = np.floor(_dense((window.left, window.top))).astype(int)
    right, bottom = np.ceil(_dense((window.left + window.columns, window.top + window.rows))).astype(int)
    cut = PictureWindow(int(top), int(left), int(bottom - top), int(right - left))
    sprite = renderer.render(surface, pose, dense, lighting, cut, 1)
    light, cover = (
        np.asarray(cv2.sepFilter2D(plane, -1, _FILTER, _FILTER), np.float32)
        for plane in (sprite.radiance, sprite.coverage)
    )
    rows, columns = _sampled(sprite.coverage)
    z = sprite.depth[rows, columns].astype(np.float64)
    x = (columns + left - dense.centre[0]) / dense.focal * z
    y = (dense.centre[1] - rows - top) / dense.focal * z
    to_body = np.linalg.inv(pose) @ camera.pose
    points = np.stack([x, y, -z], -1) @ to_body[:3, :3].T + to_body[:3, 3]
    texels = np.stack([columns, rows], -1).astype(np.float64)
    brightest = max(float(light.max()), 1e-30)
    tints = _tints(light, np.float32(brightest), cover)
    lens = intrinsic(dense.focal, (dense.centre[0] - left, dense.centre[1] - top))
    return BodyKey(tints, brightest * gain, _filled(sprite), points, texels, lens)


_NOTHING = BodyKey(
    np.zeros((0, 0), np.uint32), 1.0, np.zeros((0, 0), np.float32), np.zeros((0, 3)), np.zeros((0, 2)), np.eye(3)
)
"""Of a body that is out of sight."""


@njit(nogil=True, cache=True, error_model="numpy")
def _tints(light: Pictures, brightest: np.float32, cover: Pictures) -> NDArray[np.uint32]:
    """Light as a share of the brightest, and coverage, both in 0..1, in 16 bits each."""
    tints = np.empty(light.shape, np.uint32)
    full, half = np.float32(65535), np.float32(0.5)
    for row in range(len(tints)):
        into, lights, covers = tints[row], light[row], cover[row]
        for x in range(len(into)):
            lower = np.uint32(min(lights[x] / brightest * full + half, full))
            into[x] = lower | np.uint32(min(covers[x] * full + half, full)) << np.uint32(16)
    return tints


def _filled(sprite: Sprite) -> Pictures:
    """Depth, and beside the body that of the texel nearest to there; 0 where no texel is covered."""
    nothing = np.logical_not((sprite.coverage > 0) & np.isfinite(sprite.depth)).astype(np.uint8)
    if nothing.all():
        return np.zeros_like(sprite.depth)
    _, nearest = cv2.distanceTransformWithLabels(nothing, cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL)
    filled: Pictures = _depth_of(np.asarray(nearest, np.int32), int(nearest.max()), nothing, sprite.depth)
    return filled


@njit(nogil=True, cache=True)
def _depth_of(nearest: NDArray[np.int32], labels: int, nothing: NDArray[np.uint8], depth: Pictures) -> Pictures:
    """Of each texel the depth of the one that is not nothing and has the same label."""
    of_label, filled = np.zeros(labels + 1, np.float32), np.empty(depth.shape, np.float32)
    for row in range(len(nearest)):
        for x in range(nearest.shape[1]):
            if nothing[row, x] == 0:
                of_label[nearest[row, x]] = depth[row, x]
    for row in range(len(nearest)):
        for x in range(nearest.shape[1]):
            filled[row, x] = of_label[nearest[row, x]]
    return filled


def _dense(xy: tuple[float, float]) -> tuple[float, float]:
    return xy[0] * DENSITY + (DENSITY - 1) / 2, xy[1] * DENSITY + (DENSITY - 1) / 2


def _sampled(coverage: Pictures) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """(rows, columns) of covered texels: a grid of about SAMPLES a side, and the ends of its rows and columns, since a
    polynomial fails at the outline first."""
    solid = coverage >= min(0.99, max(float(coverage.max(initial=0)), 1e-6))
    rows, columns = (_spread(np.asarray(solid.any(axis))) for axis in (1, 0))
    if not len(rows):
        return rows, columns
    last_row, last_column = len(solid) - 1, solid.shape[1] - 1
    across, down = solid[rows], solid[:, columns]
    inner = np.nonzero(across[:, columns])
    return (
        np.concatenate([rows[inner[0]], rows, rows, down.argmax(0), last_row - down[::-1].argmax(0)]),
        np.concatenate(
            [columns[inner[1]], across.argmax(1), last_column - across[:, ::-1].argmax(1), columns, columns]
        ),
    )


def _spread(present: Masks) -> NDArray[np.intp]:
    """About SAMPLES of the places that are present, evenly from the first to the last."""
    places = np.flatnonzero(present)
    return (
        places[np.unique(np.linspace(0, len(places) - 1, SAMPLES).round().astype(np.intp))] if len(places) else places
    )


def project(view: Floats, points: Floats, focal: float, centre: tuple[float, float]) -> tuple[Floats, Floats]:
    """(..., J, 2) pixels and (..., J) depth of points (J, 3) under maps to the camera (..., 4, 4)."""
    seen = points @ np.swapaxes(view[..., :3, :3], -1, -2) + view[..., None, :3, 3]
    depth = -seen[..., 2]
    safe = np.maximum(depth, 1e-6)
    return np.stack([centre[0] + focal * seen[..., 0] / safe, centre[1] - focal * seen[..., 1] / safe], -1), depth


def fit(key_pixels: Floats, pixels: Floats) -> tuple[Floats, Floats]:
    """The polynomials that carry pixels (n, J, 2) back to texels (J, 2) of the key.

    Coefficients that points do not determine are those without turn: texels = DENSITY * pixels + constant.

    Returns:
        The frames of reference (n, 3): middle x, y and 1 / spread; and the coefficients (n, 2, 6).
    """
    reference, coefficients = np.empty((len(pixels), 3)), np.empty((len(pixels), 2, 6))
    _fit(np.ascontiguousarray(key_pixels), np.ascontiguousarray(pixels), reference, coefficients)
    return reference, coefficients


@njit(nogil=True, cache=True, error_model="numpy")
def _fit(key_pixels: Floats, pixels: Floats, reference: Floats, coefficients: Floats) -> None:
    """See `fit`; instant by instant, so that none depends on the others."""
    normal, right, basis = np.empty((6, 6)), np.empty((6, 2)), np.empty(6)
    for n in range(len(pixels)):
        points, count = pixels[n], len(key_pixels)
        x = y = square = 0.0
        for j in range(count):
            x += points[j, 0]
            y += points[j, 1]
        x /= count
        y /= count
        for j in range(count):
            square += (points[j, 0] - x) ** 2 + (points[j, 1] - y) ** 2
        spread = max(np.sqrt(square / count), 1.0)
        normal[:], right[:] = 0.0, 0.0
        for j in range(count):
            across, down = points[j, 0] - x, points[j, 1] - y
            _basis(across / spread, down / spread, basis)
            for row in range(6):
                for column in range(row + 1):
                    normal[row, column] += basis[row] * basis[column]
                right[row, 0] += basis[row] * (key_pixels[j, 0] - DENSITY * across)
                right[row, 1] += basis[row] * (key_pixels[j, 1] - DENSITY * down)
        for row in range(1, 6):
            normal[row, row] += RIDGE
        _solve(normal, right)
        reference[n, 0], reference[n, 1], reference[n, 2] = x, y, 1 / spread
        for axis in range(2):
            for row in range(6):
                coefficients[n, axis, row] = right[row, axis]
            coefficients[n, axis, 1 + axis] += DENSITY * spread


@njit(inline="always")
def _basis(u: float, v: float, basis: Floats) -> None:
    """The terms of the polynomial, (6,), at (u, v)."""
    basis[0], basis[1], basis[2], basis[3], basis[4], basis[5] = 1.0, u, v, u * u, u * v, v * v


@njit(inline="always")
def _solve(normal: Floats, right: Floats) -> None:
    """Solve normal x = right (6, 2) in place by Cholesky's factors; normal (6, 6), of which the lower half is read, is
    positive definite."""
    for row in range(6):
        for column in range(row + 1):
            rest = normal[row, column]
            for k in range(column):
                rest -= normal[row, k] * normal[column, k]
            normal[row, column] = np.sqrt(rest) if row == column else rest / normal[column, column]
    for axis in range(2):
        for row in range(6):
            for k in range(row):
                right[row, axis] -= normal[row, k] * right[k, axis]
            right[row, axis] /= normal[row, row]
        for row in range(5, -1, -1):
            for k in range(row + 1, 6):
                right[row, axis] -= normal[k, row] * right[k, axis]
            right[row, axis] /= normal[row, row]


@njit(nogil=True, cache=True, error_model="numpy")
def _astray(key_pixels: Floats, pixels: Floats, reference: Floats, coefficients: Floats, furthest: Floats) -> None:
    """furthest (n,): how far the polynomials put pixels (n, J, 2) from texels (J, 2) of the key, in x or y, at most."""
    basis = np.empty(6)
    for n in range(len(pixels)):
        furthest[n] = 0.0
        for j in range(len(key_pixels)):
            u, v = (
                (pixels[n, j, 0] - reference[n, 0]) * reference[n, 2],
                (pixels[n, j, 1] - reference[n, 1]) * reference[n, 2],
            )
            _basis(u, v, basis)
            for axis in range(2):
                place = 0.0
                for row in range(6):
                    place += coefficients[n, axis, row] * basis[row]
                furthest[n] = max(furthest[n], abs(place - key_pixels[j, axis]))


@dataclass(frozen=True, eq=False)
class Carried:
    """A key carried to n instants."""

    key: BodyKey
    reference: Pictures
    """(n, 3) as `fit` gives it."""
    coefficients: Pictures
    """(n, 2, 6) as `fit` gives them."""
    rigid: Pictures
    """(n, 17), the motion itself.

    - 0 to 3: a, b, c, d; a texel (x, y) of depth z in the key has the depth z (a x + b y + c) + d now.
    - 4 to 15: a matrix (3, 4) from a pixel (x, y) of depth z, as (z x, z y, z, 1), to its texel.
    - 16: the largest error of the polynomial at the points that the key shows [texels].
    """

    def arrays(self) -> tuple[Any, ...]:
        """Tints, depth, brightest light, and the numbers of the instants, for compiled code."""
        key = self.key
        return key.tints, key.depth, np.float32(key.brightest), self.reference, self.coefficients, self.rigid

    def at(self, instants: slice) -> Carried:
        """At some of the instants."""
        return Carried(self.key, self.reference[instants], self.coefficients[instants], self.rigid[instants])


def carry(key: BodyKey, view: Floats, key_view: Floats, focal: float, centre: Floats) -> Carried:
    """The key seen under maps from body to camera (n, 4, 4), with the picture's centre at `centre` (n, 2)."""
    pixels, _ = project(view, key.points, focal, (0.0, 0.0))
    pixels += centre[:, None]
    reference, coefficients = fit(key.texels, pixels)
    astray = np.empty(len(pixels))
    _astray(key.texels, pixels, reference, coefficients, astray)
    rigid = np.concatenate([_rigid(key, view, key_view, focal, centre), astray[:, None]], -1)
    return Carried(key, reference.astype(np.float32), coefficients.astype(np.float32), rigid.astype(np.float32))


_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
"""A camera that looks along -z with y up, to one that looks along z with y down."""


def _rigid(key: BodyKey, view: Floats, key_view: Floats, focal: float, centre: Floats) -> Floats:
    """See `Carried`."""
    now = _FLIP @ view @ np.linalg.inv(key_view) @ _FLIP
    back = np.linalg.inv(now)
    unlens = np.broadcast_to(np.diag([1 / focal, 1 / focal, 1.0]), (len(view), 3, 3)).copy()
    unlens[:, :2, 2] = -centre / focal
    depth = np.concatenate([now[:, 2:3, :3] @ key.to_directions, now[:, 2:3, 3:]], -1)
    texel = np.concatenate([key.lens @ back[:, :3, :3] @ unlens, key.lens @ back[:, :3, 3:]], -1)
    return np.concatenate([depth[:, 0], texel.reshape(-1, 12)], -1)


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
