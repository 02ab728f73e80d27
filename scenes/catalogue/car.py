"""Car: one passes at 110 km/h, filmed from the kerb with a long lens.  A unit is a metre."""

from __future__ import annotations

import numpy as np

from scenes.camera import Camera
from scenes.catalogue import stage
from scenes.drawing import Canvas
from scenes.meshes import assemble, lathe, prism
from scenes.protocol import Scene
from scenes.renderers.protocol import Lighting, Renderer, Surface
from scenes.textures import Texture
from scenes.trajectories import Ballistic, Repeating, Shake, Spinning, Still, Vibrating
from scenes.world import Body, World

SPEED = 31.0
"""[m/s]"""

WHEEL = 0.33

OUTLINE = [
    (-2.1, 0.3),
    (2.05, 0.3),
    (2.15, 0.5),
    (2.1, 0.78),
    (1.1, 0.95),
    (0.45, 1.42),
    (-0.9, 1.46),
    (-1.75, 1.0),
    (-2.15, 0.95),
]


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    run = Repeating(Ballistic((-0.5, 0, 0), (SPEED, 0, 0)), 16 / SPEED, -7.5 / SPEED)
    rolling = Spinning((0, 0, 1), -60 * SPEED / (2 * np.pi * WHEEL))
    bodies = [Body("car", body(), run @ Vibrating((0, 0.012, 0), 9))]
    for k, x in enumerate((-1.35, 1.35), 1):
        bodies.append(Body(f"wheel {k}", wheel(), run @ Still((x, WHEEL, 0.79)) @ rolling))
    return World(
        shape,
        (*stage.outdoors(rng), *bodies),
        Camera((0.6, 1.3, 9), (0, 0.85, 0), field_of_view_deg=18, shake=Shake(0.03, highest_hz=30, seed=seed)),
        Lighting(0.35, 0.65, (-0.4, 0.8, 0.6)),
        frame_rate_hz=frame_rate_hz,
        renderer=renderer,
    )


def body() -> Surface:
    """Painted on its side: windows, door, lamps, arches."""
    left, bottom = np.min(OUTLINE, axis=0)
    width, height = np.ptp(OUTLINE, axis=0)

    def at(x: float, y: float) -> tuple[float, float]:
        return (x - left) / width, 1 - (y - bottom) / height

    canvas = Canvas(960, 260, 0.62)
    canvas.polygon([at(-1.45, 1.0), at(-0.82, 1.38), at(-0.3, 1.38), at(-0.3, 1.0)], 0.06)
    canvas.polygon([at(-0.22, 1.0), at(-0.22, 1.38), at(0.38, 1.36), at(0.92, 1.0)], 0.06)
    canvas.polygon([at(-0.05, 1.0), at(0.12, 1.38), at(0.22, 1.38), at(0.05, 1.0)], 0.3)
    for x in (-0.26, 0.95):
        canvas.line([at(x, 0.98), at(x - 0.05, 0.38)], 0.012, 0.25)
    canvas.line([at(-1.0, 0.98), at(-1.05, 0.6)], 0.012, 0.25)
    canvas.line([at(-2.1, 0.68), at(2.1, 0.62)], 0.014, 0.3).rectangle(0, 0.9, 1, 1, 0.15)
    canvas.ellipse(*at(2.0, 0.68), 0.022, 0.06, 0.98).ellipse(*at(-2.05, 0.8), 0.018, 0.07, 0.2)
    canvas.rectangle(*at(-0.5, 0.88), *at(-0.34, 0.85), 0.15).text("40", *at(0.3, 0.7), 0.2, 0.08)
    for x in (-1.35, 1.35):
        canvas.ellipse(*at(x, WHEEL), 0.4 / width, 0.4 / height, 0.03)
    return assemble(*prism(OUTLINE, 1.6, 0.5, canvas.texture()))


def wheel() -> Surface:
    profile = [(0.0, -0.1), (WHEEL, -0.1), (WHEEL, 0.1), (0.0, 0.1)]
    return assemble(lathe(profile, rim(), 48, smooth=False).moved(Still(turn=(90, 0, 0))))


def rim() -> Texture:
    """Around and from the middle of one face, over the tread, to the middle of the other."""
    canvas = Canvas(384, 256, 0.06)
    for low, high in ((0.0, 0.29), (0.71, 1.0)):
        canvas.rectangle(0, low, 1, high, 0.1)
        for k in range(5):
            canvas.rectangle((k + 0.25) / 5, low, (k + 0.7) / 5, high, 0.85)
    return (
        canvas.rectangle(0, 0.27, 1, 0.29, 0.8).rectangle(0, 0.71, 1, 0.73, 0.8).rectangle(0, 0, 1, 0.07, 0.7).texture()
    )
