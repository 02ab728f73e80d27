"""Parts with normals and texture coordinates, put together to one rigid surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from scenes.renderers.protocol import Surface
from scenes.renderers.ramp import places, ramp
from scenes.textures import Texture
from scenes.trajectories import Trajectory
from spikecam_env.errors import InputError
from spikecam_env.types import Floats

Albedo = float | Texture
"""Share of light that a surface throws back: one for all of it, or a texture of it, in [0, 1]."""
Points = Floats


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a surface: triangles, and their albedo.

    Example:
        >>> disc(0.5).scaled(2.0).vertices.max(axis=0).round(6).tolist()
        [1.0, 1.0, 0.0]
    """

    vertices: Points
    normals: Points
    """(V, 3), as the vertices."""
    uv: Points
    """(V, 2); v = 1 is the top of the texture."""
    faces: NDArray[np.int64]
    """(F, 3)"""
    albedo: Albedo = 0.8
    """0..1, linear: one value, one for each vertex (V,), or a texture (h, w)."""

    def moved(self, by: Trajectory) -> Part:
        """Turned and shifted as a trajectory is at time 0."""
        pose = by.pose(0.0)
        return replace(
            self, vertices=self.vertices @ pose[:3, :3].T + pose[:3, 3], normals=self.normals @ pose[:3, :3].T
        )

    def scaled(self, factor: ArrayLike) -> Part:
        """By a positive factor, or one for each axis."""
        factors = np.broadcast_to(np.asarray(factor, np.float64), 3)
        normals = self.normals / factors
        return replace(self, vertices=self.vertices * factors, normals=unit_vectors(normals))


def assemble(*parts: Part) -> Surface:
    """One rigid surface; textures and greys of several parts go into one atlas, greys and albedos of vertices into one
    for each vertex.

    Example:
        >>> len(assemble(*box((1.0, 1.0, 1.0)), disc(0.4)).mesh.faces)
        108
    """
    if not parts:
        raise InputError("a surface needs at least one part")
    if len(parts) == 1:
        return _surface(parts[0])
    kinds = {np.ndim(part.albedo) for part in parts}
    if 1 in kinds and 2 not in kinds:
        of_vertices = [np.broadcast_to(np.float32(part.albedo), len(part.vertices)) for part in parts]
        return _surface(joined(parts, [part.uv for part in parts], np.concatenate(of_vertices)))
    parts = tuple(_on_a_tile(part) if np.ndim(part.albedo) == 1 else part for part in parts)
    atlas, corners = _atlas([part.albedo for part in parts])
    uv = [corner[:2] + part.uv * corner[2:] for part, corner in zip(parts, corners, strict=True)]
    return _surface(joined(parts, uv, atlas))


def joined(parts: Sequence[Part], uv: Sequence[Points], albedo: Albedo) -> Part:
    """Parts as one, with these texture coordinates (V, 2) of each and one albedo."""
    start = np.cumsum([0, *(len(part.vertices) for part in parts)])
    return Part(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate(uv),
        np.concatenate([part.faces + first for part, first in zip(parts, start, strict=False)]),
        albedo,
    )


_TILE = np.repeat(ramp(16), 16, axis=0)
"""Albedos of vertices among textures, known to 3e-4 (1/256 of the way between texels).  It is as small as its margin,
so that coarse reading stays in it."""


def _on_a_tile(part: Part) -> Part:
    return replace(part, uv=places(part.albedo, _TILE.shape[1]), albedo=_TILE)


def _surface(part: Part) -> Surface:
    mesh = trimesh.Trimesh(part.vertices, part.faces, vertex_normals=part.normals, process=False)
    mesh.visual = trimesh.visual.TextureVisuals(uv=part.uv)
    return Surface(mesh, part.albedo)


def _atlas(albedos: Sequence[Albedo]) -> tuple[Texture, list[Floats]]:
    """All in one texture, shelf by shelf, each with a margin of its edge; and the places (u, v, width, height)."""
    tiles = {id(a): np.full((4, 4), a, np.float32) if np.ndim(a) == 0 else np.asarray(a, np.float32) for a in albedos}
    order = sorted(tiles, key=lambda name: -tiles[name].shape[0])
    width = max(256, *(tile.shape[1] + 2 * _MARGIN for tile in tiles.values()))
    x = y = shelf = 0
    corner = {}
    for name in order:
        rows, columns = (side + 2 * _MARGIN for side in tiles[name].shape)
        if x + columns > width:
            x, y, shelf = 0, y + shelf, 0
        corner[name] = (x, y)
        x, shelf = x + columns, max(shelf, rows)
    height = y + shelf
    atlas = np.zeros((height, width), np.float32)
    for name, (x, y) in corner.items():
        padded = np.pad(tiles[name], _MARGIN, mode="edge")
        atlas[y : y + padded.shape[0], x : x + padded.shape[1]] = padded
    places = []
    for albedo in albedos:
        (x, y), (rows, columns) = corner[id(albedo)], tiles[id(albedo)].shape
        left, top = x + _MARGIN, y + _MARGIN
        places.append(np.array([left / width, 1 - (top + rows) / height, columns / width, rows / height]))
    return atlas, places


_MARGIN = 8
"""Texels around a tile of an atlas, so that coarse readings do not see the next one."""


def unit_vectors(vectors: Points) -> Points:
    """Vectors (..., 3) of length 1; zero stays zero."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))
