"""Random worlds, as in SPIFT: textured bodies in random rigid motion before a background."""

from __future__ import annotations

import numpy as np

from scenes.catalogue import stage
from scenes.meshes import Part, assemble, box, capsule, lathe, sphere, torus
from scenes.protocol import Scene
from scenes.renderers.protocol import Lighting, Renderer, Surface
from scenes.textures import Texture, random_texture
from scenes.trajectories import AT_REST, Chain, Shake, Spinning, Still, Trajectory, Vector, Vibrating
from scenes.world import Body, World

FASTEST_HZ, SLOWEST_HZ = 40.0, 4.0
FASTEST_RPM = 2500.0
SHAKEN = 0.3
"""Share of the worlds whose camera is held in a hand."""


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    """Three to seven bodies; the whole follows from the seed."""
    rng = np.random.default_rng([seed, 0x5C])
    bodies = [Body(f"body {k + 1}", solid(rng), motion(rng)) for k in range(int(rng.integers(3, 8)))]
    low, high = np.sort(rng.uniform(0.05, 0.8, 2))
    wall = stage.wall((low + (high - low) * random_texture(rng, 512)).astype(np.float32), -3.0, (9.0, 9.0))
    shaken = Shake(0.06, highest_hz=40, seed=int(rng.integers(1 << 31)))
    shake: Trajectory = shaken if rng.random() < SHAKEN else AT_REST
    ambient = rng.uniform(0.2, 0.5)
    towards = (float(rng.uniform(-0.8, 0.8)), float(rng.uniform(0.1, 0.9)), 0.8)
    return World(
        shape,
        (wall, *bodies),
        stage.camera(0.0, shake=shake),
        Lighting(ambient, 1 - ambient, towards),
        frame_rate_hz=frame_rate_hz,
        renderer=renderer,
    )


def motion(rng: np.random.Generator) -> Trajectory:
    """To and fro along two directions, and a spin about an axis of its own."""
    middle = (rng.uniform(-1.2, 1.2), rng.uniform(-0.7, 0.7), rng.uniform(-1.5, 1.0))
    where: Chain | Still = Still(middle)
    for _ in range(2):
        frequency = float(np.exp(rng.uniform(np.log(SLOWEST_HZ), np.log(FASTEST_HZ))))
        reach = rng.normal(size=3) * [1, 0.7, 0.5] * rng.uniform(0.1, 0.6)
        where = where @ Vibrating(_vector(reach), frequency, rng.random())
    return where @ Spinning(
        _vector(rng.normal(size=3)), float(rng.uniform(-FASTEST_RPM, FASTEST_RPM)), rng.uniform(0, 360)
    )


def solid(rng: np.random.Generator) -> Surface:
    """A ball, box, ring, stick, or vase, textured."""
    size = float(rng.uniform(0.18, 0.5))
    kind = rng.integers(5)
    if kind == 0:
        stretch = rng.uniform(0.6, 1.2, 3)
        return assemble(sphere(size, grey(rng), 60).scaled(stretch))
    if kind == 1:
        extents = _vector(size * rng.uniform(0.6, 2.0, 3))
        return assemble(*box(extents, [grey(rng) for _ in range(6)], 4))
    if kind == 2:
        return assemble(torus(size, size * rng.uniform(0.2, 0.5), grey(rng), 64))
    if kind == 3:
        length = size * float(rng.uniform(1.0, 2.5))
        return assemble(capsule(length, 0.4 * size, grey(rng), 48).moved(Still((0, -length / 2, 0))))
    return assemble(vase(rng, size))


def vase(rng: np.random.Generator, size: float) -> Part:
    """A random profile, turned."""
    radii = rng.uniform(0.25, 1.0, 5) * size
    heights = np.linspace(-1.2, 1.2, 5) * size
    profile = [(0.0, heights[0]), *zip(radii, heights, strict=True), (0.0, heights[-1])]
    return lathe([(float(r), float(y)) for r, y in profile], grey(rng), 56)


def grey(rng: np.random.Generator) -> Texture:
    """A random texture between two greys that differ."""
    low, high = rng.uniform(0.03, 0.35), rng.uniform(0.5, 0.98)
    return (low + (high - low) * random_texture(rng, 256)).astype(np.float32)


def _vector(values: np.ndarray) -> Vector:
    return float(values[0]), float(values[1]), float(values[2])
