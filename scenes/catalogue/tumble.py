"""Tumble: six bodies of 17 000 triangles that pass before each other, one a disk at 2000 rpm; `bench` times it."""

from __future__ import annotations

import numpy as np

from scenes.camera import Camera
from scenes.flat.disk import disk_texture
from scenes.meshes import assemble, box, capsule, disc, rectangle, sphere, torus
from scenes.protocol import Scene
from scenes.renderers.protocol import Lighting, Renderer
from scenes.textures import blobs, checker, dead_leaves, fractal_noise, rectangles
from scenes.trajectories import Ballistic, Repeating, Spinning, Still, Vibrating
from scenes.world import Body, World


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    return World(
        shape,
        bodies=(
            Body(
                "wall",
                assemble(rectangle(12, 8, 0.3 + 0.5 * fractal_noise(rng, 768))),
                Still((0, 0, -1.5)),
                backdrop=True,
            ),
            Body(
                "disk", assemble(disc(0.62, disk_texture(rng))), Still((-0.75, 0.1, -0.4)) @ Spinning((0, 0, 1), 2000)
            ),
            Body(
                "ball",
                assemble(sphere(0.33, dead_leaves(rng, 512), 80)),
                Repeating(Ballistic((-1.7, 0.42, 0.35), (12, 0, 0)), 0.28) @ Spinning((0.2, 1, 0.1), 300),
            ),
            Body(
                "ring",
                assemble(torus(0.42, 0.17, checker(rng, 512), 64)),
                Still((0.75, 0.3, 0)) @ Spinning((1, 0.4, 0.2), 720, 35),
            ),
            Body(
                "box",
                assemble(*box((0.5, 0.5, 0.5), [rectangles(rng, 256) for _ in range(6)], 16)),
                Repeating(Ballistic((1.9, -0.45, 0.6), (-8, 0, 0)), 0.48) @ Spinning((0.3, 1, 0.5), 1200),
            ),
            Body(
                "stick",
                assemble(capsule(0.5, 0.2, blobs(rng, 256), 60).moved(Still((0, -0.25, 0)))),
                Still((0.05, -0.3, 0.1)) @ Vibrating((0, 0.25, 0), 8) @ Spinning((0, 0.2, 1), 480, 23),
            ),
        ),
        camera=Camera((0, 0, 3.2), field_of_view_deg=45.8),
        lighting=Lighting(0.2, 0.8, (0.4, 0.5, 0.768)),
        frame_rate_hz=frame_rate_hz,
        renderer=renderer,
    )
