"""Bodies rendered at an instant itself, and laid over a picture."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from scenes.protocol import Gaze
from scenes.renderers.protocol import Pinhole, Sprite, Window
from scenes.world.cache import WorldCache
from scenes.world.extent import extent, window_around
from scenes.world.spec import WorldSpec, gaze_offsets

TRUTH_RAYS = 4
"""Of a pixel, along either side, where a body is rendered at an instant itself."""

Array = NDArray[np.float32]


def body_sprite(spec: WorldSpec, cache: WorldCache, body: int, frame: float, gaze: Gaze | None, rays: int) -> Sprite:
    """A body as the camera sees it at a frame, by rays x rays a pixel, cut to the picture."""
    offset = gaze_offsets(gaze, np.array([float(frame)]))[0]
    rest = spec.pinhole(frame)
    camera = Pinhole(rest.focal, (rest.centre[0] - offset[0], rest.centre[1] - offset[1]), rest.pose)
    pose = spec.pose(body, frame)
    view = np.linalg.inv(camera.pose) @ pose
    box = extent(cache.probe(spec, body).extreme, view[None], spec.focal, np.asarray([camera.centre]))[0]
    window = window_around(box, spec.shape, 0)
    if not (window.rows and window.columns):
        nothing = np.zeros((0, 0), np.float32)
        return Sprite(Window(0, 0, 0, 0), nothing, nothing, nothing)

    def drawn() -> Sprite:
        sprite = spec.drawing.render(spec.bodies[body].surface, pose, camera, spec.lighting, window, rays)
        return dataclasses.replace(sprite, radiance=sprite.radiance * np.float32(spec.light))

    if not spec.bodies[body].backdrop:
        return drawn()
    return cache.backdrops.get((body, pose.tobytes(), camera.centre, camera.pose.tobytes(), rays), drawn)


def lay_over(picture: Array, sprite: Sprite, depth: Array) -> NDArray[np.bool_]:
    """Lay a sprite over a picture (H, W), in place, but where the picture is nearer.

    depth: (H, W) of the picture.  Returns where the sprite is what is seen, of its window.
    """
    place = place_of(sprite.window)
    front = (sprite.coverage > 0) & (sprite.depth <= depth[place])
    covered = np.where(front, sprite.coverage, 0)
    picture[place] = np.where(front, sprite.radiance, 0) + (1 - covered) * picture[place]
    return np.asarray(covered > 0.5)


def place_of(window: Window) -> tuple[slice, slice]:
    """Rows and columns of the picture."""
    return slice(window.top, window.top + window.rows), slice(window.left, window.left + window.columns)
