"""`python -m scenes.renderers.trial NAME`: draws one triangle with OpenGL; fails, or dies, where it cannot."""

from __future__ import annotations

import sys

import numpy as np
import trimesh

from scenes.renderers.opengl import OpenGL
from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole, Surface


def draw(name: str) -> None:
    """Draw one triangle, and fail where its light is wrong."""
    triangle = trimesh.Trimesh([(-9, -9, -5), (9, -9, -5), (0, 9, -5)], [(0, 1, 2)], process=False)
    camera = Pinhole(focal=8.0, centre=(3.5, 3.5), pose=np.eye(4))
    renderer = OpenGL(name)
    sprite = renderer.render(Surface(triangle, 0.5), np.eye(4), camera, Lighting(1.0, 0.0), PictureWindow(0, 0, 8, 8))
    renderer.close()
    if abs(sprite.radiance[4, 4] - 0.5) > 1e-3 or abs(sprite.depth[4, 4] - 5) > 1e-3:
        raise RuntimeError(f"draws a triangle of radiance {sprite.radiance[4, 4]}, not 0.5: a faulty OpenGL driver")


if __name__ == "__main__":
    draw(sys.argv[1])
