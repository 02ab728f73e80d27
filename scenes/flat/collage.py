"""Collage: textured shapes in random rigid motion over a textured background.

The world is a torus somewhat larger than the picture: a shape that leaves on one side comes back on the
other, so a clip of any length stays busy.  A shape's centre moves as c(t) = c(0) + v t and turns as
a(t) = a(0) + w t; its light is low + (high - low) * texture.  Edges are antialiased over one pixel.
Made for training and judging the denoiser: unlimited, cheap, with exact truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.keys import AT_REST, LONGEST_INTERVAL, paint_keys
from scenes.protocol import FRAME_RATES_HZ, MOST_LIGHT, MOST_PLACE, Gaze, Truth
from scenes.textures import random_texture
from spikecam_env.checked import checked_number, checked_shape
from spikecam_env.compiled import njit
from spikecam_env.errors import InputError
from spikecam_env.sensor import Keyframes
from spikecam_env.types import Floats, Pictures

SHAPES = ("ellipse", "rectangle", "fan")
MOTION_PER_KEY = 1.0  # pixels; about 1 % rms error of linear light at 1.2


class Collage:
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
        rng = np.random.default_rng(seed)
        count = int(rng.integers(3, 7)) if layers is None else layers
        drawn = [_draw_layer(rng, self, speed, contrast, kinds, textures, i == 0) for i in range(count + 1)]
        self._background, self._shapes = drawn[0], tuple(drawn[1:])
        self.key_every = _key_every(max(layer.fastest_pixel for layer in drawn))

    def radiance(self, start: int, stop: int, gaze: Gaze | None = None) -> Keyframes:
        """Keys at multiples of `key_every` that cover frames [start, stop]; with gaze also at both ends."""
        if stop < start:
            raise InputError(f"radiance from frame {start} to {stop}; stop must not come before start")
        first, last = start // self.key_every, -(-stop // self.key_every)
        frame = np.arange(first, last + 1) * float(self.key_every)
        if gaze is not None:
            frame = np.union1d(frame[(frame > start) & (frame < stop)], [start, stop])
        camera = gaze or AT_REST
        return paint_keys(self.shape, frame, lambda t, picture: self._paint(picture, t, camera.at(t)))

    def truth(self, frame: float, gaze: Gaze | None = None) -> Truth:
        """Radiance, flow [pixels/frame] and object number (0: background, then the shapes from the back)."""
        radiance, owner = np.empty(self.shape, np.float32), np.zeros(self.shape, np.int32)
        camera = gaze or AT_REST
        offset = camera.at(frame)
        self._paint(radiance, frame, offset, owner)
        flow = np.empty((*self.shape, 2), np.float32)
        for number, layer in enumerate((self._background, *self._shapes)):
            mine = owner == number
            flow[mine] = layer.velocity_at(frame, offset, self.shape)[mine]
        flow -= np.asarray(camera.rate, np.float32)
        poses = {f"shape-{n}": layer.pose(frame, offset, self.shape) for n, layer in enumerate(self._shapes, 1)}
        return Truth(radiance, flow, owner, None, poses | {"camera": offset})

    def places(self, frame: float, gaze: Gaze | None = None) -> dict[str, tuple[float, float]]:
        """Where the shapes' middles are seen, see `scenes.protocol.Placed`."""
        offset = (gaze or AT_REST).at(frame)
        return {f"shape-{n}": layer.pose(frame, offset, self.shape)[:2] for n, layer in enumerate(self._shapes, 1)}

    def _paint(
        self, picture: Pictures, frame: float, offset: tuple[float, float], owner: NDArray[np.int32] | None = None
    ) -> None:
        """The picture (H, W) at a frame, in place; owner (H, W): where that is given, which shape is seen."""
        self._background.tile(picture, frame, offset)
        for number, layer in enumerate(self._shapes, 1):
            place, sprite = layer.shown(frame, offset, self.shape)
            _lay(picture[place], sprite)
            if owner is not None:
                owner[place][sprite[..., 1] > 0.5] = number


