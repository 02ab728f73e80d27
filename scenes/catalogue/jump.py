"""Jump: a figure jumps with spread arms and legs over a turning rope."""

from __future__ import annotations

import numpy as np

from scenes.catalogue import stage
from scenes.drawing import Canvas
from scenes.meshes import assemble, capsule, sheet, sphere
from scenes.protocol import Scene
from scenes.renderers.protocol import Renderer, Surface
from scenes.surfaces.assembly import Part
from scenes.textures import Texture
from scenes.trajectories import Bouncing, Spinning, Still, Swinging
from scenes.world import Body, World

PERIOD_S = 2 * np.sqrt(2 * 0.32 / 981.0)
"""Of a jump 0.32 high, and of the rope."""


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    up = Still((0, -0.42, -0.6)) @ Bouncing(0.32, 981.0, 0.3)
    beat = 1 / PERIOD_S
    bodies = [Body("torso", torso(rng), up)]
    for side, name in ((-1, "left"), (1, "right")):
        shoulder = Still((side * 0.21, 0.55, 0), (0, 0, -side * 100)) @ Swinging((0, 0, -side), 50, beat, 0.3)
        hip = Still((side * 0.1, 0.06, 0), (0, 0, -side * 162)) @ Swinging((0, 0, -side), -14, beat, 0.3)
        arm = [capsule(0.5, 0.065, sleeve(rng), taper=0.8), sphere(0.075, 0.8, 24).moved(Still((0, 0.56, 0)))]
        leg = [
            capsule(0.62, 0.09, trousers(), taper=0.75),
            sphere(0.09, 0.08, 24).scaled((0.9, 0.8, 1.6)).moved(Still((0, 0.68, 0.06))),
        ]
        bodies += [Body(f"{name} arm", assemble(*arm), up @ shoulder), Body(f"{name} leg", assemble(*leg), up @ hip)]
    bodies.append(Body("rope", assemble(rope()), Still((0, 0.0, -0.6)) @ Spinning((1, 0, 0), 60 * beat, 100)))
    return World(
        shape,
        bodies=(stage.wall(stage.mottled(rng, 0.2, 0.5)), stage.floor(stage.boards(rng), -1.02), *bodies),
        camera=stage.camera(0.5),
        frame_rate_hz=frame_rate_hz,
        renderer=renderer,
    )


def torso(rng: np.random.Generator) -> Surface:
    """Shirt, neck and head, the middle of the hips at the origin."""
    return assemble(
        capsule(0.46, 0.19, shirt(), taper=1.1).scaled((1, 1, 0.7)).moved(Still((0, 0.1, 0))),
        capsule(0.15, 0.07, 0.7).moved(Still((0, 0.68, 0))),
        sphere(0.17, face(), 48).scaled((0.9, 1.1, 0.95)).moved(Still((0, 0.95, 0))),
    )


def rope() -> Part:
    """An arc from hand to hand."""

    def points(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        along, around = np.pi * v, 2 * np.pi * u
        out = 0.98 * np.sin(along) + 0.025 * np.cos(around)
        return 0.8 * np.cos(along) * -1, out, 0.025 * np.sin(around) + 0 * v

    canvas = Canvas(16, 512, 0.9)
    for k in range(30):
        canvas.rectangle(0, k / 30, 1, (k + 0.4) / 30, 0.2)
    return sheet(points, (64, 10), canvas.texture())


def shirt() -> Texture:
    canvas = Canvas(384, 192, 0.85)
    for k in range(6):
        canvas.rectangle(0, (k + 0.15) / 6, 1, (k + 0.5) / 6, 0.2)
    for shift in (0.0, 1.0):
        canvas.rectangle(shift - 0.09, 0.36, shift + 0.09, 0.68, 0.92)
        canvas.text("40", shift, 0.52, 0.2, 0.05)
    return canvas.texture()


def face() -> Texture:
    canvas = Canvas(384, 192, 0.75).rectangle(0, 0, 1, 0.3, 0.07).rectangle(0.2, 0, 0.8, 0.55, 0.07)
    for shift in (0.0, 1.0):
        for side in (-1, 1):
            canvas.ellipse(shift + side * 0.05, 0.46, 0.016, 0.035, 0.03)
        canvas.ellipse(shift, 0.68, 0.04, 0.025, 0.15)
    return canvas.texture()


def sleeve(rng: np.random.Generator) -> Texture:
    return (
        Canvas(128, 192, 0.72)
        .picture(stage.mottled(rng, 0.62, 0.82, 64), 0, 0, 1, 0.7)
        .rectangle(0, 0.65, 1, 1, 0.3)
        .texture()
    )


def trousers() -> Texture:
    canvas = Canvas(128, 192, 0.22)
    for k in (0.25, 0.75):
        canvas.rectangle(k - 0.04, 0, k + 0.04, 1, 0.85)
    return canvas.texture()
