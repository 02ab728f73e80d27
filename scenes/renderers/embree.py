"""Ray casting on the processor: needs no OpenGL, only pip.

Embree finds the first triangle that a ray meets.  With the triangle's corners as columns of M, in camera
coordinates, and the ray d = ((x - centre_x) / focal, -(y - centre_y) / focal, -1), shading follows from

    c = M^-1 d,  depth = 1 / sum(c),  barycentric b = c / sum(c),  db/dx = (dc/dx - b sum(dc/dx)) / sum(c)

so the rays' footprint on the texture is exact.  Source: Wald et al., "Embree", ACM ToG 2014 (the rays);
Olano and Greer, "Triangle scan conversion using 2D homogeneous coordinates", 1997 (the rest).
"""

from __future__ import annotations

from math import ceil, floor, log2, sqrt
from weakref import WeakKeyDictionary

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole, Sprite, Surface
from scenes.renderers.pyramid import SHARPER
from scenes.renderers.view import SurfaceArrays, blank, checked, geometry, moved, pasted, reached, to_camera, towards
from spikecam_env.compiled import njit
from spikecam_env.types import Floats, Pictures

RAYS_AT_ONCE = 1 << 18
"""Bounds the memory: about 10 MB, whatever the supersampling."""


class Embree:
    """Back-end by ray casting; see `scenes.renderers.protocol.Renderer`."""

    name = "embree (ray casting on the processor)"

    def __init__(self) -> None:
        self._kept: WeakKeyDictionary[Surface, _Traceable] = WeakKeyDictionary()

    def render(
        self,
        surface: Surface,
        pose: Floats,
        camera: Pinhole,
        lighting: Lighting,
        window: PictureWindow,
        supersample: int = 2,
    ) -> Sprite:
        checked(window, supersample)
        if surface not in self._kept:
            self._kept[surface] = _Traceable(geometry(surface))
        traceable = self._kept[surface]
        shape, matrix = traceable.geometry, to_camera(pose, camera)
        corners = moved(shape.vertices, matrix)
        part = reached(corners, camera, window)
        if part is None:
            return blank(window)
        normals = shape.normals @ np.linalg.inv(pose[:3, :3])
        inverses = _inverses(corners, shape.faces)
        sprite = blank(part)
        strip = max(1, RAYS_AT_ONCE // (part.columns * supersample**2))
        for first in range(0, part.rows, strip):
            rows = slice(first, min(first + strip, part.rows))
            place = (part.left - camera.centre[0], part.top + first - camera.centre[1], 1 / camera.focal)
            _shade(
                traceable.hit(matrix, place, (rows.stop - first, part.columns), supersample),
                place,
                inverses,
                shape.faces,
                normals,
                shape.uv,
                shape.albedo.texels,
                shape.albedo.start,
                shape.albedo.shape,
                SHARPER,
                towards(lighting),
                (lighting.ambient, lighting.intensity, surface.emission),
                sprite.radiance[rows],
                sprite.coverage[rows],
                sprite.depth[rows],
            )
        return pasted(sprite, window)

    def close(self) -> None:
        self._kept.clear()


class _Traceable:
    """A surface in embree, shifted and scaled to a unit cube: embree computes in single precision."""

    def __init__(self, geometry: SurfaceArrays) -> None:
        self.geometry = geometry
        self._middle = (geometry.vertices.min(axis=0) + geometry.vertices.max(axis=0)) / 2
        self._size = np.ptp(geometry.vertices, axis=0).max()
        self._scene = EmbreeScene(robust=True)
        unit = ((geometry.vertices - self._middle) / self._size).astype(np.float32)
        TriangleMesh(self._scene, unit, geometry.faces)

    def hit(
        self, matrix: Floats, place: tuple[float, float, float], size: tuple[int, int], supersample: int
    ) -> NDArray[np.int32]:
        """(rows, columns, rays) the first triangle that each ray meets, -1 for none; `place` as in `_shade`."""
        turn = np.asarray(np.linalg.inv(matrix[:3, :3]), np.float64)
        eye = (-turn @ matrix[:3, 3] - self._middle) / self._size
        origins, directions = _rays(eye, turn, *place, *size, supersample)
        return np.asarray(self._scene.run(origins, directions).reshape(*size, supersample**2))


@njit(cache=True)
def _inverses(corners: Floats, faces: NDArray[np.integer]) -> Floats:
    """(F, 9) M^-1, row by row, of every triangle; zeros for one that is seen from its edge."""
    inverses = np.zeros((len(faces), 3, 3))
    for f in range(len(faces)):
        p, q, r = corners[faces[f, 0]], corners[faces[f, 1]], corners[faces[f, 2]]
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            inverses[f, 0, k] = q[i] * r[j] - q[j] * r[i]
            inverses[f, 1, k] = r[i] * p[j] - r[j] * p[i]
            inverses[f, 2, k] = p[i] * q[j] - p[j] * q[i]
        determinant = p[0] * inverses[f, 0, 0] + p[1] * inverses[f, 0, 1] + p[2] * inverses[f, 0, 2]
        if determinant != 0.0:
            inverses[f] /= determinant
        else:
            inverses[f] = 0.0
    return inverses.reshape(len(faces), 9)


@njit(cache=True)
def _rays(
    eye: Floats, turn: Floats, left: float, top: float, pixel: float, rows: int, columns: int, supersample: int
) -> tuple[Pictures, Pictures]:
    """Origins and directions (N, 3) float32 through the middles of every pixel's cells, pixel after pixel."""
    origins = np.empty((rows * columns * supersample * supersample, 3), np.float32)
    directions = np.empty_like(origins)
    n = 0
    for r in range(rows):
        for c in range(columns):
            for i in range(supersample):
                y = -(top + r + (i + 0.5) / supersample - 0.5) * pixel
                for j in range(supersample):
                    x = (left + c + (j + 0.5) / supersample - 0.5) * pixel
                    for k in range(3):
                        origins[n, k] = eye[k]
                        directions[n, k] = turn[k, 0] * x + turn[k, 1] * y - turn[k, 2]
                    n += 1
    return origins, directions


@njit(cache=True, error_model="numpy")
def _shade(
    hit: NDArray[np.int32],
    place: tuple[float, float, float],
    m: Floats,
    faces: NDArray[np.integer],
    normals: Floats,
    uv: Floats,
    texels: Pictures,
    start: NDArray[np.integer],
    shape: NDArray[np.integer],
    sharper: float,
    lamp: Floats,
    light: tuple[float, float, float],
    radiance: Pictures,
    coverage: Pictures,
    depth: Pictures,
) -> None:
    """Mean radiance and coverage of each pixel's rays, mean depth of those that hit.

    `place` is (x, y) of the first pixel from the camera's axis, and the tangent of one pixel; m is from `_inverses`.
    """
    left, top, pixel = place
    rows, columns, rays = hit.shape
    cells = round(sqrt(rays))
    height, width = shape[0, 0] * pixel / cells, shape[0, 1] * pixel / cells
    ambient, intensity, emission = light
    textured = shape[0, 0] * shape[0, 1] > 1
    albedo = texels[0]
    for r in range(rows):
        for c in range(columns):
            light_sum, depth_sum, count = 0.0, 0.0, 0
            for ray in range(rays):
                f = hit[r, c, ray]
                if f < 0:
                    continue
                x = (left + c + (ray % cells + 0.5) / cells - 0.5) * pixel
                y = -(top + r + (ray // cells + 0.5) / cells - 0.5) * pixel
                m00, m01, m10, m11, m20, m21 = m[f, 0], m[f, 1], m[f, 3], m[f, 4], m[f, 6], m[f, 7]
                c0 = m00 * x + m01 * y - m[f, 2]
                c1 = m10 * x + m11 * y - m[f, 5]
                c2 = m20 * x + m21 * y - m[f, 8]
                total = c0 + c1 + c2
                if total <= 0.0:
                    continue
                z = 1.0 / total
                v0, v1, v2 = faces[f, 0], faces[f, 1], faces[f, 2]
                b0, b1, b2 = c0 * z, c1 * z, c2 * z
                nx = b0 * normals[v0, 0] + b1 * normals[v1, 0] + b2 * normals[v2, 0]
                ny = b0 * normals[v0, 1] + b1 * normals[v1, 1] + b2 * normals[v2, 1]
                nz = b0 * normals[v0, 2] + b1 * normals[v1, 2] + b2 * normals[v2, 2]
                cosine = (nx * lamp[0] + ny * lamp[1] + nz * lamp[2]) / max(sqrt(nx * nx + ny * ny + nz * nz), 1e-30)
                if textured:
                    u = b0 * uv[v0, 0] + b1 * uv[v1, 0] + b2 * uv[v2, 0]
                    v = b0 * uv[v0, 1] + b1 * uv[v1, 1] + b2 * uv[v2, 1]
                    # (u, v) = (sum c uv) / (sum c), hence d(u, v)/dx = (sum m uv - (u, v) sum m) z
                    ux = (m00 * uv[v0, 0] + m10 * uv[v1, 0] + m20 * uv[v2, 0]) * z
                    vx = (m00 * uv[v0, 1] + m10 * uv[v1, 1] + m20 * uv[v2, 1]) * z
                    uy = (m01 * uv[v0, 0] + m11 * uv[v1, 0] + m21 * uv[v2, 0]) * z
                    vy = (m01 * uv[v0, 1] + m11 * uv[v1, 1] + m21 * uv[v2, 1]) * z
                    sx = (m00 + m10 + m20) * z
                    sy = (m01 + m11 + m21) * z
                    ax, ay = (ux - u * sx) * width, (vx - v * sx) * height
                    bx, by = (uy - u * sy) * width, (vy - v * sy) * height
                    longest = max(sqrt(max(ax * ax + ay * ay, bx * bx + by * by)), 1e-30)
                    side = max(abs(ax * by - ay * bx) / longest, longest / 2)
                    albedo = _read(texels, start, shape, u, v, log2(side) + sharper)
                light_sum += albedo * (ambient + intensity * max(0.0, cosine)) + emission
                depth_sum += z
                count += 1
            if count > 0:
                radiance[r, c] = light_sum / rays
                coverage[r, c] = count / rays
                depth[r, c] = depth_sum / count


@njit(cache=True)
def _read(
    texels: Pictures, start: NDArray[np.integer], shape: NDArray[np.integer], u: float, v: float, fineness: float
) -> float:
    """Texture at (u, v), blended between the two levels next to `fineness`."""
    fineness = min(max(fineness, 0.0), len(start) - 1.0)
    level = min(int(fineness), max(len(start) - 2, 0))
    blend = fineness - level
    value = _bilinear(texels, start[level], shape[level, 0], shape[level, 1], u, v)
    if blend > 0.0:
        coarse = _bilinear(texels, start[level + 1], shape[level + 1, 0], shape[level + 1, 1], u, v)
        value += blend * (coarse - value)
    return float(value)


@njit(cache=True)
def _bilinear(texels: Pictures, start: int, height: int, width: int, u: float, v: float) -> float:
    """One level, repeated without end; row 0 is at v = 1."""
    x = (u - floor(u)) * width - 0.5
    y = (ceil(v) - v) * height - 0.5
    left, top = floor(x), floor(y)
    dx, dy = x - left, y - top
    right, bottom = (left + 1) % width, (top + 1) % height
    left, top = left % width, top % height
    upper = texels[start + top * width + left] * (1 - dx) + texels[start + top * width + right] * dx
    lower = texels[start + bottom * width + left] * (1 - dx) + texels[start + bottom * width + right] * dx
    return float(upper * (1 - dy) + lower * dy)
