"""The stage of the catalogue's scenes: a camera that sees 2 units of height, floors and walls."""

from __future__ import annotations

import cv2
import numpy as np

from scenes.camera import Camera
from scenes.drawing import Canvas
from scenes.meshes import assemble, rectangle
from scenes.textures import Texture, fractal_noise
from scenes.trajectories import AT_REST, Still, Trajectory
from scenes.world import Body

GRAVITY_CM = (0.0, -981.0, 0.0)
"""[cm/s^2] A unit is a centimetre."""

UNITS_SEEN = 2.0
"""Height of the view at the origin; 3.2 across at 250 x 400."""


def camera(above: float = 0.8, distance: float = 6.0, shake: Trajectory = AT_REST) -> Camera:
    """Looks at the origin from a little above."""
    far = float(np.hypot(above, distance))
    return Camera(
        (0, above, distance), field_of_view_deg=float(np.degrees(2 * np.arctan(UNITS_SEEN / 2 / far))), shake=shake
    )


def floor(texture: Texture, height: float = -0.85, depth: float = 5.0) -> Body:
    """From z = 2.5 to the back."""
    surface = assemble(rectangle(12, depth, texture))
    return Body("floor", surface, Still((0, height, 2.5 - depth / 2), (-90, 0, 0)), backdrop=True)


def wall(texture: Texture, depth: float = -2.5, size: tuple[float, float] = (12.0, 7.5)) -> Body:
    """Upright, behind everything."""
    return Body("wall", assemble(rectangle(*size, texture)), Still((0, 1.0, depth)), backdrop=True)


def boards(
    rng: np.random.Generator, rows: int = 10, size: int = 1024, dark: float = 0.3, bright: float = 0.55
) -> Texture:
    """Wooden boards: grain along x, a dark joint between two."""
    grain = np.repeat(rng.random((rows * 24, 8)), size // 8, axis=1).astype(np.float32)
    fine = fractal_noise(rng, size)[: rows * 24]
    fine = np.repeat(fine[:, : size // 16], 16, axis=1)
    board = np.repeat(rng.random(rows), 24).astype(np.float32)[:, None]
    value = 0.5 * board + 0.3 * fine + 0.2 * grain
    value[::24] *= 0.2
    value[1::24] *= 0.5
    return np.asarray((dark + (bright - dark) * value).astype(np.float32))


def mottled(rng: np.random.Generator, low: float, high: float, size: int = 768) -> Texture:
    """Soft noise between two greys."""
    return (low + (high - low) * fractal_noise(rng, size)).astype(np.float32)


def outdoors(rng: np.random.Generator) -> tuple[Body, Body]:
    """Hills and a ground of gravel with a kerb, in metres."""
    land = Canvas(1024, 512, 0.75).picture((0.55 + 0.35 * fractal_noise(rng, 512)).astype(np.float32), 0, 0, 1, 1)
    x = np.linspace(0, 1, 65)
    for height, grey in ((0.45, 0.35), (0.56, 0.25), (0.66, 0.15)):
        ridge = height + 0.08 * np.interp(x, np.linspace(0, 1, 14), rng.normal(size=14))
        land.polygon([(0, 1), *zip(x, ridge, strict=True), (1, 1)], grey)
    for place in np.sort(rng.random(40)):
        top = rng.uniform(0.52, 0.66)
        land.ellipse(place, top, rng.uniform(0.008, 0.016), rng.uniform(0.03, 0.06), rng.uniform(0.06, 0.14))
    gravel = Canvas(1024, 512, 0.3).picture((0.2 + 0.3 * speckle(rng, 512)).astype(np.float32), 0, 0, 1, 1)
    gravel.rectangle(0, 0.6, 1, 0.63, 0.7)
    back = assemble(rectangle(30, 15, land.texture()))
    ground = assemble(rectangle(30, 16, gravel.texture()))
    return (
        Body("hills", back, Still((0, 1.5, -9)), backdrop=True),
        Body("ground", ground, Still((0, 0, -1.5), (-90, 0, 0)), backdrop=True),
    )


def speckle(rng: np.random.Generator, size: int) -> Texture:
    """Gravel: noise of a few texels."""
    grains = np.asarray(cv2.GaussianBlur(rng.random((size, size)).astype(np.float32), (0, 0), 1.2))
    return np.asarray(np.clip(0.5 + 2.5 * (grains - 0.5), 0, 1).astype(np.float32))
