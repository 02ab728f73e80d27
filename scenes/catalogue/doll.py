"""Doll: painted wooden dolls that spin and sway."""

from __future__ import annotations

import numpy as np

from scenes.catalogue import stage
from scenes.drawing import Canvas
from scenes.meshes import assemble, lathe
from scenes.protocol import Scene
from scenes.renderers.protocol import Renderer
from scenes.textures import Texture
from scenes.trajectories import Spinning, Still, Swinging
from scenes.world import Body, World

OUTLINE = [
    (0.0, 0.0),
    (0.33, 0.0),
    (0.43, 0.25),
    (0.45, 0.5),
    (0.36, 0.85),
    (0.27, 1.0),
    (0.31, 1.2),
    (0.24, 1.42),
    (0.0, 1.5),
]


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    bodies = []
    for number, (x, z, size, rpm, sway) in enumerate(
        [
            (-0.35, -0.3, 1.0, 1100, 9),
            (0.5, 0.1, 0.68, -1700, 12),
            (1.1, 0.25, 0.45, 2300, 15),
            (-1.1, -0.6, 0.72, -800, 10),
        ],
        1,
    ):
        bodies.append(
            Body(
                f"doll {number}",
                assemble(lathe(OUTLINE, painted(rng)).scaled(size)),
                Still((x, -0.85, z))
                @ Swinging((0, 0, 1), sway, 9 + 2 * number, rng.random())
                @ Spinning((0, 1, 0), rpm, rng.uniform(-30, 30)),
            )
        )
    return World(
        shape,
        bodies=(stage.wall(stage.mottled(rng, 0.1, 0.3)), stage.floor(stage.boards(rng)), *bodies),
        camera=stage.camera(),
        frame_rate_hz=frame_rate_hz,
        renderer=renderer,
    )


def painted(rng: np.random.Generator) -> Texture:
    """Scarf, face, apron with a flower, and a border; the face looks to +z, at both ends of the texture's u."""
    coat = rng.uniform(0.2, 0.45)
    canvas = Canvas(512, 512, coat).rectangle(0, 0, 1, 0.42, coat * 0.5)
    for shift in (0.0, 1.0):
        canvas.ellipse(shift, 0.24, 0.16, 0.105, 0.85)
        canvas.ellipse(shift, 0.155, 0.13, 0.045, 0.12)
        for side in (-1, 1):
            canvas.ellipse(shift + side * 0.06, 0.235, 0.024, 0.02, 0.98)
            canvas.ellipse(shift + side * 0.06, 0.236, 0.012, 0.016, 0.03)
            canvas.line([(shift + side * 0.035, 0.207), (shift + side * 0.09, 0.205)], 0.006, 0.1)
            canvas.ellipse(shift + side * 0.09, 0.275, 0.025, 0.016, 0.6)
        canvas.ellipse(shift, 0.3, 0.028, 0.01, 0.2)
        canvas.ellipse(shift, 0.65, 0.17, 0.2, 0.8)
        for k in range(6):
            angle = k * np.pi / 3
            canvas.ellipse(shift + 0.055 * np.cos(angle), 0.64 + 0.055 * np.sin(angle), 0.034, 0.034, 0.15)
        canvas.ellipse(shift, 0.64, 0.025, 0.025, 0.95)
    for k in range(10):
        canvas.ellipse(0.25 + 0.5 * k / 9, 0.2 + 0.07 * (k % 2), 0.012, 0.012, 0.9)
        canvas.ellipse(0.25 + 0.5 * k / 9, 0.55 + 0.1 * (k % 3), 0.016, 0.016, 0.75)
    for k in range(20):
        canvas.polygon([(k / 20, 0.94), ((k + 0.5) / 20, 0.88), ((k + 1) / 20, 0.94)], 0.9)
    return canvas.rectangle(0, 0.42, 1, 0.435, 0.9).texture()
