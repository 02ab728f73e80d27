"""Train: an express passes at 250 km/h.  A unit is a metre."""

from __future__ import annotations

import numpy as np

from scenes.camera import Camera
from scenes.catalogue import stage
from scenes.drawing import Canvas
from scenes.meshes import assemble, lathe, prism
from scenes.protocol import Scene
from scenes.renderers.protocol import Lighting, Renderer, Surface
from scenes.textures import Texture
from scenes.trajectories import Ballistic, Repeating, Spinning, Still
from scenes.world import Body, World

SPEED = 70.0
"""[m/s]"""

LENGTH, GAP, WHEEL = 9.0, 0.4, 0.45
CARRIAGES = 5


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    train: list[Body] = []
    engine, coach, wheels = locomotive(), carriage(rng), wheel()
    rolling = Spinning((0, 0, 1), -60 * SPEED / (2 * np.pi * WHEEL))
    away = 16.0
    period = (CARRIAGES * (LENGTH + GAP) + 2 * away) / SPEED
    for number in range(CARRIAGES):
        x = 0.5 - number * (LENGTH + GAP)
        run = Repeating(Ballistic((x, 0, 0), (SPEED, 0, 0)), period, -(CARRIAGES * (LENGTH + GAP) + away + x) / SPEED)
        run = run if x > -away else Repeating(run.motion, period, -(away + x) / SPEED - period)
        train.append(Body(f"coach {number}" if number else "engine", coach if number else engine, run))
        for k, place in enumerate((-3.4, -2.3, 2.3, 3.4)):
            train.append(Body(f"wheel {number}.{k}", wheels, run @ Still((place, WHEEL, 1.25)) @ rolling))
    return World(
        shape,
        (*stage.outdoors(rng), *train),
        Camera((0, 2.2, 14), (0, 1.8, 0), field_of_view_deg=26),
        Lighting(0.35, 0.65, (-0.3, 0.8, 0.7)),
        frame_rate_hz=frame_rate_hz,
        renderer=renderer,
    )


def carriage(rng: np.random.Generator) -> Surface:
    half = LENGTH / 2
    outline = [(-half, 0.7), (half, 0.7), (half, 3.0), (half - 0.25, 3.45), (-half + 0.25, 3.45), (-half, 3.0)]
    canvas = Canvas(1152, 352, 0.8).rectangle(0, 0.72, 1, 0.82, 0.2).rectangle(0, 0.86, 1, 0.9, 0.45)
    canvas.rectangle(0, 0, 1, 0.14, 0.4)
    for k in range(7):
        left = 0.13 + 0.108 * k
        canvas.rectangle(left, 0.26, left + 0.085, 0.56, 0.06)
        canvas.polygon([(left + 0.01, 0.56), (left + 0.04, 0.26), (left + 0.055, 0.26), (left + 0.025, 0.56)], 0.2)
        if rng.random() < 0.6:
            canvas.ellipse(left + 0.05, 0.5, 0.013, 0.06, 0.35)
    for left in (0.03, 0.91):
        canvas.rectangle(left, 0.22, left + 0.06, 0.93, 0.35).rectangle(left + 0.012, 0.28, left + 0.048, 0.55, 0.06)
    canvas.text("EXPRESS 40000", 0.5, 0.66, 0.06, 0.08)
    return assemble(*prism(outline, 2.4, 0.5, canvas.texture()))


def locomotive() -> Surface:
    half = LENGTH / 2
    outline = [
        (-half, 0.7),
        (half + 0.2, 0.7),
        (half + 0.25, 1.2),
        (half - 1.3, 2.7),
        (half - 2.6, 3.45),
        (-half, 3.45),
    ]
    canvas = Canvas(1152, 352, 0.35).rectangle(0, 0.72, 1, 0.84, 0.9).rectangle(0, 0, 1, 0.14, 0.35)
    canvas.polygon([(0.74, 0.28), (0.83, 0.28), (0.9, 0.52), (0.74, 0.52)], 0.05)
    for k in range(9):
        canvas.rectangle(0.06 + 0.035 * k, 0.25, 0.083 + 0.035 * k, 0.55, 0.1)
    canvas.text("SPIKE 7", 0.55, 0.42, 0.14, 0.95).disc(0.945, 0.7, 0.05, 0.98)
    return assemble(*prism(outline, 2.4, 0.55, canvas.texture()))


def wheel() -> Surface:
    profile = [(0.0, -0.08), (WHEEL, -0.08), (WHEEL, 0.08), (0.0, 0.08)]
    return assemble(lathe(profile, spokes(), 40, smooth=False).moved(Still(turn=(90, 0, 0))))


def spokes() -> Texture:
    """Around and from the middle of one face to the middle of the other."""
    canvas = Canvas(384, 192, 0.12)
    for k in range(6):
        canvas.rectangle((k + 0.2) / 6, 0, (k + 0.6) / 6, 1, 0.6)
    return canvas.rectangle(0, 0.36, 1, 0.64, 0.5).rectangle(0, 0, 1, 0.06, 0.8).texture()
