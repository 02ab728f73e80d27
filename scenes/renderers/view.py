"""Preparation for every back-end: a surface as checked arrays, and the part of the window it can reach.

Nothing here knows of OpenGL or of rays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole, Sprite, Surface
from scenes.renderers.pyramid import Pyramid, pyramid
from scenes.renderers.ramp import places, ramp_level
from spikecam_env.errors import InputError
from spikecam_env.types import Floats

ROUNDING = 1e-5
"""By which luminance in single precision may exceed 1."""
NEAREST = 1e-3
"""Share of the farthest vertex's distance at which OpenGL begins to see a surface; it cuts nearer parts away."""


@dataclass(frozen=True)
class SurfaceArrays:
    """A surface as arrays."""

    vertices: Floats
    normals: Floats
    """(V, 3) float64."""
    uv: Floats
    """(V, 2) float64; zeros where the albedo is one value, places on the ramp where it is one for each vertex."""
    faces: NDArray[np.int32]
    """(F, 3) int32."""
    albedo: Pyramid
    """The texture and its reductions; one texel where the albedo is one value."""
    closed: bool
    """Whether the mesh bounds a volume, faces outwards: from outside only front faces are seen."""


def geometry(surface: Surface) -> SurfaceArrays:
    """A surface as checked arrays.

    Raises:
        InputError: `check_mesh` refuses the mesh, a texture has no uv, or the albedo is not one value, (V,) or (h, w),
            in 0 to 1.
    """
    mesh = surface.mesh
    check_mesh(mesh)
    albedo = np.asarray(surface.albedo, np.float32)
    if albedo.ndim > 2 or albedo.size == 0 or (albedo.ndim == 1 and len(albedo) != len(mesh.vertices)):
        raise InputError(
            f"albedo has shape {albedo.shape}; give one value, one for each of the {len(mesh.vertices)} vertices, or a "
            "finite texture (h, w), a colour picture as grey"
        )
    check_albedo(albedo, "albedo")
    uv: Any = getattr(mesh.visual, "uv", None)
    if albedo.ndim == 2 and (uv is None or len(uv) != len(mesh.vertices)):
        raise InputError(
            "a surface has a texture but its mesh no texture coordinates; set mesh.visual = "
            "trimesh.visual.TextureVisuals(uv=(V, 2) array), or give albedo as one value"
        )
    if albedo.ndim == 2 and not np.isfinite(uv).all():
        raise InputError("texture coordinates of the mesh hold NaN or infinity; they must be finite")
    if albedo.ndim == 2:
        uv = np.array(uv, np.float64)[:, :2]
    else:
        uv = places(albedo) if albedo.ndim == 1 else np.zeros((len(mesh.vertices), 2))
    return SurfaceArrays(
        vertices=np.array(mesh.vertices, np.float64),
        normals=np.array(mesh.vertex_normals, np.float64),
        uv=uv,
        faces=np.array(mesh.faces, np.int32),
        albedo=ramp_level() if albedo.ndim == 1 else pyramid(np.atleast_2d(albedo)),
        closed=_closed(mesh),
    )


def check_mesh(mesh: trimesh.Trimesh) -> None:
    """Refuse a mesh without triangles or area, with vertices that are not finite, or faces of missing vertices."""
    faces = np.asarray(mesh.faces)
    if len(faces) == 0:
        raise InputError("the mesh of a surface has no triangles; give one with faces")
    vertices = np.asarray(mesh.vertices)
    if vertices.shape[1:] != (3,) or faces.shape[1:] != (3,):
        raise InputError(f"the mesh has vertices {vertices.shape} and faces {faces.shape}; both must be (N, 3)")
    bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(bad):
        raise InputError(f"{len(bad)} vertices are not finite, the first is {bad[0]}: {vertices[bad[0]]}; remove them")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(
            f"faces name vertices {faces.min()} to {faces.max()}; the mesh has {len(vertices)}, counted from 0"
        )
    corners = vertices[faces]
    with np.errstate(over="ignore", invalid="ignore"):
        corners = (corners - corners.min(axis=(0, 1))) / (np.ptp(corners, axis=(0, 1)).max() or 1.0)
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if not np.abs(area).max() > 0:
        raise InputError("the mesh has no area: every triangle is a line or a point")


