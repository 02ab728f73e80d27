"""Layers: a body rendered alone at a key time, then warped to any time near it and laid over the picture.

A key is a sprite: premultiplied light, coverage and depth at `DENSITY` texels a pixel.  Of each body the two keys
around an instant are carried to it by the true motion of the points they show, and blended by time: what either
misplaces grows with the distance in time and has opposite sign in the two, so to first order it cancels, and
where a key is reached only that key is seen, so nothing pops.

The motion of the points is summed up by a polynomial of second degree from picture to sprite,

    s = C (1, u, v, u^2, u v, v^2),   (u, v): the pixel relative to the points' middle, in units of their spread

fitted by least squares: exact for planes seen in parallel, and close for the dome that a ball is.  A `solid` body goes
on in `STEPS`: the depth that the key has at s tells how far off, z, the pixel x is now, and the motion where that was,

    s' = K (R z K^-1 x + t),   K: lenses, (R, t): from the camera now to the camera at the key

Of what the polynomial had misplaced each step leaves the slope of the surface times the turn of the line of sight;
none may lead further than the polynomial is off where it is worst.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.camera import intrinsic
from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole, Renderer, Sprite, Surface
from spikecam_env.compiled import njit
from spikecam_env.types import Floats, Pictures

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
    """A body seen alone at one instant.

    tints    (h, w) uint32: light x coverage in the lower 16 bits, full at `brightest`, and coverage in the upper, full
             at 1.  Four are read for a pixel, and to fetch them is what takes the time.
    depth    (h, w) float32; beside the body, that of what is nearest to there
    points   (J, 3) of the body that it shows, in the body's coordinates;  texels  (J, 2) where, x then y
    lens     (3, 3) directions (right, down, 1) to texels
    """

    tints: NDArray[np.uint32]
    brightest: float
    depth: Pictures
    points: Floats
    texels: Floats
    lens: Floats

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
    """Depth, and beside the body that of the texel nearest to there; 0 where nothing is seen at all."""
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
    """(rows, columns) of texels that are covered: a grid of about SAMPLES a side, and the ends of its rows and columns,
    as it is at the outline that a polynomial goes wrong first."""
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


def _spread(present: NDArray[np.bool_]) -> NDArray[np.intp]:
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

    Returns the frames of reference (n, 3): middle x, y and 1 / spread; and the coefficients (n, 2, 6).
    What points do not determine stays as it is without turn: texels = DENSITY * pixels + constant.
    """
    reference, found = np.empty((len(pixels), 3)), np.empty((len(pixels), 2, 6))
    _fit(np.ascontiguousarray(key_pixels), np.ascontiguousarray(pixels), reference, found)
    return reference, found


@njit(nogil=True, cache=True, error_model="numpy")
def _fit(key_pixels: Floats, pixels: Floats, reference: Floats, found: Floats) -> None:
    """See `fit`; instant by instant, so that none depends on what else is asked for."""
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
                found[n, axis, row] = right[row, axis]
            found[n, axis, 1 + axis] += DENSITY * spread


@njit(inline="always")
def _basis(u: float, v: float, basis: Floats) -> None:
    """What the polynomial is a sum of, (6,), at (u, v)."""
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
def _astray(key_pixels: Floats, pixels: Floats, reference: Floats, found: Floats, furthest: Floats) -> None:
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
                    place += found[n, axis, row] * basis[row]
                furthest[n] = max(furthest[n], abs(place - key_pixels[j, axis]))


