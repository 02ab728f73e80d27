"""Fan: five blades at 2000 turns a minute behind their guard."""

from __future__ import annotations

import numpy as np

from scenes.catalogue import stage
from scenes.drawing import Canvas
from scenes.meshes import Part, assemble, capsule, lathe, sheet, torus
from scenes.protocol import Scene
from scenes.renderers.protocol import Renderer
from scenes.textures import Texture
from scenes.trajectories import Spinning, Still
from scenes.world import Body, World

BLADES = 5


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    upright = Still(turn=(90, 0, 0))
    hub = lathe([(0.0, -0.1), (0.17, -0.1), (0.17, 0.06), (0.12, 0.13), (0.0, 0.16)], maker()).moved(upright)
    blades = [
        side.moved(Still(turn=(0, 0, 360 * k / BLADES))) for k in range(BLADES) for side in blade(painted(rng, k))
    ]
    rings = [torus(radius, 0.014, 0.75, 72).moved(upright) for radius in (0.3, 0.62, 0.93)]
    spokes = [capsule(0.68, 0.011, 0.75, 12).moved(Still(turn=(0, 0, 45 * k)) @ Still((0, 0.25, 0))) for k in range(8)]
    stand = [
        capsule(1.1, 0.06, 0.4).moved(Still((0, -1.25, 0))),
        lathe([(0.0, -0.1), (0.16, -0.1), (0.16, 0.1), (0.0, 0.1)], 0.25, smooth=False).moved(upright),
    ]
    return World(
        shape,
        bodies=(
            stage.wall(stage.mottled(rng, 0.06, 0.2)),
            Body("stand", assemble(*stand), Still((0, 0, -0.35)), backdrop=True),
            Body("blades", assemble(hub, *blades), Spinning((0, 0, 1), 2000)),
            Body("guard", assemble(*rings, *spokes), Still((0, 0, 0.3))),
        ),
        camera=stage.camera(0.3),
        frame_rate_hz=frame_rate_hz,
        renderer=renderer,
    )


def blade(texture: Texture) -> list[Part]:
    """Front and back of a twisted blade that points up."""

    def front(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        radius = 0.12 + 0.76 * v
        half = 0.27 * np.sqrt(np.clip(np.sin(np.pi * (0.12 + 0.86 * v)), 0.0, 1)) * (0.5 + 0.5 * v)
        across = (2 * u - 1) * half
        pitch = np.radians(32 - 14 * v)
        return across * np.cos(pitch) + 0.15 * v, np.sqrt(radius**2 - 0.2 * across**2), across * np.sin(pitch)

    def back(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        x, y, z = front(1 - u, v)
        return x, y, z - 0.012

    return [sheet(front, (24, 12), texture), sheet(back, (24, 12), 0.3)]


def painted(rng: np.random.Generator, number: int) -> Texture:
    """Each blade has its number and its own mark."""
    canvas = Canvas(192, 288, 0.62 + 0.06 * number)
    canvas.text(str(number + 1), 0.5, 0.42, 0.2, 0.05)
    canvas.rectangle(0, 0.12, 1, 0.12 + 0.02 * (number + 1), 0.08)
    for _ in range(25):
        canvas.disc(rng.random(), rng.uniform(0.6, 1), rng.uniform(0.005, 0.02), 0.3)
    return canvas.texture()


def maker() -> Texture:
    canvas = Canvas(256, 128, 0.2)
    for k in range(4):
        canvas.rectangle((k + 0.1) / 4, 0, (k + 0.4) / 4, 1, 0.9)
    return canvas.texture()