@dataclass(frozen=True)
class _Layer:
    """A premultiplied sprite (size, size, 2): light x coverage, and coverage; it turns about its middle."""

    sprite: Pictures
    radius: float
    centre: tuple[float, float]
    velocity: tuple[float, float]
    angle: float
    spin: float
    zoom: float

    @property
    def fastest_pixel(self) -> float:
        """Fastest point [pixels/frame]."""
        return float(np.hypot(*self.velocity)) + abs(self.spin) * self.radius

    def pose(self, frame: float, offset: tuple[float, float], shape: tuple[int, int]) -> tuple[float, float, float]:
        """(x, y) of the middle in the picture [pixels] and the angle [radians]."""
        place = [
            (c + v * frame - o + self.radius) % (size + 2 * self.radius) - self.radius
            for c, v, o, size in zip(self.centre, self.velocity, offset, shape[::-1], strict=True)
        ]
        return place[0], place[1], self.angle + self.spin * frame

    def velocity_at(self, frame: float, offset: tuple[float, float], shape: tuple[int, int]) -> Pictures:
        """(H, W, 2): velocity of this layer's surface in every pixel [pixels/frame], x then y."""
        x, y, _ = self.pose(frame, offset, shape)
        rows, columns = np.indices(shape)
        vx, vy = self.velocity[0] - self.spin * (rows - y), self.velocity[1] + self.spin * (columns - x)
        return np.stack([vx, vy], axis=-1).astype(np.float32)

    def tile(self, picture: Pictures, frame: float, offset: tuple[float, float]) -> None:
        """The sprite's light repeated over the whole picture, in place."""
        x = self.centre[0] + self.velocity[0] * frame - offset[0]
        y = self.centre[1] + self.velocity[1] * frame - offset[1]
        matrix = self._to_sprite(x, y, self.angle)
        _warp(self._light, matrix, (picture.shape[0], picture.shape[1]), cv2.BORDER_WRAP, picture)

    @cached_property
    def _light(self) -> Pictures:
        return np.ascontiguousarray(self.sprite[..., 0])

    def shown(
        self, frame: float, offset: tuple[float, float], shape: tuple[int, int]
    ) -> tuple[tuple[slice, slice], Pictures]:
        """The rows and columns of the picture that the sprite may reach, and the sprite there, (h, w, 2)."""
        x, y, angle = self.pose(frame, offset, shape)
        reach = self.radius + 2
        left, top = max(int(x - reach), 0), max(int(y - reach), 0)
        right, bottom = min(int(x + reach) + 1, shape[1]), min(int(y + reach) + 1, shape[0])
        if left >= right or top >= bottom:
            return np.s_[0:0, 0:0], np.empty((0, 0, 2), np.float32)
        matrix = self._to_sprite(x - left, y - top, angle)
        return np.s_[top:bottom, left:right], _warp(
            self.sprite, matrix, (bottom - top, right - left), cv2.BORDER_CONSTANT
        )

    def _to_sprite(self, x: float, y: float, angle: float) -> Floats:
        """2 x 3 map from picture (x, y) to sprite, whose middle is shown at (x, y)."""
        cos, sin = np.cos(angle) * self.zoom, np.sin(angle) * self.zoom
        middle = (len(self.sprite) - 1) / 2
        return np.array([[cos, sin, middle - cos * x - sin * y], [-sin, cos, middle + sin * x - cos * y]])


@njit(cache=True, nogil=True, error_model="numpy")
def _lay(picture: Pictures, sprite: Pictures) -> None:
    """Lay a sprite (h, w, 2) over a picture (h, w), in place: out = light + (1 - coverage) x picture."""
    one = np.float32(1)
    for row in range(picture.shape[0]):
        for x in range(picture.shape[1]):
            picture[row, x] = picture[row, x] * (one - sprite[row, x, 1]) + sprite[row, x, 0]


def _warp(
    image: Pictures, matrix: Floats, shape: tuple[int, int], border: int, into: Pictures | None = None
) -> Pictures:
    """The image at matrix (x, y, 1) for every pixel (x, y) of a picture of `shape`, bilinear; `into` is overwritten."""
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(cv2.warpAffine(image, matrix, shape[::-1], into, flags, border), np.float32)


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
    if background:
        sprite = np.stack([grey, np.ones_like(grey)], axis=-1)
        return _Layer(sprite, 0.0, centre, velocity, angle, 0.0, zoom)
    extent = rng.uniform(0.06, 0.4, 2) * min(scene.shape)
    mask = _mask(str(rng.choice(SHAPES)), float(extent[0]), float(extent[1]), int(rng.integers(2, 6)))
    radius = len(mask) / 2
    spin = rng.uniform(-1, 1) * min(0.03, speed / radius) if rng.random() < 0.4 else 0.0
    filled = _fill(grey, len(mask), rng, zoom) * mask
    return _Layer(np.stack([filled, mask], axis=-1), radius, centre, velocity, angle, spin, 1.0)


def _fill(grey: Pictures, size: int, rng: np.random.Generator, zoom: float) -> Pictures:
    """A (size, size) piece of the texture, magnified by 1 / zoom, repeated where it ends."""
    x, y = rng.uniform(0, len(grey), 2)
    matrix = np.array([[zoom, 0, x], [0, zoom, y]])
    return _warp(grey, matrix, (size, size), cv2.BORDER_WRAP)


def _mask(kind: str, half_width: float, half_height: float, blades: int) -> Pictures:
    """Coverage of a shape in its sprite, from the signed distance to its edge [pixels]."""
    reach = float(np.hypot(half_width, half_height)) if kind == "rectangle" else max(half_width, half_height)
    size = 2 * int(np.ceil(reach + 2))
    y, x = np.indices((size, size)) - (size - 1) / 2
    radius = np.hypot(x, y)
    if kind == "ellipse":
        inside = (1 - np.hypot(x / half_width, y / half_height)) * min(half_width, half_height)
    elif kind == "rectangle":
        inside = np.minimum(half_width - abs(x), half_height - abs(y))
    else:
        edge = np.sin(blades * np.arctan2(y, x)) * radius / blades
        inside = np.minimum(edge, reach - radius)
    return np.asarray(np.clip(inside + 0.5, 0, 1).astype(np.float32))


def _key_every(fastest: float) -> int:
    """Frames between keys: the largest power of two with at most MOTION_PER_KEY of motion."""
    every = LONGEST_INTERVAL
    while every > 1 and every * fastest > MOTION_PER_KEY:
        every //= 2
    return every
