"""How far anything in the picture moves along a course [pixels]: from poses, without a picture.

Of a thing that is moved and turned, the corners of the box about it move fastest.  Where the camera moves, planes
without end and the sky move too: they are met by rays through a grid of pixels.  Shadows, tendons and skins are not
looked at; they follow the bodies.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np

from scenes.mujoco.cameras import Projection
from scenes.mujoco.importing import import_mujoco
from scenes.mujoco.replay import Course, pose_at
from spikecam_env.types import Floats

LARGEST_TURN = 1.0
"""Turn [rad] within which corners are taken to move straight; their arc is at most 4.3 % longer: 0.5 / sin(0.5)."""
SHOWN_GROUPS = 3
"""Groups of geoms that MuJoCo draws unless told otherwise: 0, 1 and 2."""

_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
_RAYS = 5
"""Rays a side of the grid that meets planes and sky."""


class Boxes:
    """The boxes about what is drawn of a model."""

    def __init__(self, model: Any) -> None:
        mujoco = import_mujoco()
        kind = model.geom_type
        drawn = (model.geom_group < SHOWN_GROUPS) & (kind != mujoco.mjtGeom.mjGEOM_PLANE)
        self._geoms = np.flatnonzero(drawn)
        middle, half = model.geom_aabb[drawn, None, :3], model.geom_aabb[drawn, None, 3:]
        self._corners = middle + half * _CORNERS
        textured = (model.mat_texid >= 0).any(axis=1)
        has_texture = (model.geom_matid >= 0) & (np.append(textured, False)[model.geom_matid])
        self._turning = ~((kind == mujoco.mjtGeom.mjGEOM_SPHERE) & ~has_texture)[drawn]
        self._planes = np.flatnonzero((model.geom_group < SHOWN_GROUPS) & (kind == mujoco.mjtGeom.mjGEOM_PLANE))

    def corners(self, data: Any) -> Floats:
        """(things, 8, 3) in the world [m]; a sphere of one colour does not turn."""
        turn = data.geom_xmat.reshape(-1, 3, 3)[self._geoms]
        turn = np.where(self._turning[:, None, None], turn, np.eye(3))
        boxes = self._corners @ turn.transpose(0, 2, 1) + data.geom_xpos[self._geoms, None]
        vertices = data.flexvert_xpos.reshape(-1, 1, 3)
        return np.concatenate([boxes, np.broadcast_to(vertices, (len(vertices), 8, 3))]) if len(vertices) else boxes

    def background(self, data: Any, lens: Projection, shape: tuple[int, int]) -> Floats:
        """(rays, 3) points of planes and sky that the camera sees through a grid of pixels [m]."""
        x, y = np.meshgrid(*(np.linspace(-0.5, side - 0.5, _RAYS) for side in shape[::-1]))
        across = (np.stack([x, y], axis=-1).reshape(-1, 2) - lens.centre) / lens.scale * (1.0, -1.0)
        ones = np.ones((len(across), 1))
        if lens.orthographic:
            origin, direction = np.hstack([across, 0 * ones]) @ lens.axes + lens.eye, lens.axes[2] * ones
        else:
            origin, direction = np.broadcast_to(lens.eye, (len(across), 3)), np.hstack([across, ones]) @ lens.axes
        distance = np.full(len(across), lens.far)
        for plane in self._planes:
            normal = data.geom_xmat[plane].reshape(3, 3)[:, 2]
            with np.errstate(divide="ignore", invalid="ignore"):
                met = ((data.geom_xpos[plane] - origin) @ normal) / (direction @ normal)
            distance = np.where((met > lens.near) & (met < distance), met, distance)
        return np.asarray(origin + distance[:, None] * direction)


def path_lengths(
    model: Any,
    scratch: Any,
    course: Course,
    boxes: Boxes,
    projection: Callable[[Any], Projection],
    shape: tuple[int, int],
) -> tuple[Floats, Floats]:
    """How far the fastest thing in the picture has moved at times along a course.

    Args:
        model: mujoco.MjModel.
        scratch: mujoco.MjData of this model, which is changed.
        course: of a step.
        boxes: of the model.
        projection: the camera as it sees data.
        shape: (rows, columns) of the picture.

    Returns:
        Times (N,) [s], and the length (N,) of the way until then [pixels], from 0; it never falls.
    """
    times = _times(model, course)
    length = np.zeros(len(times))
    seen = None
    for index, time_s in enumerate(times):
        pose_at(model, scratch, course, float(time_s))
        lens, corners = projection(scratch), boxes.corners(scratch)
        if seen is not None:
            moved = _moved(seen, (lens, corners), shape)
            if not _same(seen[0], lens):
                background = boxes.background(scratch, lens, shape)
                moved = max(moved, _moved((seen[0], background[:, None]), (lens, background[:, None]), shape))
            length[index] = length[index - 1] + min(moved, float(np.hypot(*shape)))
        seen = lens, corners
    return times, length


def _times(model: Any, course: Course) -> Floats:
    """Of the course, with more between where joints turn by more than LARGEST_TURN."""
    mujoco = import_mujoco()
    turning = _turning_dofs(model)
    speed = np.empty(model.nv)
    times = [course.time_s[:1]]
    for step in range(len(course.time_s) - 1):
        mujoco.mj_differentiatePos(model, speed, 1.0, course.qpos[step], course.qpos[step + 1])
        parts = max(1, int(np.ceil(np.abs(speed[turning]).sum() / LARGEST_TURN)))
        times.append(np.linspace(course.time_s[step], course.time_s[step + 1], parts + 1)[1:])
    return np.concatenate(times)


def _turning_dofs(model: Any) -> Any:
    """(nv,) bool: degrees of freedom that are angles."""
    mujoco = import_mujoco()
    kind = model.jnt_type[model.dof_jntid]
    place = np.arange(model.nv) - model.jnt_dofadr[model.dof_jntid]
    slides = (kind == mujoco.mjtJoint.mjJNT_SLIDE) | ((kind == mujoco.mjtJoint.mjJNT_FREE) & (place < 3))
    return ~slides


def _moved(before: tuple[Projection, Floats], after: tuple[Projection, Floats], shape: tuple[int, int]) -> float:
    """Farthest that a point of (things, points, 3) moves, of the things that may be in the picture [pixels]."""
    old, new = (lens.in_camera(points) for lens, points in (before, after))
    start, stop = before[0].places(old), after[0].places(new)
    away = np.hypot(*np.moveaxis(stop - start, -1, 0))
    in_front = np.maximum(old[..., 2].max(axis=1), new[..., 2].max(axis=1)) > before[0].near
    ways = np.concatenate([start, stop], axis=1)
    low, high = ways.min(axis=1), ways.max(axis=1)
    inside = (high > -0.5).all(axis=1) & (low < np.array(shape[::-1]) - 0.5).all(axis=1)
    reached = in_front & inside
    return float(away[reached].max(initial=0.0))


def _same(one: Projection, other: Projection) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("eye", "axes", "scale", "centre"))