@dataclass(frozen=True, eq=False)
class Carried:
    """A key carried to n instants: frames of reference (n, 3) and coefficients (n, 2, 6) as `fit` gives them, and the
    motion itself: `rigid` (n, 17), four numbers that give the depth now of a texel (x, y) of depth z, as
    z (a x + b y + c) + d, and a matrix (3, 4) from a pixel (x, y) of depth z, as (z x, z y, z, 1), to its texel, and
    how far the polynomial is off at most, of the points that the key shows [texels]."""

    key: BodyKey
    reference: Pictures
    coefficients: Pictures
    rigid: Pictures

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

    boxes    (n, 4) where it may be seen: top, left, bottom, right
    share    (n,) of the later key, 0..1
    solid    whether depth carries the keys too
    depths   (n, H, W), of what has been laid so far; used if `tested` (hide where deeper) or `marked` (write)
    """
    _lay(
        pictures,
        depths,
        boxes,
        before.key.tints,
        before.key.depth,
        np.float32(before.key.brightest),
        before.reference,
        before.coefficients,
        before.rigid,
        after.key.tints,
        after.key.depth,
        np.float32(after.key.brightest),
        after.reference,
        after.coefficients,
        after.rigid,
        share,
        solid,
        tested,
        marked,
    )


@njit(nogil=True, cache=True, error_model="numpy", fastmath=True)
def _add(
    layer: Pictures,
    box: NDArray[np.int64],
    weight: np.float32,
    tints: NDArray[np.uint32],
    brightest: np.float32,
    depth: Pictures,
    reference: Pictures,
    coefficients: Pictures,
    rigid: Pictures,
    solid: bool,
    deep: bool,
) -> None:
    """Add weight x key, read bilinear, to a layer (3, h, w) of light, coverage and distance, the box of the picture.

    Each row goes through short loops over arrays of its own, places, texels, light: all but those that fetch are
    vectors then.  Pixels at either end that read nothing of the key are left out.
    """
    top, left, bottom, right = box
    height, width = tints.shape
    cells, depths = tints.reshape(-1), depth.reshape(-1)
    most = right - left
    s, t = np.empty(most, np.float32), np.empty(most, np.float32)
    first_s, first_t = np.empty(most, np.float32), np.empty(most, np.float32)
    p, q = np.empty(most, np.float32), np.empty(most, np.float32)
    at, z = np.empty(most, np.uint32), np.empty(most, np.float32)
    here, next_here = np.empty(most, np.uint32), np.empty(most, np.uint32)
    below, next_below = np.empty(most, np.uint32), np.empty(most, np.uint32)
    e, f, g, h = (
        np.empty(most, np.float32),
        np.empty(most, np.float32),
        np.empty(most, np.float32),
        np.empty(most, np.float32),
    )
    zero, half, one, nearest = np.float32(0), np.float32(0.5), np.float32(1), np.float32(1e-9)
    last_s, last_t = np.float32(width - 1.001), np.float32(height - 1.001)
    columns, right_of, bits, upper = np.int32(width), np.uint32(1), np.uint32(0xFFFF), np.uint32(16)
    under = np.uint32(width)
    of_light, of_cover = weight * brightest / np.float32(65535), weight / np.float32(65535)
    c, k, x = coefficients, reference[2], np.float32(left)
    bend, sag, u0 = c[0, 3] * k * k, c[1, 3] * k * k, x - reference[0]
    of_s, of_t, rest, nearer = rigid[0], rigid[1], rigid[2], rigid[3]
    step_s, step_t, step_w = rigid[4], rigid[8], rigid[12]
    shift_s, shift_t, shift_w, astray = rigid[7], rigid[11], rigid[15], rigid[16]
    for row in range(bottom - top):
        y = np.float32(top + row)
        v = (y - reference[1]) * k
        a, b = c[0, 0] + v * (c[0, 2] + v * c[0, 5]), (c[0, 1] + v * c[0, 4]) * k
        d, r = c[1, 0] + v * (c[1, 2] + v * c[1, 5]), (c[1, 1] + v * c[1, 4]) * k
        for i in range(most):
            u = u0 + np.float32(i)
            s[i] = min(max(a + u * (b + u * bend), zero), last_s)
            t[i] = min(max(d + u * (r + u * sag), zero), last_t)
        if solid:
            row_s = step_s * x + rigid[5] * y + rigid[6]
            row_t = step_t * x + rigid[9] * y + rigid[10]
            row_w = step_w * x + rigid[13] * y + rigid[14]
            for i in range(most):
                first_s[i], first_t[i] = s[i], t[i]
            for _ in range(STEPS):
                for i in range(most):
                    at[i] = np.int32(t[i] + half) * columns + np.int32(s[i] + half)
                for i in range(most):
                    z[i] = depths[at[i]]
                for i in range(most):
                    away, along = z[i] * (of_s * s[i] + of_t * t[i] + rest) + nearer, np.float32(i)
                    w = one / max(away * (row_w + step_w * along) + shift_w, nearest)
                    by_depth_s = (away * (row_s + step_s * along) + shift_s) * w
                    by_depth_t = (away * (row_t + step_t * along) + shift_t) * w
                    s[i] = min(max(by_depth_s, first_s[i] - astray, zero), first_s[i] + astray, last_s)
                    t[i] = min(max(by_depth_t, first_t[i] - astray, zero), first_t[i] + astray, last_t)
        for i in range(most):
            j = np.int32(t[i])
            m = np.int32(s[i])
            at[i] = j * columns + m
            p[i], q[i] = s[i] - np.float32(m), t[i] - np.float32(j)
        start, stop = 0, most
        while start < stop and _empty(cells, at[start], under):
            start += 1
        while start < stop and _empty(cells, at[stop - 1], under):
            stop -= 1
        count = stop - start
        ats, ps, qs = at[start:stop], p[start:stop], q[start:stop]
        for i in range(count):
            m = ats[i]
            here[i], next_here[i] = cells[m], cells[m + right_of]
            below[i], next_below[i] = cells[m + under], cells[m + under + right_of]
        light, cover = layer[0, row, start:stop], layer[1, row, start:stop]
        for i in range(count):
            high, low = np.float32(np.int32(here[i] & bits)), np.float32(np.int32(below[i] & bits))
            high += ps[i] * (np.float32(np.int32(next_here[i] & bits)) - high)
            low += ps[i] * (np.float32(np.int32(next_below[i] & bits)) - low)
            light[i] += of_light * (high + qs[i] * (low - high))
            high, low = np.float32(np.int32(here[i] >> upper)), np.float32(np.int32(below[i] >> upper))
            high += ps[i] * (np.float32(np.int32(next_here[i] >> upper)) - high)
            low += ps[i] * (np.float32(np.int32(next_below[i] >> upper)) - low)
            cover[i] += of_cover * (high + qs[i] * (low - high))
        if deep:
            for i in range(count):
                m = ats[i]
                e[i], f[i] = depths[m], depths[m + right_of]
                g[i], h[i] = depths[m + under], depths[m + under + right_of]
            ss, ts, away_row = s[start:stop], t[start:stop], layer[2, row, start:stop]
            for i in range(count):
                high, low = e[i] + ps[i] * (f[i] - e[i]), g[i] + ps[i] * (h[i] - g[i])
                seen = high + qs[i] * (low - high)
                away_row[i] += weight * (seen * (of_s * ss[i] + of_t * ts[i] + rest) + nearer)


@njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _empty(cells: NDArray[np.uint32], at: np.uint32, under: np.uint32) -> bool:
    one = np.uint32(1)
    return cells[at] | cells[at + one] | cells[at + under] | cells[at + under + one] == 0  # type: ignore[no-any-return]


@njit(nogil=True, cache=True, error_model="numpy")
def _lay(
    pictures: Pictures,
    depths: Pictures,
    boxes: NDArray[np.int64],
    tints0: NDArray[np.uint32],
    depth0: Pictures,
    brightest0: np.float32,
    reference0: Pictures,
    coefficients0: Pictures,
    rigid0: Pictures,
    tints1: NDArray[np.uint32],
    depth1: Pictures,
    brightest1: np.float32,
    reference1: Pictures,
    coefficients1: Pictures,
    rigid1: Pictures,
    share: Pictures,
    solid: bool,
    tested: bool,
    marked: bool,
) -> None:
    zero, half, one = np.float32(0), np.float32(0.5), np.float32(1)
    deep = tested or marked
    resting = _resting(boxes, reference0, coefficients0, share)
    rows, columns = max((boxes[:, 2] - boxes[:, 0]).max(), 0), max((boxes[:, 3] - boxes[:, 1]).max(), 0)
    layer = np.empty((3, rows, columns), np.float32)
    for n in range(len(pictures)):
        top, left, bottom, right = boxes[n]
        if top >= bottom or left >= right:
            continue
        if not resting[n]:
            layer[:, : bottom - top, : right - left] = zero
            w = share[n]
            if w < one:
                _add(
                    layer,
                    boxes[n],
                    one - w,
                    tints0,
                    brightest0,
                    depth0,
                    reference0[n],
                    coefficients0[n],
                    rigid0[n],
                    solid,
                    deep,
                )
            if w > zero:
                _add(
                    layer,
                    boxes[n],
                    w,
                    tints1,
                    brightest1,
                    depth1,
                    reference1[n],
                    coefficients1[n],
                    rigid1[n],
                    solid,
                    deep,
                )
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
def _resting(
    boxes: NDArray[np.int64], reference: Pictures, coefficients: Pictures, share: Pictures
) -> NDArray[np.bool_]:
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
