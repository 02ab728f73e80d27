"""Text: a drum and a wheel with letters, spinning."""

from __future__ import annotations

import numpy as np

from scenes.catalogue import stage
from scenes.drawing import Canvas
from scenes.meshes import assemble, disc, lathe
from scenes.protocol import Scene
from scenes.renderers.protocol import Lighting, Renderer
from scenes.textures import Texture
from scenes.trajectories import Spinning, Still
from scenes.world import Body, World

LINES = ("SPIKE CAMERA 40000 HZ  ", "THE QUICK BROWN FOX  ", "0123456789 ABCDEFGH  ", "one bit a frame only  ")


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    drum = lathe([(0.0, -0.8), (0.56, -0.8), (0.56, 0.8), (0.0, 0.8)], printed(), 96, smooth=False)
    plate = disc(0.62, dial(), 128)
    return World(
        shape,
        bodies=(
            stage.wall(stage.mottled(rng, 0.15, 0.4)),
            Body("drum", assemble(drum), Still((-0.8, 0.0, 0), (0, 0, 8)) @ Spinning((0, 1, 0), -1300)),
            Body("wheel", assemble(plate), Still((0.78, 0.0, 0.1), (0, -14, 0)) @ Spinning((0, 0, 1), 1500)),
        ),
        camera=stage.camera(0.3),
        lighting=Lighting(0.6, 0.4),
        frame_rate_hz=frame_rate_hz,
        renderer=renderer,
    )


def printed() -> Texture:
    """Lines around the drum's wall; the profile is 0.56 + 1.6 + 0.56 long."""
    canvas = Canvas(1400, 1080, 0.9)
    low, high = 0.56 / 2.72, 2.16 / 2.72
    for k, line in enumerate(LINES):
        y = low + (k + 0.5) * (high - low) / len(LINES)
        if k % 2:
            canvas.rectangle(0, y - 0.07, 1, y + 0.07, 0.07)
        canvas.text(line, 0.5, y, 0.065, 0.92 if k % 2 else 0.04)
    for k in range(24):
        canvas.rectangle(k / 24, 0, (k + 0.5) / 24, low, 0.2)
    return canvas.texture()


def dial() -> Texture:
    """Letters around a wheel, tops outward."""
    size = 512
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
    y, x = (np.indices((size, size)) + 0.5) / size - 0.5
    strip = Canvas(1560, 120, 0.93)
    for k, letter in enumerate(letters):
        strip.text(letter, (k + 0.5) / len(letters), 0.5, 0.5, 0.04)
    inner = Canvas(1040, 120, 0.1)
    for k in range(16):
        inner.text(str(k), (k + 0.5) / 16, 0.5, 0.5, 0.92)
    radius, turn = 2 * np.hypot(x, y), np.arctan2(y, x) / (2 * np.pi) % 1
    picture = np.where(radius < 0.4, np.where(np.floor(turn * 10) % 2, 0.15, 0.85), 0.9)
    for ring, low, high in ((strip.texture(), 0.68, 0.98), (inner.texture(), 0.4, 0.66)):
        here = (radius >= low) & (radius < high)
        rows = ((high - radius[here]) / (high - low) * len(ring)).astype(int).clip(0, len(ring) - 1)
        picture[here] = ring[rows, (turn[here] * ring.shape[1]).astype(int) % ring.shape[1]]
    picture[(radius > 0.66) & (radius < 0.68)] = 0.2
    return picture.astype(np.float32)
