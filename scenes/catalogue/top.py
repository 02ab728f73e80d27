"""Top: spinning tops that nod as they turn."""

from __future__ import annotations

import numpy as np

from scenes.catalogue import stage
from scenes.drawing import Canvas
from scenes.meshes import assemble, lathe
from scenes.protocol import Scene
from scenes.renderers.protocol import Renderer
from scenes.textures import Texture
from scenes.trajectories import Spinning, Still
from scenes.world import Body, World

OUTLINE = [
    (0.0, 0.0),
    (0.05, 0.06),
    (0.2, 0.2),
    (0.5, 0.48),
    (0.55, 0.58),
    (0.48, 0.68),
    (0.2, 0.75),
    (0.075, 0.82),
    (0.06, 1.05),
    (0.07, 1.15),
    (0.0, 1.18),
]


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    tops = []
    for number, (x, z, size, tilt, nod, rpm) in enumerate(
        [(-0.25, -0.3, 1.1, 14, 320, 2200), (0.8, 0.2, 0.7, -18, -500, 3200), (-1.05, 0.1, 0.55, 20, 640, 3600)], 1
    ):
        motion = Still((x, -0.84, z)) @ Spinning((0, 1, 0), nod, rng.uniform(0, 360)) @ Still(turn=(0, 0, tilt))
        tops.append(
            Body(
                f"top {number}", assemble(lathe(OUTLINE, painted(rng)).scaled(size)), motion @ Spinning((0, 1, 0), rpm)
            )
        )
    return World(
        shape,
        bodies=(stage.wall(stage.mottled(rng, 0.1, 0.35)), stage.floor(stage.boards(rng, dark=0.2, bright=0.4)), *tops),
        camera=stage.camera(1.8),
        frame_rate_hz=frame_rate_hz,
        renderer=renderer,
    )


def painted(rng: np.random.Generator) -> Texture:
    """Sectors below, stars and a ring above."""
    canvas = Canvas(512, 384, 0.75)
    sectors = int(rng.integers(5, 9))
    for k in range(sectors):
        canvas.rectangle((k + 0.05) / sectors, 0.55, (k + 0.5) / sectors, 0.95, 0.1)
        canvas.polygon([((k + 0.2) / sectors, 0.5), ((k + 0.5) / sectors, 0.34), ((k + 0.8) / sectors, 0.5)], 0.2)
        canvas.disc((k + 0.75) / sectors, 0.72, 0.04, 0.35)
    for y, grey in ((0.52, 0.05), (0.3, 0.2), (0.1, 0.15)):
        canvas.rectangle(0, y - 0.012, 1, y + 0.012, grey)
    return canvas.rectangle(0, 0.3, 0.08, 0.95, 0.95).texture()
