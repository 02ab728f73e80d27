"""Where a body is seen: points that stand for its surface, boxes of pixels around it, windows to render."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from scenes.renderers.protocol import PictureWindow
from scenes.world.carried import project
from spikecam_env.types import Floats

PROBES = 256
"""Points of a body's surface that stand for it in the plan."""

DIRECTIONS = 100
"""In which a body's farthest points are sought: on a ball they stand in for its outline to 2 %."""

FAR = 1 << 20
"""Half a side of the box of a body that reaches behind the camera [pixels]."""

Boxes = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Probe:
    """Points (J, 3) of the surface with normals, and those farthest out in many directions (E, 3)."""

    points: Floats
    normals: Floats
    extreme: Floats


def probe_of(mesh: trimesh.Trimesh) -> Probe:
    """The same for the same mesh, every time."""
    points, faces, *_ = trimesh.sample.sample_surface(mesh, PROBES, seed=0)
    corners = trimesh.triangles.points_to_barycentric(mesh.triangles[faces], points)
    normals = (np.asarray(mesh.vertex_normals)[mesh.faces[faces]] * corners[..., None]).sum(1)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9)
    vertices = np.asarray(mesh.vertices, np.float64)
    return Probe(np.asarray(points), normals, vertices[np.unique((vertices @ _directions().T).argmax(0))])


def _directions() -> Floats:
    """(DIRECTIONS, 3) of length 1, evenly over the sphere."""
    turn = np.pi * (1 + np.sqrt(5)) * np.arange(DIRECTIONS)
    z = 1 - (2 * np.arange(DIRECTIONS) + 1) / DIRECTIONS
    around = np.sqrt(1 - z * z)
    return np.stack([around * np.cos(turn), around * np.sin(turn), z], -1)


def extent(extreme: Floats, view: Floats, focal: float, centre: Floats) -> Boxes:
    """Boxes (n, 4) of pixels around these points: top, left, bottom, right; wide if some are behind."""
    pixels, depth = project(view, extreme, focal, (0.0, 0.0))
    pixels = pixels + centre[:, None]
    low, high = pixels.min(1), pixels.max(1)
    slack = 3 + 0.02 * (high - low)
    box = np.concatenate([low - slack, high + slack], -1)[:, [1, 0, 3, 2]]
    ahead = depth > 1e-3 * np.abs(depth).max(1, keepdims=True)
    box[~ahead.all(1)] = [-FAR, -FAR, FAR, FAR]
    box[~ahead.any(1)] = 0
    return np.clip(np.round(box), -FAR, FAR).astype(np.int64)


def window_around(box: Boxes, shape: tuple[int, int], margin: int) -> PictureWindow:
    """The part of a box (4,) that lies in the picture or `margin` pixels around it."""
    low = np.maximum(box[:2], -margin)
    high = np.minimum(box[2:], np.asarray(shape) + margin)
    size = np.maximum(high - low, 0)
    return PictureWindow(int(low[0]), int(low[1]), int(size[0]), int(size[1]))


def boxes_overlap(a: tuple[int, ...], b: tuple[int, ...]) -> bool:
    """Whether two boxes (top, left, bottom, right) share a pixel."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
