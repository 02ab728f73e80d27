"""Fly: an insect that beats its wings 70 times a second and flies a loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from scenes.catalogue import stage
from scenes.drawing import Canvas
from scenes.meshes import Part, assemble, capsule, sheet, sphere
from scenes.protocol import Scene
from scenes.renderers.protocol import Renderer, Surface
from scenes.surfaces.assembly import Points
from scenes.textures import Texture, blobs
from scenes.trajectories import Path, Still, Swinging, Vibrating
from scenes.world import Body, World

BEAT_HZ = 70.0

LOOP = Path(
    (0.0, 0.05, 0.1, 0.15, 0.2),
    ((-0.75, -0.15, 0), (0.1, 0.35, 0.3), (0.8, 0.0, 0), (0.0, -0.35, -0.3), (-0.75, -0.15, 0)),
    closed=True,
)


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    flight = LOOP @ Vibrating((0, 0.02, 0), BEAT_HZ, 0.25) @ Still(turn=(25, 35, 0)) @ Swinging((0, 1, 0), 20, 5)
    bodies = [Body("body", insect(rng), flight)]
    for name, side in (("left wing", -1), ("right wing", 1)):
        hinge = Still((side * 0.09, 0.13, 0.05)) @ Swinging((0, 0, side), 50, BEAT_HZ) @ Still(turn=(0, side * 18, 0))
        bodies.append(Body(name, assemble(*wing(side)), flight @ hinge))
    leaf = stage.wall((0.25 + 0.35 * blobs(rng, 768)).astype(np.float32))
    return World(shape, (leaf, *bodies), stage.camera(0.9), frame_rate_hz=frame_rate_hz, renderer=renderer)


def insect(rng: np.random.Generator) -> Surface:
    """Head to +z: abdomen, thorax, head with eyes, six legs."""
    abdomen = sphere(0.17, banded(), 48).scaled((1, 0.9, 1.7)).moved(Still((0, -0.02, -0.3)))
    thorax = sphere(0.16, stage.mottled(rng, 0.1, 0.5, 128), 40).moved(Still((0, 0.02, 0.03)))
    head = sphere(0.12, 0.35, 32).moved(Still((0, 0.0, 0.23)))
    parts = [abdomen, thorax, head]
    for side in (-1, 1):
        parts.append(sphere(0.085, faceted(), 32).moved(Still((side * 0.09, 0.04, 0.27))))
        for reach in (-0.14, 0.0, 0.14):
            parts.append(capsule(0.3, 0.015, 0.15, 10).moved(Still((side * 0.1, -0.06, reach), (0, 0, side * -130))))
    return assemble(*parts)


def wing(side: int) -> list[Part]:
    """Upper and lower face of a veined wing towards +x or -x."""

    def face(flip: bool) -> Callable[[Points, Points], Sequence[Points]]:
        def points(u: Points, v: Points) -> Sequence[Points]:
            along = 1 - u if flip else u
            width = 0.2 * np.sqrt(np.clip(np.sin(np.pi * (0.06 + 0.9 * along)), 0, 1)) * (0.6 + 0.6 * along)
            return side * 0.72 * along, 0.05 * along**2 - (0.012 if flip else 0) + 0 * v, (0.35 - v) * width * 1.6

        return points

    upper, lower = (face(False), face(True)) if side > 0 else (face(True), face(False))
    return [sheet(upper, (10, 24), veins(side < 0)), sheet(lower, (10, 24), veins(side > 0))]


def veins(mirrored: bool) -> Texture:
    canvas = Canvas(256, 128, 0.8)
    for y in (0.2, 0.4, 0.62, 0.85):
        canvas.line([(0, 0.45), (0.4, 0.4 + 0.6 * (y - 0.4)), (1, y)], 0.03, 0.15)
    for x in (0.35, 0.55, 0.75):
        canvas.line([(x, 0.15), (x + 0.04, 0.9)], 0.02, 0.25)
    texture = canvas.texture()
    return np.ascontiguousarray(texture[:, ::-1]) if mirrored else texture


def banded() -> Texture:
    canvas = Canvas(128, 256, 0.55)
    for k in range(6):
        canvas.rectangle(0.25 + 0.0 * k, k / 6, 0.75, (k + 0.45) / 6, 0.1)
    for k in range(12):
        canvas.rectangle(k / 12, 0, (k + 0.3) / 12, 1, 0.12)
    return canvas.texture()


def faceted() -> Texture:
    canvas = Canvas(128, 64, 0.2)
    for i in range(16):
        for j in range(8):
            canvas.ellipse((i + 0.5 * (j % 2)) / 16, (j + 0.5) / 8, 0.02, 0.04, 0.75)
    return canvas.texture()
