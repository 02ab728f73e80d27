"""Meshes: shapes as parts, to be put together to surfaces (`scenes.surfaces.assembly`); and your own mesh or picture
(`scenes.surfaces.mesh_files`).

    assemble(lathe(profile, picture), box((1, 1, 1), 0.2).moved(Still((0, 2, 0))))  # one rigid surface
    from_file("teapot.obj", texture="wood.jpg", size=1.0)  # your own

Every part is a grid of points, so that normals are smooth along it and break where two parts meet.
Faces look outward; light is Lambert's, so a sheet has a front and a back, a little apart.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.film.transfer import linear_from_srgb as linear
from scenes.surfaces.assembly import Albedo, Part, Points, assemble, joined, unit_vectors
from scenes.surfaces.mesh_files import from_file, from_mesh, picture
from spikecam_env.errors import InputError

__all__ = [
    "Albedo",
    "Part",
    "assemble",
    "box",
    "capsule",
    "disc",
    "from_file",
    "from_mesh",
    "lathe",
    "linear",
    "picture",
    "prism",
    "rectangle",
    "sheet",
    "sphere",
    "torus",
]

# -- parts -----------------------------------------------------------------------------------------------------


def sheet(points: Callable[[Points, Points], Sequence[Points]], shape: tuple[int, int], albedo: Albedo = 0.8) -> Part:
    """A smooth grid: points(u, v) -> x, y, z, for u, v in [0, 1], u to the right and v up as seen from outside.

    Args:
        shape: cells along v and u.

    Example:
        >>> sheet(lambda u, v: (u, v, 0 * u), (4, 2)).vertices.shape
        (15, 3)
    """
    rows, columns = shape

    def at(u: Points, v: Points) -> Points:
        return np.stack(np.broadcast_arrays(*points(u, v)), -1).astype(np.float64)

    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    small = 1e-4
    inner_u, inner_v = np.clip(u, small, 1 - small), np.clip(v, small, 1 - small)
    normals = np.cross(
        at(inner_u + small, inner_v) - at(inner_u - small, inner_v),
        at(inner_u, inner_v + small) - at(inner_u, inner_v - small),
    )
    corner = np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)
    a, b, c, d = (corner + step for step in (0, 1, columns + 2, columns + 1))
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    vertices = at(u, v).reshape(-1, 3)
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
    faces = faces[area > 1e-9 * area.max()]
    uv = np.stack([u, v], -1).reshape(-1, 2)
    return Part(vertices, unit_vectors(normals.reshape(-1, 3)), uv, faces, albedo)


def lathe(
    profile: Sequence[tuple[float, float]], albedo: Albedo = 0.8, sections: int = 48, smooth: bool = True
) -> Part:
    """A profile of (radius, height), from the bottom up along the outside, turned about y.

    The texture goes round once, from the bottom to the top of the profile.

    Args:
        smooth: a curve through the points (Catmull-Rom), else straight pieces with edges between.

    Example:
        >>> lathe([(0.0, 0.0), (0.5, 0.5), (0.0, 1.0)]).vertices.round(6).max(axis=0).tolist()
        [0.5, 1.0, 0.5]
    """
    knots = np.asarray(profile, np.float64)
    if not smooth:
        pieces = [_turned(knots[i : i + 2], albedo, sections, 1) for i in range(len(knots) - 1)]
        length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=-1))])
        length /= length[-1]
        uv = [
            np.stack([piece.uv[:, 0], low + piece.uv[:, 1] * (high - low)], -1)
            for piece, low, high in zip(pieces, length, length[1:], strict=False)
        ]
        return joined(pieces, uv, albedo)
    return _turned(knots, albedo, sections, 4 * (len(knots) - 1))


def sphere(radius: float = 1.0, albedo: Albedo = 0.8, sections: int = 64) -> Part:
    """u is the longitude, v the latitude.

    Example:
        >>> sphere(2.0).vertices.max(axis=0).round(6).tolist()
        [2.0, 2.0, 2.0]
    """

    def points(u: Points, v: Points) -> Sequence[Points]:
        longitude, latitude = 2 * np.pi * u, np.pi * (v - 0.5)
        ring = radius * np.cos(latitude)
        return ring * np.sin(longitude), radius * np.sin(latitude), ring * np.cos(longitude)

    return sheet(points, (sections // 2, sections), albedo)


def torus(radius: float, thickness: float, albedo: Albedo = 0.8, sections: int = 64) -> Part:
    """A ring about y; `thickness` is the radius of the tube.

    Example:
        >>> torus(1.0, 0.25).vertices.max(axis=0).round(2).tolist()
        [1.25, 0.25, 1.25]
    """

    def points(u: Points, v: Points) -> Sequence[Points]:
        around, across = 2 * np.pi * u, 2 * np.pi * v
        ring = radius + thickness * np.cos(across)
        return ring * np.sin(around), thickness * np.sin(across), ring * np.cos(around)

    return sheet(points, (max(8, sections // 2), sections), albedo)


def capsule(length: float, radius: float, albedo: Albedo = 0.8, sections: int = 32, taper: float = 1.0) -> Part:
    """A rounded stick along y from 0 to `length` between the middles of its ends; taper: radius of the upper end.

    Example:
        >>> round(float(capsule(1.0, 0.2).vertices[:, 1].max()), 3)
        1.2
    """
    bend = np.linspace(-np.pi / 2, 0, 6)
    lower = [(radius * np.cos(a), radius * np.sin(a)) for a in bend]
    upper = [(taper * radius * np.cos(a), length - taper * radius * np.sin(a)) for a in bend[::-1]]
    knots = np.asarray([*lower, *upper])
    return _turned(knots, albedo, sections, 3 * (len(knots) - 1), straight=True)


def disc(radius: float, albedo: Albedo = 0.8, sections: int = 96) -> Part:
    """In the plane z = 0, facing +z; the texture is the square around it.

    Example:
        >>> disc(0.5).normals[0].tolist()
        [0.0, 0.0, 1.0]
    """
    turn = 2 * np.pi * np.arange(sections) / sections
    rim = np.stack([np.cos(turn), np.sin(turn)], -1)
    flat = np.concatenate([np.zeros((1, 2)), rim])
    following = 1 + (np.arange(sections) + 1) % sections
    faces = np.stack([np.zeros(sections, np.int64), 1 + np.arange(sections), following], -1)
    vertices = np.concatenate([radius * flat, np.zeros((len(flat), 1))], -1)
    return Part(vertices, np.tile([0.0, 0, 1], (len(flat), 1)), (flat + 1) / 2, faces, albedo)


def rectangle(width: float, height: float, albedo: Albedo = 0.8, cells: int = 1) -> Part:
    """In the plane z = 0, facing +z, the middle at the origin.

    Example:
        >>> rectangle(2.0, 1.0).vertices[:, :2].tolist()
        [[-1.0, -0.5], [1.0, -0.5], [-1.0, 0.5], [1.0, 0.5]]
    """
    return sheet(lambda u, v: ((u - 0.5) * width, (v - 0.5) * height, 0 * u), (cells, cells), albedo)


def box(extents: tuple[float, float, float], albedo: Albedo | Sequence[Albedo] = 0.8, cells: int = 1) -> list[Part]:
    """Six rectangles: front (+z), right (+x), back, left, top (+y), bottom; an albedo for all or for each.

    Example:
        >>> len(box((1.0, 2.0, 3.0)))
        6
    """
    sides: list[Any] = list(albedo) if isinstance(albedo, (list, tuple)) else [albedo] * 6
    if len(sides) != 6:
        raise InputError(f"a box got {len(sides)} albedos; it takes one, or six")
    width, height, depth = extents
    turns = [(0, 0), (0, 90), (0, 180), (0, 270), (-90, 0), (90, 0)]
    sizes = [(width, height, depth), (depth, height, width)] * 2 + [(width, depth, height)] * 2
    parts = []
    for (about_x, about_y), (across, up, out), side in zip(turns, sizes, sides, strict=True):
        face = rectangle(across, up, side, cells)
        parts.append(_placed(replace(face, vertices=face.vertices + np.array([0, 0, out / 2])), about_x, about_y))
    return parts


def prism(outline: Sequence[tuple[float, float]], depth: float, side: Albedo = 0.8, face: Albedo = 0.8) -> list[Part]:
    """A polygon in x, y (counter-clockwise) drawn out along z by `depth`, its middle at z = 0.

    The faces' texture spans the outline's bounding box; the sides are one grey.

    Example:
        >>> len(prism([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], depth=0.5))
        5
    """
    corners = np.asarray(outline, np.float64)
    triangles = _triangulated(corners)
    low, size = corners.min(0), np.ptp(corners, axis=0)
    uv = (corners - low) / size
    front = np.concatenate([corners, np.full((len(corners), 1), depth / 2)], -1)
    ahead = np.tile([0.0, 0, 1], (len(corners), 1))
    parts = [
        Part(front, ahead, uv, triangles, face),
        Part(front * [1, 1, -1], -ahead, uv, triangles[:, ::-1], face),
    ]
    for a, b in zip(corners, np.roll(corners, -1, 0), strict=True):
        parts.append(sheet(partial(_between, a, b, depth), (1, 1), side))
    return parts


# -- helpers ---------------------------------------------------------------------------------------------------


def _between(a: Points, b: Points, depth: float, u: Points, v: Points) -> Sequence[Points]:
    """The wall of a prism from corner a to corner b."""
    return a[0] + u * (b[0] - a[0]), a[1] + u * (b[1] - a[1]), depth * (v - 0.5)


def _turned(knots: Points, albedo: Albedo, sections: int, pieces: int, straight: bool = False) -> Part:
    """A curve through knots (radius, height), turned about y."""
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=-1))])
    length /= length[-1]
    slope = np.gradient(knots, length, axis=0) if len(knots) > 2 else None

    def curve(v: Points) -> Points:
        if straight or slope is None:
            return np.stack([np.interp(v, length, knots[:, k]) for k in (0, 1)], -1)
        i = np.clip(np.searchsorted(length, v, "right") - 1, 0, len(knots) - 2)
        h = (length[i + 1] - length[i])[..., None]
        t = ((v - length[i])[..., None] / h).clip(0, 1)
        return np.asarray(
            (1 + 2 * t) * (1 - t) ** 2 * knots[i]
            + t * (1 - t) ** 2 * h * slope[i]
            + t**2 * (3 - 2 * t) * knots[i + 1]
            + t**2 * (t - 1) * h * slope[i + 1]
        )

    def points(u: Points, v: Points) -> Sequence[Points]:
        radius, height = np.moveaxis(curve(v), -1, 0)
        radius = np.maximum(radius, 1e-6)
        return radius * np.sin(2 * np.pi * u), height, radius * np.cos(2 * np.pi * u)

    return sheet(points, (max(pieces, 1), sections), albedo)


def _triangulated(corners: Points) -> NDArray[np.int64]:
    """Triangles of a simple polygon, by cutting ears."""
    left, triangles = list(range(len(corners))), []

    def turn(a: int, b: int, c: int) -> float:
        (ax, ay), (bx, by), (cx, cy) = corners[[a, b, c]]
        return float((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))

    while len(left) > 3:
        for k, b in enumerate(left):
            a, c = left[k - 1], left[(k + 1) % len(left)]
            others = [p for p in left if p not in (a, b, c)]
            if turn(a, b, c) > 0 and not any(
                turn(a, b, p) >= 0 and turn(b, c, p) >= 0 and turn(c, a, p) >= 0 for p in others
            ):
                triangles.append((a, b, c))
                left.pop(k)
                break
        else:
            raise InputError("the outline of a prism must be a simple polygon, counter-clockwise")
    return np.array([*triangles, tuple(left)], np.int64)


def _placed(part: Part, about_x: float, about_y: float) -> Part:
    sx, cx = np.sin(np.radians(about_x)), np.cos(np.radians(about_x))
    sy, cy = np.sin(np.radians(about_y)), np.cos(np.radians(about_y))
    turn = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]]) @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    return replace(part, vertices=part.vertices @ turn.T, normals=part.normals @ turn.T)
