"""Ground truth of a world at an instant: every body rendered at that very instant, and the flow from the motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from scenes.protocol import Gaze, Truth
from scenes.trajectories import Still
from scenes.world.cache import WorldCache
from scenes.world.plan import BlockPlan
from scenes.world.sky import sky
from scenes.world.spec import WorldSpec, gaze_offsets
from scenes.world.sprites import TRUTH_RAYS, body_sprite, lay_over, place_of
from spikecam_env.types import Floats, Pictures

_NO_GAZE = Gaze.fixed(0.0, 0.0)


@dataclass(frozen=True, eq=False)
class VisibleBodies:
    """Pictures (H, W) of an instant; `owner` is the number of the body seen, from 1, or 0, the background."""

    radiance: Pictures
    depth: Pictures
    owner: NDArray[np.int32]


def truth_at(spec: WorldSpec, cache: WorldCache, plan: BlockPlan, frame: float, gaze: Gaze | None) -> Truth:
    """See `scenes.world.World.truth`; the plan is that of the frame's block."""
    seen = seen_at(spec, cache, plan, frame, gaze, TRUTH_RAYS)
    ahead, behind = (_displaced(spec, seen, frame, by, gaze) for by in (0.5, -0.5))
    poses = {body.name: _pose_numbers(spec.pose(number, frame)) for number, body in enumerate(spec.bodies)}
    camera = (gaze or _NO_GAZE).at(frame)
    flow = (ahead - behind).astype(np.float32)
    return Truth(seen.radiance, flow, seen.owner, seen.depth, poses | {"camera": camera})


def displacement_at(
    spec: WorldSpec, cache: WorldCache, plan: BlockPlan, frame: float, by: float, gaze: Gaze | None
) -> Pictures:
    """See `scenes.world.World.displacement`; the plan is that of the frame's block."""
    seen = seen_at(spec, cache, plan, frame, gaze, TRUTH_RAYS)
    return _displaced(spec, seen, frame, by, gaze).astype(np.float32)


def seen_at(
    spec: WorldSpec, cache: WorldCache, plan: BlockPlan, frame: float, gaze: Gaze | None, rays: int
) -> VisibleBodies:
    """The camera's view at a frame, by rays x rays a pixel; the plan is that of the frame's block."""
    picture = sky(spec, cache, frame, gaze_offsets(gaze, np.array([frame]))[0])
    depth = np.full(spec.shape, np.inf, np.float32)
    nearest = depth.copy()
    owner = np.zeros(spec.shape, np.int32)
    for body in plan.order:
        sprite = body_sprite(spec, cache, body, frame, gaze, rays)
        shown = lay_over(picture, sprite, nearest)
        place = place_of(sprite.window)
        depth[place][shown] = sprite.depth[shown]
        owner[place][shown] = body + 1
        if not spec.bodies[body].backdrop:
            nearest[place][shown] = sprite.depth[shown]
    return VisibleBodies(picture, depth, owner)


def places_at(spec: WorldSpec, frame: float, gaze: Gaze | None) -> dict[str, tuple[float, float]]:
    """See `scenes.world.World.places`."""
    to_camera = np.linalg.inv(spec.pinhole(frame).pose)
    centre = np.asarray(spec.centre) - (gaze or _NO_GAZE).at(frame)
    places = {}
    for number, body in enumerate(spec.bodies):
        if not (body.backdrop or isinstance(body.trajectory, Still)):
            middle = np.append(body.surface.middle, 1.0)
            right, up, back, _ = to_camera @ spec.pose(number, float(frame)) @ middle
            away = max(-back, 1e-6)
            places[body.name] = (
                float(centre[0] + spec.focal * right / away),
                float(centre[1] - spec.focal * up / away),
            )
    return places


def _displaced(spec: WorldSpec, seen: VisibleBodies, frame: float, by: float, gaze: Gaze | None) -> Floats:
    """(H, W, 2): motion of the visible points from a frame to `by` frames later [pixels]."""
    now, then = (spec.pinhole(f).pose for f in (frame, frame + by))
    centre = np.asarray(spec.centre)
    y, x = np.indices(spec.shape, np.float64)
    here = np.stack([x, y], -1)
    across = (here - centre + gaze_offsets(gaze, np.array([frame]))[0]) / spec.focal
    ray = np.stack([across[..., 0], -across[..., 1], -np.ones(spec.shape)], -1)
    moved = np.empty_like(here)
    later = centre - gaze_offsets(gaze, np.array([frame + by]))[0]
    inverse = np.linalg.inv(then)
    for number in np.unique(seen.owner):
        mine = seen.owner == number
        if number == 0:
            point = ray[mine] @ (inverse[:3, :3] @ now[:3, :3]).T
        else:
            start, end = (spec.pose(number - 1, f) for f in (frame, frame + by))
            step = inverse @ end @ np.linalg.inv(start) @ now
            point = (ray[mine] * seen.depth[mine][:, None].astype(np.float64)) @ step[:3, :3].T + step[:3, 3]
        away = np.maximum(-point[:, 2], 1e-6)
        moved[mine] = later + spec.focal * np.stack([point[:, 0] / away, -point[:, 1] / away], -1)
    return moved - here


def _pose_numbers(pose: Floats) -> tuple[float, ...]:
    return (*map(float, pose[:3, 3]), *map(float, scipy.spatial.transform.Rotation.from_matrix(pose[:3, :3]).as_quat()))
