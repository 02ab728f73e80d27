"""Layers: a body rendered alone at a key time, then warped to any time near it and laid over the picture.

A key is a sprite: premultiplied light, coverage and depth at `DENSITY` texels a pixel.  Of each body the two keys
around an instant are carried to it by the true motion of the points they show, and blended by time: what either
misplaces grows with the distance in time and has opposite sign in the two, so to first order it cancels, and
where a key is reached only that key is seen, so nothing pops.

The motion of the points is summed up by a polynomial of second degree from picture to sprite,

    s = C (1, u, v, u^2, u v, v^2),   (u, v): the pixel relative to the points' middle, in units of their spread

fitted by least squares: exact for planes seen in parallel, and close for the dome that a ball is.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from scenes.renderers.protocol import Lighting, Pinhole, Renderer, Surface, Window

DENSITY = 3
"""Texels a pixel, one ray each.  On the scene `tumble` 0.8 % rms off 16 x 16 supersampling where things move; 1.0 % at
2.5, 1.2 % at 2 (four rays a texel there)."""

_BLUR = (DENSITY**2 / 12 - 1 / 4) / 2
_FILTER = np.array([_BLUR, 1 - 2 * _BLUR, _BLUR])
"""A texel's box and bilinear interpolation blur by (1 / 12 + 1 / 6) / DENSITY^2 pixels^2; this makes up the 1 / 12 of a
pixel's area."""

SAMPLES = 10
"""Points of a sprite's side whose motion is followed."""

RIDGE = 1e-4
"""Weight, against one point, that keeps the turn and bend of a sprite seen in few points at rest."""

Array = NDArray[np.float32]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Key:
    """A body seen alone at one instant.

    planes   (3, h, w) float32: light x coverage, coverage, depth x coverage
    points   (J, 3) of the body that it shows, in the body's coordinates;  texels  (J, 2) where, x then y
    """

    planes: Array
    points: Floats
    texels: Floats


def render_key(
    renderer: Renderer, surface: Surface, pose: Floats, camera: Pinhole, lighting: Lighting, window: Window
) -> Key:
    """The surface at a pose in a window of the picture [pixels]."""
    dense = Pinhole(camera.focal * DENSITY, _dense(camera.centre), camera.pose)
    left, top = np.floor(_dense((window.left, window.top))).astype(int)
    right, bottom = np.ceil(_dense((window.left + window.columns, window.top + window.rows))).astype(int)
    cut = Window(int(top), int(left), int(bottom - top), int(right - left))
    sprite = renderer.render(surface, pose, dense, lighting, cut, 1)
    depth = np.where(sprite.coverage > 0, sprite.depth, 0).astype(np.float32)
    planes = np.stack([sprite.radiance, sprite.coverage, sprite.coverage * depth]).astype(np.float32)
    planes = np.stack([cv2.sepFilter2D(plane, -1, _FILTER, _FILTER) for plane in planes])
    rows, columns = _sampled(sprite.coverage)
    z = depth[rows, columns].astype(np.float64)
    x = (columns + left - dense.centre[0]) / dense.focal * z
    y = (dense.centre[1] - rows - top) / dense.focal * z
    to_body = np.linalg.inv(pose) @ camera.pose
    points = np.stack([x, y, -z], -1) @ to_body[:3, :3].T + to_body[:3, 3]
    return Key(planes, points, np.stack([columns, rows], -1).astype(np.float64))


def _dense(xy: tuple[float, float]) -> tuple[float, float]:
    return xy[0] * DENSITY + (DENSITY - 1) / 2, xy[1] * DENSITY + (DENSITY - 1) / 2


def _sampled(coverage: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
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
    middle = pixels.mean(-2)
    offset = pixels - middle[:, None]
    spread = np.maximum(np.sqrt((offset**2).sum(-1).mean(-1)), 1.0)
    u, v = np.moveaxis(offset / spread[:, None, None], -1, 0)
    basis = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], -1)
    rest = key_pixels - DENSITY * offset
    transposed = np.swapaxes(basis, -1, -2)
    normal = transposed @ basis + RIDGE * np.diag([0.0, 1, 1, 1, 1, 1])
    found = np.linalg.solve(normal, transposed @ rest)
    found[:, 1, 0] += DENSITY * spread
    found[:, 2, 1] += DENSITY * spread
    return np.concatenate([middle, 1 / spread[:, None]], -1), np.swapaxes(found, -1, -2)


@dataclass(frozen=True, eq=False)
class Carried:
    """A key carried to n instants: frames of reference (n, 3) and coefficients (n, 2, 6) as `fit` gives them, and the
    change of depth, (n, 3) on (1, u, v)."""

    key: Key
    reference: Array
    coefficients: Array
    deeper: Array

    def at(self, instants: slice) -> Carried:
        """At some of the instants."""
        return Carried(self.key, self.reference[instants], self.coefficients[instants], self.deeper[instants])


def carry(key: Key, view: Floats, key_view: Floats, focal: float, centre: Floats) -> Carried:
    """The key seen under maps from body to camera (n, 4, 4), with the picture's centre at `centre` (n, 2)."""
    pixels, depth = project(view, key.points, focal, (0.0, 0.0))
    pixels += centre[:, None]
    _, before = project(key_view, key.points, focal, (0.0, 0.0))
    reference, coefficients = fit(key.texels, pixels)
    u, v = np.moveaxis((pixels - reference[:, None, :2]) * reference[:, 2, None, None], -1, 0)
    basis = np.stack([np.ones_like(u), u, v], -1)
    transposed = np.swapaxes(basis, -1, -2)
    deeper = np.linalg.solve(
        transposed @ basis + RIDGE * np.diag([0.0, 1, 1]), transposed @ (depth - before)[..., None]
    )
    return Carried(
        key, reference.astype(np.float32), coefficients.astype(np.float32), deeper[..., 0].astype(np.float32)
    )


