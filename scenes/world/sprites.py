"""Bodies rendered at an instant itself, and laid over a picture."""

from __future__ import annotations

import dataclasses

import numpy as np

from scenes.protocol import Gaze
from scenes.renderers.protocol import PictureWindow, Pinhole, Sprite
from scenes.world.cache import Sight, WorldCache
from scenes.world.extent import extent, window_around
from scenes.world.spec import WorldSpec, gaze_offsets
from spikecam_env.types import Masks, Pictures

TRUTH_RAYS = 4
"""Of a pixel, along either side, where a body is rendered at an instant itself."""


def body_sprite(spec: WorldSpec, cache: WorldCache, body: int, frame: float, gaze: Gaze | None, rays: int) -> Sprite:
    """A body as the camera sees it at a frame, by rays x rays a pixel, cut to the picture."""
    offset = gaze_offsets(gaze, np.array([float(frame)]))[0]
    rest = spec.pinhole(frame)
    camera = Pinhole(rest.focal, (rest.centre[0] - offset[0], rest.centre[1] - offset[1]), rest.pose)
    seen = sight_of(spec, cache, body, frame, camera, margin=0)
    if not (seen.window.rows and seen.window.columns):
        nothing = np.zeros((0, 0), np.float32)
        return Sprite(PictureWindow(0, 0, 0, 0), nothing, nothing, nothing)

    def drawn() -> Sprite:
        surface = spec.bodies[body].surface
        sprite = spec.drawing.render(surface, seen.pose, camera, spec.lighting, seen.window, rays)
        return dataclasses.replace(sprite, radiance=sprite.radiance * np.float32(spec.light))

    if not spec.bodies[body].backdrop:
        return drawn()
    return cache.backdrops.get((body, seen.pose.tobytes(), camera.centre, camera.pose.tobytes(), rays), drawn)


def sight_of(spec: WorldSpec, cache: WorldCache, body: int, frame: float, camera: Pinhole, margin: int) -> Sight:
    """A body before a camera at a frame; its window goes beyond the picture by `margin` pixels at most."""
    pose = spec.pose(body, frame)
    view = np.linalg.inv(camera.pose) @ pose
    box = extent(cache.probe(spec, body).extreme, view[None], spec.focal, np.asarray([camera.centre]))[0]
    return Sight(pose, camera, view, window_around(box, spec.shape, margin))


def lay_over(picture: Pictures, sprite: Sprite, depth: Pictures) -> Masks:
    """Lay a sprite over a picture (H, W) of depth (H, W), in place, but where the picture is nearer.

    Returns:
        Pixels of the sprite's window in which it is seen.
    """
    place = place_of(sprite.window)
    front = (sprite.coverage > 0) & (sprite.depth <= depth[place])
    covered = np.where(front, sprite.coverage, 0)
    picture[place] = np.where(front, sprite.radiance, 0) + (1 - covered) * picture[place]
    return np.asarray(covered > 0.5)


def place_of(window: PictureWindow) -> tuple[slice, slice]:
    """Rows and columns of the picture."""
    return slice(window.top, window.top + window.rows), slice(window.left, window.left + window.columns)
