"""A renderer draws one surface at one pose, seen by a pinhole camera, as a picture of linear light.

World and camera follow OpenGL: the camera looks along its -z, x to the right, y up.  Pictures follow
`scenes.protocol`: x to the right, y down, pixel (r, c) has its centre at (x, y) = (c, r).  A point (X, Y, Z)
in camera coordinates, Z < 0, is seen at

    x = centre_x + focal X / -Z,  y = centre_y - focal Y / -Z.  Light is Lambert's:

    radiance = albedo (ambient + intensity max(0, n . towards)) + emission        n: interpolated vertex normal
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import trimesh

from spikecam_env.renamed import old_names
from spikecam_env.types import Floats, Pictures


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh and its reflection.  Compared by identity, so that a back-end may keep its own form of it."""

    mesh: trimesh.Trimesh
    """In its own coordinates, with `visual.uv` where albedo is a texture."""
    albedo: float | Pictures = 0.8
    """0..1, linear: one value, one for each vertex (V,), linear between them, or a texture (h, w) float32; row 0 is the
    top, v = 1."""
    emission: float = 0.0
    """Radiance that the surface gives by itself."""

    @cached_property
    def middle(self) -> Floats:
        """(3,) of the box about the mesh."""
        return np.asarray(self.mesh.bounds.mean(axis=0))

    def __deepcopy__(self, memo: dict[int, Any]) -> Surface:
        """Itself: nothing changes a surface, and trimesh loses a mesh's given normals when it copies it."""
        return self


@dataclass(frozen=True, eq=False)
class Pinhole:
    """A camera without distortion."""

    focal: float
    """[pixels]"""
    centre: tuple[float, float]
    """(x, y) [pixels]"""
    pose: Floats
    """(4, 4) camera to world."""


@dataclass(frozen=True)
class Lighting:
    """Ambient radiance, and one distant lamp: its intensity and the direction towards it, in the world."""

    ambient: float = 0.3
    intensity: float = 0.7
    towards: tuple[float, float, float] = (0.3, 0.8, 0.6)


@dataclass(frozen=True)
class PictureWindow:
    """A part of the picture: rows top .. top + rows - 1, columns left .. left + columns - 1; may lie outside it."""

    top: int
    left: int
    rows: int
    columns: int


@dataclass(frozen=True)
class Sprite:
    """A surface alone, cut to a window."""

    window: PictureWindow
    radiance: Pictures
    """(rows, columns) float32, premultiplied: light times coverage."""
    coverage: Pictures
    """(rows, columns) float32 in [0, 1], share of the pixel that the surface covers."""
    depth: Pictures
    """(rows, columns) float32, distance along the camera's axis; inf where nothing is covered."""


class Renderer(Protocol):
    """A back-end."""

    @property
    def name(self) -> str:
        """Its name in the log, e.g. "EGL (llvmpipe)"."""
        ...

    def render(
        self,
        surface: Surface,
        pose: Floats,
        camera: Pinhole,
        lighting: Lighting,
        window: PictureWindow,
        supersample: int = 2,
    ) -> Sprite:
        """The surface at `pose` (4, 4: its coordinates to the world), averaged over supersample x supersample rays a
        pixel."""
        ...

    def close(self) -> None:
        """Release the memory and the context of the back-end."""
        ...


__getattr__ = old_names(__name__, {"Window": "PictureWindow"})