def check_albedo(albedo: ArrayLike, name: str) -> None:
    """Refuse values out of 0 to 1, but for their rounding; the message begins with `name`."""
    values = np.asarray(albedo)
    low, high = values.min(), values.max()
    if not (low >= 0 and high <= 1 + ROUNDING):
        raise InputError(
            f"{name} runs from {low:g} to {high:g}; a surface reflects 0 to 1 of the light, finite.  Scale it, or give "
            "light of its own as emission"
        )


def to_camera(pose: Floats, camera: Pinhole) -> Floats:
    """(4, 4): a surface's coordinates to the camera's.

    Raises:
        InputError: a pose has no inverse.
    """
    for name, matrix in (("pose", pose), ("camera.pose", camera.pose)):
        if np.shape(matrix) != (4, 4) or not np.isfinite(matrix).all() or np.linalg.det(matrix) == 0:
            raise InputError(f"{name} is\n{np.asarray(matrix)}\nit must be a (4, 4) matrix that can be inverted")
    return np.linalg.inv(camera.pose) @ pose


def moved(points: Floats, matrix: Floats) -> Floats:
    """Points (N, 3) through a (4, 4) matrix."""
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3])


def reached(vertices: Floats, camera: Pinhole, window: PictureWindow) -> PictureWindow | None:
    """The part of the window that these vertices (N, 3) in camera coordinates can cover; None where none."""
    distance = -vertices[:, 2]
    if distance.max() <= 0:
        return None
    if distance.min() <= NEAREST * distance.max():
        return window
    x = camera.centre[0] + camera.focal * vertices[:, 0] / distance
    y = camera.centre[1] - camera.focal * vertices[:, 1] / distance
    left, right = _overlap(x, window.left, window.columns)
    top, bottom = _overlap(y, window.top, window.rows)
    return PictureWindow(top, left, bottom - top, right - left) if top < bottom and left < right else None


def towards(lighting: Lighting) -> Floats:
    """(3,) unit vector to the lamp.

    Raises:
        InputError: the direction is zero.
    """
    direction = np.asarray(lighting.towards, np.float64)
    length = np.linalg.norm(direction)
    if direction.shape != (3,) or not 0 < length < np.inf:
        raise InputError(f"lighting.towards is {lighting.towards}; it must be three numbers, not all of them zero")
    return np.asarray(direction / length)


def blank(window: PictureWindow) -> Sprite:
    """A sprite that covers nothing."""
    size = (window.rows, window.columns)
    return Sprite(window, np.zeros(size, np.float32), np.zeros(size, np.float32), np.full(size, np.inf, np.float32))


def pasted(part: Sprite, window: PictureWindow) -> Sprite:
    """A sprite of a window, of which only a part was drawn."""
    if part.window == window:
        return part
    whole = blank(window)
    top, left = part.window.top - window.top, part.window.left - window.left
    inside = np.s_[top : top + part.window.rows, left : left + part.window.columns]
    whole.radiance[inside], whole.coverage[inside], whole.depth[inside] = part.radiance, part.coverage, part.depth
    return whole


def checked(window: PictureWindow, supersample: int) -> None:
    """Refuse an empty window, and no rays."""
    if window.rows < 1 or window.columns < 1:
        raise InputError(f"the window has {window.rows} rows and {window.columns} columns; it needs some of each")
    if supersample < 1:
        raise InputError(f"supersample is {supersample}; it must be at least 1 ray a pixel and axis")


def _closed(mesh: trimesh.Trimesh) -> bool:
    """Whether it bounds a volume once the seams of texture and shading are sewn up."""
    sewn = trimesh.Trimesh(mesh.vertices, mesh.faces)
    return bool(sewn.is_volume)


def _overlap(positions: Floats, first: int, count: int) -> tuple[int, int]:
    """Pixels [start, stop) of a row of `count` that an interval of positions touches."""
    low = np.clip(np.floor(positions.min() + 0.5), first, first + count)
    high = np.clip(np.floor(positions.max() + 0.5) + 1, first, first + count)
    return int(low), int(high)
