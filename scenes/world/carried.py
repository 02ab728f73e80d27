"""The motion of a body's points from a key to any instant near it, as numbers for compiled code.

The motion is summed up by a polynomial of second degree from picture to sprite,

    s = C (1, u, v, u^2, u v, v^2),   (u, v): the pixel relative to the points' middle, in units of their spread

fitted by least squares: exact for planes seen in parallel, and close for the dome that a ball is.  The motion itself,
by depth, is kept beside it:

    s' = K (R z K^-1 x + t),   K: lenses, (R, t): from the camera now to the camera at the key
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from scenes.world.body_key import DENSITY, BodyKey
from spikecam_env.compiled import njit
from spikecam_env.types import Floats, Pictures

RIDGE = 1e-4
"""Weight, against one point, that keeps the turn and bend of a sprite seen in few points at rest."""


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
