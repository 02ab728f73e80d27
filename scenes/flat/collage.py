"""Collage: textured shapes in random rigid motion over a textured background.

The world is a torus somewhat larger than the picture: a shape that leaves on one side comes back on the
other, so a clip of any length stays busy.  A shape's centre moves as c(t) = c(0) + v t and turns as
a(t) = a(0) + w t; its light is low + (high - low) * texture.  Edges are antialiased over one pixel.
Made for training and judging the denoiser: unlimited, cheap, with exact truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scenes.flat.painted_disk import EVERYWHERE, MARGIN, PlacedDisc, Plane, Texels, Tile
from scenes.flat.planes import MovingDisc, PlanarScene, painted_planes
from scenes.keys import AT_REST, LONGEST_INTERVAL
from scenes.protocol import FRAME_RATES_HZ, MOST_LIGHT, MOST_PLACE, Gaze, Truth
from scenes.textures import random_texture
from spikecam_env.checked import checked_number, checked_shape
from spikecam_env.errors import InputError
from spikecam_env.types import Floats, Pictures

SHAPES = ("ellipse", "rectangle", "fan")
MOTION_PER_KEY = 1.0  # pixels; about 1 % rms error of linear light at 1.2


class Collage(PlanarScene):
    """Scene: `layers` shapes over a background (see `scenes.protocol.Scene`).

    Args:
        shape: (rows, columns).
        seed: the whole scene follows from it.
        speed: fastest layer [pixels/frame]; each layer draws its own in [0, speed], some stay still.
        light: brightest radiance; 1.0 makes the nominal pixel fire once a frame.
        contrast: darkest radiance is light / contrast.
        layers: number of shapes, background apart; default: drawn in 3..6.
        kinds: texture kinds (`scenes.textures`); default: all.
        textures: square float32 pictures in [0, 1] to use instead of procedural ones.

    Raises:
        InputError: a value is out of range, by name.

    Example:
        >>> scene = Collage((16, 24), seed=1)
        >>> scene.radiance(0, 64).radiance.shape[1:]
        (16, 24)
    """

    def __init__(
        self,
        shape: tuple[int, int],
        seed: int = 0,
        *,
        speed: float = 1.0,
        light: float = 0.4,
        contrast: float = 20.0,
        layers: int | None = None,
        kinds: Sequence[str] | None = None,
        textures: Sequence[Pictures] | None = None,
        frame_rate_hz: float = 40_000.0,
    ) -> None:
        self.shape = checked_shape(shape)
        self.frame_rate_hz = checked_number(frame_rate_hz, "frame_rate_hz", *FRAME_RATES_HZ)
        self.light = checked_number(light, "light", 0.0, MOST_LIGHT, above=True)
        checked_number(speed, "speed", 0.0, MOST_PLACE)
        checked_number(contrast, "contrast", 1.0)
        for texture in () if textures is None else textures:
            if texture.ndim != 2 or texture.shape[0] != texture.shape[1]:
                raise InputError(f"textures has one of shape {texture.shape}; they must be square")
        rng = np.random.default_rng(seed)
        count = int(rng.integers(3, 7)) if layers is None else layers
        drawn = [_draw_layer(rng, self, speed, contrast, kinds, textures, i == 0) for i in range(count + 1)]
        self._background, self._shapes, self._dark = drawn[0], tuple(drawn[1:]), Tile.dark(self.shape)
        self.key_every = _key_every(max(layer.fastest_pixel for layer in drawn))

    def interval(self, gaze: Gaze | None = None) -> int:
        """`key_every`, whatever the gaze."""
        return self.key_every

    def velocity(self, gaze: Gaze | None = None) -> tuple[float, float]:
        """(x, y) of the background in the picture [pixels/frame]."""
        (x, y), (pan, tilt) = self._background.velocity, (gaze or AT_REST).rate
        return x - pan, y - tilt

    def plane_at(self, frame: Floats, gaze: Gaze) -> Plane:
        """See `PlanarScene`."""
        layers = [layer.placed(frame, gaze, self.shape) for layer in (self._background, *self._shapes)]
        return Plane(self.shape, frame, self._dark, np.zeros(len(frame)), np.zeros(len(frame)), layers)

    def placed_discs(self, frame: float, gaze: Gaze) -> dict[str, MovingDisc]:
        """The shapes."""
        return {f"shape-{n}": layer.at(frame, gaze, self.shape) for n, layer in enumerate(self._shapes, 1)}

    def truth(self, frame: float, gaze: Gaze | None = None) -> Truth:
        """Object n is the n-th shape from the back, its pose (x, y) [pixels] and its angle, clockwise [radians]."""
        truth = super().truth(frame, gaze)
        shapes = self.placed_discs(frame, gaze or AT_REST).items()
        return replace(truth, poses=truth.poses | {name: (*shape.centre, -shape.angle) for name, shape in shapes})


@dataclass(frozen=True)
class _Layer:
    """A texture that moves and turns about its middle: the background, or a shape, which has a mask."""

    texels: Texels
    mask: Texels | None
    radius: float
    centre: tuple[float, float]
    velocity: tuple[float, float]
    angle: float
    spin: float

    @property
    def fastest_pixel(self) -> float:
        """Fastest point [pixels/frame]."""
        return float(np.hypot(*self.velocity)) + abs(self.spin) * self.radius

    def placed(self, frame: Floats, gaze: Gaze, shape: tuple[int, int]) -> PlacedDisc:
        """The layer at frames (K,)."""
        return PlacedDisc(self.texels, self.radius, *self._middle(frame, gaze, shape), -self._turned(frame), self.mask)

    def at(self, frame: float, gaze: Gaze, shape: tuple[int, int]) -> MovingDisc:
        """The layer at a frame."""
        return MovingDisc(self._middle(frame, gaze, shape), self.velocity, -self._turned(frame), -self.spin)

    def _turned(self, frame: Any) -> Any:
        """Angle at a frame, or at each of several, clockwise in the picture [radians]."""
        return self.angle + self.spin * frame

    def _middle(self, frame: Any, gaze: Gaze, shape: tuple[int, int]) -> tuple[Any, Any]:
        """(x, y) of the middle in the picture [pixels]; a shape that leaves on one side comes back on the other."""
        place = [c + v * frame - o for c, v, o in zip(self.centre, self.velocity, gaze.at(frame), strict=True)]
        if self.mask is not None:
            beside = self.radius
            place = [(p + beside) % (n + 2 * beside) - beside for p, n in zip(place, shape[::-1], strict=True)]
        return place[0], place[1]


def _draw_layer(
    rng: np.random.Generator,
    scene: Collage,
    speed: float,
    contrast: float,
    kinds: Sequence[str] | None,
    textures: Sequence[Pictures] | None,
    background: bool,
) -> _Layer:
    texture = random_texture(rng, 256, kinds) if textures is None else textures[int(rng.integers(len(textures)))]
    low, high = np.sort(np.exp(rng.uniform(-np.log(contrast), 0, 2)))
    if rng.random() < 0.5:
        low, high = high, low
    grey = (scene.light * (low + (high - low) * texture)).astype(np.float32)
    moving = speed * rng.random() if rng.random() < 0.85 else 0.0
    heading = rng.uniform(0, 2 * np.pi)
    velocity = (moving * np.cos(heading), moving * np.sin(heading))
    height, width = scene.shape
    centre = (rng.uniform(0, width), rng.uniform(0, height))
    angle, zoom = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 1.0)
    repeated = Texels.repeated(grey, zoom)
    if background:
        return _Layer(repeated, None, EVERYWHERE, centre, velocity, angle, 0.0)
    extent = rng.uniform(0.06, 0.4, 2) * min(scene.shape)
    mask = _mask(str(rng.choice(SHAPES)), float(extent[0]), float(extent[1]), int(rng.integers(2, 6)))
    radius = len(mask) / 2
    spin = rng.uniform(-1, 1) * min(0.03, speed / radius) if rng.random() < 0.4 else 0.0
    filled = _piece(repeated, rng.uniform(0, len(grey), 2), len(mask)) * mask
    texels, coverage = (Texels.of(np.pad(sprite, MARGIN)) for sprite in (filled, mask))
    return _Layer(texels, coverage, radius, centre, velocity, angle, spin)


def _piece(texels: Texels, corner: Floats, size: int) -> Pictures:
    """(size, size) pixels of a repeated texture; the first pixel is at `corner` (x, y) [texels]."""
    zero = np.zeros(1)
    middle, zoom, _ = PlacedDisc(texels, EVERYWHERE, zero, zero, zero).grid
    x, y = (middle - corner[:, None]) / zoom
    layer = PlacedDisc(texels, EVERYWHERE, x, y, zero)
    piece: Pictures = painted_planes([Plane((size, size), zero, Tile.dark((size, size)), zero, zero, [layer])])[
        0
    ].radiance[0]
    return piece


def _mask(kind: str, half_width: float, half_height: float, blades: int) -> Pictures:
    """Coverage of a shape in its sprite."""
    reach = float(np.hypot(half_width, half_height)) if kind == "rectangle" else max(half_width, half_height)
    size = 2 * int(np.ceil(reach + 2))
    y, x = np.indices((size, size)) - (size - 1) / 2
    inside = depths(np, x, y, half_width, half_height, blades)[SHAPES.index(kind)]
    return np.asarray(np.clip(inside + 0.5, 0, 1).astype(np.float32))


def depths(of: Any, x: Any, y: Any, half_width: Any, half_height: Any, blades: Any) -> tuple[Any, Any, Any]:
    """Depth in an ellipse, a rectangle and a fan (SHAPES) at (x, y) from the middle [pixels]; of: numpy or torch."""
    radius = of.hypot(x, y)
    ellipse = (1 - of.hypot(x / half_width, y / half_height)) * of.minimum(half_width, half_height)
    rectangle = of.minimum(half_width - abs(x), half_height - abs(y))
    blade = of.sin(blades * of.arctan2(y, x)) * radius / blades
    return ellipse, rectangle, of.minimum(blade, of.maximum(half_width, half_height) - radius)


def _key_every(fastest: float) -> int:
    """Frames between keys: the largest power of two with at most MOTION_PER_KEY of motion."""
    every = LONGEST_INTERVAL
    while every > 1 and every * fastest > MOTION_PER_KEY:
        every //= 2
    return every
