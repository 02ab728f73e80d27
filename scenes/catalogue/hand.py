"""Hand: it waves, and its fingers drum."""

from __future__ import annotations

import numpy as np

from scenes.catalogue import stage
from scenes.drawing import Canvas
from scenes.meshes import assemble, capsule, sphere
from scenes.protocol import Scene
from scenes.renderers.protocol import Renderer
from scenes.textures import Texture
from scenes.trajectories import Still, Swinging
from scenes.world import Body, World

FINGERS = {
    "little": (-0.3, 0.42, 0.36, 0.075, 12),
    "ring": (-0.105, 0.5, 0.48, 0.085, 4),
    "middle": (0.095, 0.52, 0.54, 0.088, -3),
    "index": (0.29, 0.46, 0.48, 0.085, -10),
}
"""x and y of the knuckle, length, radius, spread [degrees]"""


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    skin = wrinkled(rng)
    wave = Still((0, -0.38, 0)) @ Swinging((0, 0, 1), 24, 7) @ Still(turn=(0, 12, 0))
    palm = sphere(0.44, skin, 48).scaled((0.92, 1.1, 0.3)).moved(Still((0, 0.15, 0)))
    wrist = capsule(0.7, 0.22, skin).scaled((1, 1, 0.7)).moved(Still((0, -0.8, 0)))
    sleeve = capsule(0.6, 0.3, striped()).scaled((1, 1, 0.8)).moved(Still((0, -1.15, 0)))
    bodies = [Body("palm", assemble(palm, wrist, sleeve), wave)]
    for number, (name, (x, y, length, radius, spread)) in enumerate(FINGERS.items()):
        bend = Still((x, y, 0.02), (0, 0, spread)) @ Still(turn=(18, 0, 0)) @ Swinging((1, 0, 0), 16, 16, 0.17 * number)
        bodies.append(Body(name, assemble(capsule(length, radius, fingered(rng), taper=0.8)), wave @ bend))
    thumb = Still((0.34, 0.02, 0.06), (0, 0, -48)) @ Swinging((0, 0, 1), 12, 12)
    bodies.append(Body("thumb", assemble(capsule(0.46, 0.1, fingered(rng), taper=0.85)), wave @ thumb))
    back = stage.wall((0.5 * stage.boards(rng, 24) - 0.05).astype(np.float32))
    return World(shape, (back, *bodies), stage.camera(0.0), frame_rate_hz=frame_rate_hz, renderer=renderer)


def wrinkled(rng: np.random.Generator) -> Texture:
    canvas = Canvas(512, 256, 0.72).picture(stage.mottled(rng, 0.6, 0.85, 256), 0, 0, 1, 1)
    for line in (
        [(-0.12, 0.42), (0.0, 0.38), (0.12, 0.43)],
        [(-0.12, 0.52), (0.02, 0.47), (0.12, 0.5)],
        [(0.09, 0.4), (0.04, 0.65)],
    ):
        for shift in (0.0, 1.0):
            canvas.line([(x + shift, y) for x, y in line], 0.01, 0.4)
    return canvas.texture()


def fingered(rng: np.random.Generator) -> Texture:
    """Creases at the joints, a nail on the back."""
    canvas = Canvas(192, 256, 0.75).picture(stage.mottled(rng, 0.62, 0.85, 128), 0, 0, 1, 1)
    for y in (0.36, 0.4, 0.62, 0.66):
        canvas.rectangle(0, y, 1, y + 0.012, 0.4)
    return canvas.ellipse(0.5, 0.15, 0.12, 0.06, 0.95).texture()


def striped() -> Texture:
    canvas = Canvas(256, 128, 0.15)
    for k in range(5):
        canvas.rectangle(0, (k + 0.1) / 5, 1, (k + 0.5) / 5, 0.85)
    return canvas.texture()
