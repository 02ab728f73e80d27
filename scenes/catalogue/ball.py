"""Ball: a football flies through the picture, a small ball bounces the other way."""

from __future__ import annotations

import numpy as np

from scenes.catalogue import stage
from scenes.meshes import assemble, sphere
from scenes.protocol import Scene
from scenes.renderers.protocol import Renderer
from scenes.textures import Texture
from scenes.trajectories import Ballistic, Bouncing, Repeating, Spinning
from scenes.world import Body, World


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    football = Ballistic((-1.1, 0.0, 0.2), (55, 28, 0), stage.GRAVITY_CM)
    small = Ballistic((1.3, -0.66, 0.9), (-42, 0, 0))
    return World(
        shape,
        bodies=(
            stage.wall(stage.mottled(rng, 0.12, 0.4)),
            stage.floor(stage.boards(rng)),
            Body(
                "football",
                assemble(sphere(0.42, football_leather(), 80)),
                Repeating(football, 0.13, -0.03) @ Spinning((0.4, 0.3, -1), 1300),
            ),
            Body(
                "small ball",
                assemble(sphere(0.18, stitched(), 60)),
                Repeating(small, 0.1, -0.02) @ Bouncing(0.75, 981.0, 0.2) @ Spinning((0.2, 0.5, 1), 1900),
            ),
        ),
        camera=stage.camera(),
        frame_rate_hz=frame_rate_hz,
        renderer=renderer,
    )


def football_leather(size: int = 512) -> Texture:
    """The truncated icosahedron: 12 dark pentagons and 20 bright hexagons with seams, by longitude and latitude."""
    golden = (1 + np.sqrt(5)) / 2
    pentagons = np.array([(0, a, b * golden) for a in (-1, 1) for b in (-1, 1)])
    pentagons = np.concatenate([np.roll(pentagons, k, axis=1) for k in range(3)]) / np.hypot(1, golden)
    near = pentagons @ pentagons.T > 0.4
    triples = [
        (i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[i, k]
    ]
    hexagons = np.array([pentagons[list(t)].sum(0) for t in triples])
    hexagons /= np.linalg.norm(hexagons, axis=1, keepdims=True)
    latitude = np.pi / 2 - np.pi * (np.arange(size) + 0.5) / size
    longitude = 2 * np.pi * (np.arange(2 * size) + 0.5) / (2 * size)
    towards = np.stack(
        np.broadcast_arrays(
            np.cos(latitude)[:, None] * np.sin(longitude),
            np.sin(latitude)[:, None],
            np.cos(latitude)[:, None] * np.cos(longitude),
        ),
        -1,
    )
    # a face's middle lies at these distances from the centre of the solid, in units that make the edges meet
    reach = np.concatenate([towards @ pentagons.T * 1.0, towards @ hexagons.T * 0.9732], -1)
    ordered = np.sort(reach, -1)
    leather = np.where(reach.argmax(-1) < 12, 0.06, 0.9)
    seam = np.clip((ordered[..., -1] - ordered[..., -2]) / 0.012, 0, 1)
    return np.asarray((0.1 + (leather - 0.1) * seam).astype(np.float32))


def stitched(size: int = 256) -> Texture:
    """A tennis ball: bright, with the one winding seam."""
    longitude = 2 * np.pi * (np.arange(2 * size) + 0.5) / (2 * size)
    latitude = np.pi / 2 - np.pi * (np.arange(size) + 0.5) / size
    away = np.abs(latitude[:, None] - 0.75 * np.sin(2 * longitude)[None])
    return (0.65 + 0.35 * np.clip(1 - away / 0.09, 0, 1) - 0.5 * (away > 0.3) * (latitude[:, None] > 0)).astype(
        np.float32
    )
