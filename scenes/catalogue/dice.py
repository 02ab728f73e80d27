"""Dice: four of them tumble over a table."""

from __future__ import annotations

import numpy as np

from scenes.catalogue import stage
from scenes.drawing import Canvas
from scenes.meshes import assemble, box
from scenes.protocol import Scene
from scenes.renderers.protocol import Renderer
from scenes.textures import Texture
from scenes.trajectories import Ballistic, Bouncing, Repeating, Spinning
from scenes.world import Body, World

PIPS = {
    1: [(0, 0)],
    2: [(-1, -1), (1, 1)],
    3: [(-1, -1), (0, 0), (1, 1)],
    4: [(-1, -1), (-1, 1), (1, -1), (1, 1)],
    5: [(-1, -1), (-1, 1), (1, -1), (1, 1), (0, 0)],
    6: [(-1, -1), (-1, 0), (-1, 1), (1, -1), (1, 0), (1, 1)],
}
SIDES = (1, 2, 6, 5, 3, 4)
"""Front, right, back, left, top, bottom: opposite sides make seven."""


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    dice = []
    for number, (x, z, size, dark) in enumerate(
        [(-1.0, 0.3, 0.44, False), (0.0, -0.2, 0.5, True), (0.75, 0.6, 0.4, False), (0.5, -1.3, 0.46, False)], 1
    ):
        across = 50.0 if number % 2 else -36.0
        roll = Ballistic((x, -0.85 + 0.7 * size, z), (across, 0, rng.uniform(-4, 4)))
        start = rng.uniform(0, 360)
        dice.append(
            Body(
                f"die {number}",
                assemble(*box((size,) * 3, [face(side, dark) for side in SIDES], 4)),
                Repeating(roll, 4.6 / abs(across), -(2.3 + np.sign(across) * x) / abs(across))
                @ Bouncing(rng.uniform(0.4, 0.9), 981.0, rng.random())
                @ Spinning(tuple(rng.normal(size=3)), rng.uniform(700, 1300), start),
            )
        )
    return World(
        shape,
        bodies=(stage.wall(stage.boards(rng, 16)), stage.floor(stage.mottled(rng, 0.1, 0.3)), *dice),
        camera=stage.camera(2.2),
        frame_rate_hz=frame_rate_hz,
        renderer=renderer,
    )


def face(pips: int, dark: bool = False, size: int = 128) -> Texture:
    """One side of a die."""
    ground, mark = (0.12, 0.95) if dark else (0.92, 0.04)
    canvas = Canvas(size, size, ground * 0.75).rectangle(0.03, 0.03, 0.97, 0.97, ground)
    for x, y in PIPS[pips]:
        canvas.disc(0.5 + 0.26 * x, 0.5 + 0.26 * y, 0.16 if pips == 1 else 0.1, mark)
    return canvas.texture()
