"""Cook: a pan jerks, a pancake turns over in the air, and vegetables fly about it."""

from __future__ import annotations

import numpy as np

from scenes.catalogue import stage
from scenes.drawing import Canvas
from scenes.meshes import assemble, capsule, lathe, sphere
from scenes.protocol import Scene
from scenes.renderers.protocol import Renderer
from scenes.textures import Texture
from scenes.trajectories import Bouncing, Spinning, Still, Swinging, Vibrating
from scenes.world import Body, World

PAN = [(0.0, -0.16), (0.62, -0.16), (0.78, 0.06), (0.83, 0.06), (0.80, 0.03), (0.64, -0.12), (0.0, -0.12)]


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    handle = capsule(0.75, 0.07, 0.35, taper=1.2).moved(Still((0.8, 0.05, 0), (0, 0, -80)))
    swing = Still((-0.15, -0.5, 0.2)) @ Vibrating((0.05, 0.06, 0), 11) @ Swinging((0, 0, 1), 9, 11, 0.2)
    cake = lathe([(0.0, -0.03), (0.36, -0.03), (0.4, 0.0), (0.36, 0.03), (0.0, 0.03)], pancake(rng))
    slice_ = lathe([(0.0, -0.03), (0.17, -0.03), (0.17, 0.03), (0.0, 0.03)], tomato(), smooth=False)
    carrot = lathe([(0.0, -0.3), (0.03, -0.28), (0.1, 0.2), (0.07, 0.28), (0.0, 0.29)], ringed(rng))
    egg = sphere(0.16, stage.mottled(rng, 0.6, 0.95, 128), 40).scaled((1, 1.35, 1))
    return World(
        shape,
        bodies=(
            stage.wall(tiles(rng)),
            Body("pan", assemble(lathe(PAN, stage.mottled(rng, 0.08, 0.3, 256), smooth=False), handle), swing),
            Body(
                "pancake",
                assemble(cake),
                Still((-0.25, -0.3, 0.2)) @ Bouncing(0.85, 981.0, 0.2) @ Spinning((1, 0.1, 0.4), 800, 20),
            ),
            Body(
                "tomato",
                assemble(slice_),
                Still((0.35, -0.35, 0.3)) @ Bouncing(1.0, 981.0, 0.4) @ Spinning((0.4, 1, 0.8), 1100, 70),
            ),
            Body(
                "carrot",
                assemble(carrot),
                Still((-0.75, -0.35, 0.1)) @ Bouncing(1.1, 981.0, 0.75) @ Spinning((0.2, 0, 1), 900, 40),
            ),
            Body(
                "egg", assemble(egg), Still((0.85, -0.3, -0.2)) @ Bouncing(0.9, 981.0, 0.05) @ Spinning((1, 0, 1), 600)
            ),
        ),
        camera=stage.camera(1.6),
        frame_rate_hz=frame_rate_hz,
        renderer=renderer,
    )


def tiles(rng: np.random.Generator) -> Texture:
    canvas = Canvas(960, 600, 0.15)
    for i in range(32):
        for j in range(20):
            canvas.rectangle((i + 0.04) / 32, (j + 0.04) / 20, (i + 0.96) / 32, (j + 0.96) / 20, rng.uniform(0.35, 0.5))
    return canvas.texture()


def pancake(rng: np.random.Generator) -> Texture:
    canvas = Canvas(384, 128, 0.75)
    for _ in range(160):
        canvas.disc(rng.random(), rng.random(), rng.uniform(0.01, 0.07), rng.uniform(0.15, 0.6))
    return canvas.texture()


def tomato() -> Texture:
    """Around and from the middle out, on both faces."""
    canvas = Canvas(384, 192, 0.3)
    for face in (0.22, 0.78):
        for i in range(6):
            canvas.ellipse((i + 0.5) / 6, face, 0.055, 0.1, 0.75)
            for k in (-0.025, 0.025):
                canvas.ellipse((i + 0.5) / 6 + k, face, 0.008, 0.03, 0.1)
    return canvas.texture()


def ringed(rng: np.random.Generator) -> Texture:
    canvas = Canvas(128, 256, 0.6)
    for y in rng.random(14):
        canvas.rectangle(0, y, 1, y + 0.012, 0.25)
    return canvas.rectangle(0, 0, 1, 0.12, 0.2).texture()