def lay(
    pictures: Array,
    depths: Array,
    boxes: NDArray[np.int64],
    before: Carried,
    after: Carried,
    share: Array,
    tested: bool,
    marked: bool,
) -> None:
    """Lay a body over pictures (n, H, W), in place: out = light + (1 - coverage) x picture.

    boxes    (n, 4) where it may be seen: top, left, bottom, right
    share    (n,) of the later key, 0..1
    depths   (n, H, W), of what has been laid so far; used if `tested` (hide where deeper) or `marked` (write)
    """
    _lay(
        pictures,
        depths,
        boxes,
        before.key.planes,
        before.reference,
        before.coefficients,
        before.deeper,
        after.key.planes,
        after.reference,
        after.coefficients,
        after.deeper,
        share,
        tested,
        marked,
    )


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _locate(coefficients, reference, height, width, y, left, right, at, across, down):  # pragma: no cover - compiled
    """Where pixels left .. right of row y lie in a key: the texel at their upper left, and how far they are past it."""
    c, k = coefficients, reference[2]
    v = (np.float32(y) - reference[1]) * k
    a, b, bend = c[0, 0] + v * (c[0, 2] + v * c[0, 5]), (c[0, 1] + v * c[0, 4]) * k, c[0, 3] * k * k
    d, e, sag = c[1, 0] + v * (c[1, 2] + v * c[1, 5]), (c[1, 1] + v * c[1, 4]) * k, c[1, 3] * k * k
    zero, last_x, last_y = np.float32(0), np.float32(width - 1.001), np.float32(height - 1.001)
    for x in range(left, right):
        u = np.float32(x) - reference[0]
        s = min(max(a + u * (b + u * bend), zero), last_x)
        t = min(max(d + u * (e + u * sag), zero), last_y)
        i, j = np.int32(s), np.int32(t)
        at[x] = j * np.int32(width) + i
        across[x] = s - np.float32(i)
        down[x] = t - np.float32(j)


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _add(plane, width, at, across, down, left, right, weight, row):  # pragma: no cover - compiled
    """Add weight x plane, bilinear, to pixels left .. right of a row."""
    one = np.float32(1)
    for x in range(left, right):
        k, p, q = at[x], across[x], down[x]
        below = k + np.uint32(width)
        upper = plane[k] * (one - p) + plane[k + np.uint32(1)] * p
        lower = plane[below] * (one - p) + plane[below + np.uint32(1)] * p
        row[x] += weight * (upper * (one - q) + lower * q)


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _lay(
    pictures,
    depths,
    boxes,
    planes0,
    reference0,
    coefficients0,
    deeper0,
    planes1,
    reference1,
    coefficients1,
    deeper1,
    share,
    tested,
    marked,
):  # pragma: no cover - compiled
    columns = pictures.shape[2]
    light, cover, depth = np.zeros(columns, np.float32), np.zeros(columns, np.float32), np.zeros(columns, np.float32)
    at = np.zeros(columns, np.uint32)
    across, down = np.zeros(columns, np.float32), np.zeros(columns, np.float32)
    zero, half, one = np.float32(0), np.float32(0.5), np.float32(1)
    deep = tested or marked
    flat0, flat1 = planes0.reshape(3, -1), planes1.reshape(3, -1)
    for n in range(len(pictures)):
        top, left, bottom, right = boxes[n]
        w = share[n]
        middle_x, middle_y, k = reference0[n] if w < one else reference1[n]
        deeper = (one - w) * deeper0[n] + w * deeper1[n]
        for y in range(top, bottom):
            light[left:right] = 0
            cover[left:right] = 0
            depth[left:right] = 0
            if w < one:
                height, width = planes0.shape[1:]
                _locate(coefficients0[n], reference0[n], height, width, y, left, right, at, across, down)
                _add(flat0[0], width, at, across, down, left, right, one - w, light)
                _add(flat0[1], width, at, across, down, left, right, one - w, cover)
                if deep:
                    _add(flat0[2], width, at, across, down, left, right, one - w, depth)
            if w > zero:
                height, width = planes1.shape[1:]
                _locate(coefficients1[n], reference1[n], height, width, y, left, right, at, across, down)
                _add(flat1[0], width, at, across, down, left, right, w, light)
                _add(flat1[1], width, at, across, down, left, right, w, cover)
                if deep:
                    _add(flat1[2], width, at, across, down, left, right, w, depth)
            row = pictures[n, y]
            if not deep:
                for x in range(left, right):
                    row[x] = light[x] + max(one - cover[x], zero) * row[x]
                continue
            nearer = deeper[0] + deeper[2] * (np.float32(y) - middle_y) * k
            for x in range(left, right):
                if cover[x] <= zero:
                    continue
                z = depth[x] / cover[x] + nearer + deeper[1] * (np.float32(x) - middle_x) * k
                if tested and z > depths[n, y, x]:
                    continue
                row[x] = light[x] + max(one - cover[x], zero) * row[x]
                if marked and cover[x] > half:
                    depths[n, y, x] = z
