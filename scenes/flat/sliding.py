"""A texture that slides past: the simplest motion, the same everywhere, with a closed-form truth.

    light(x, y, t) = texture(x - vx t + pan, y - vy t + tilt),  flow = v - gaze rate      [pixels/frame]

The texture repeats without end.  It is averaged over the area of a pixel once, at `SAMPLES_PER_PIXEL` places along
either side of a pixel, and read between them.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenes.flat.painted_disk import Plane, Tile
from scenes.flat.planes import PlanarScene
from scenes.keys import AT_REST, interval_for
from scenes.protocol import FRAME_RATES_HZ, MOST_LIGHT, MOST_PLACE, Gaze, Truth
from scenes.textures import dead_leaves
from spikecam_env.checked import checked_memory, checked_number, checked_shape
from spikecam_env.errors import InputError
from spikecam_env.types import Floats, Pictures

SAMPLES_PER_PIXEL = 4


class SlidingTexture(PlanarScene):
    """Scene: one texture over the whole picture at constant velocity.

    Truth: all is object 0; poses["texture"] is where its upper left corner has gone, (x, y) [pixels].

    Args:
        shape: (rows, columns) of the sensor.
        velocity_px_s: (x, y) [pixels/s].
        texture: (n, m) in [0, 1], repeated; its values are little squares of light.  Default: fallen leaves.
        texel_px: size of such a square [pixels]; with 0.5 the default texture repeats every 256 pixels.
        light: radiance of texture value 0 and 1: (dark, bright).
        seed: of the default texture.
        frame_rate_hz: frames a second.
        motion_per_key: most the texture may move between two keys [pixels], as far as whole frames allow.

    Raises:
        InputError: a value is out of range, by name.

    Example:
        >>> scene = SlidingTexture((16, 24), velocity_px_s=(20_000.0, 0.0))
        >>> scene.truth(0.5).flow[0, 0].tolist()  # pixels a frame
        [0.5, 0.0]
    """

    def __init__(
        self,
        shape: tuple[int, int] = (250, 400),
        velocity_px_s: tuple[float, float] = (20_000.0, 0.0),
        texture: ArrayLike | None = None,
        texel_px: float = 0.5,
        light: tuple[float, float] = (0.05, 0.6),
        seed: int = 0,
        frame_rate_hz: float = 40_000.0,
        motion_per_key: float = 0.6,
    ) -> None:
        values = dead_leaves(np.random.default_rng(seed), 512) if texture is None else np.asarray(texture, np.float32)
        _check(shape, velocity_px_s, values, texel_px, light, frame_rate_hz, motion_per_key)
        self.shape = (int(shape[0]), int(shape[1]))
        self.velocity_px_s, self.frame_rate_hz = velocity_px_s, float(frame_rate_hz)
        self.motion_per_key = float(motion_per_key)
        samples = _area_average(_area_average(values.T, texel_px).T, texel_px)
        radiance = (light[0] + (light[1] - light[0]) * samples).astype(np.float32)
        self._tile = Tile.of(radiance, self.shape, SAMPLES_PER_PIXEL)

    def __repr__(self) -> str:
        return f"SlidingTexture(shape={self.shape}, velocity_px_s={self.velocity_px_s})"

    def interval(self, gaze: Gaze | None = None) -> int:
        """See `PlanarScene`."""
        return interval_for(float(np.hypot(*self.velocity(gaze))), self.motion_per_key)

    def plane_at(self, frame: Floats, gaze: Gaze) -> Plane:
        """See `PlanarScene`."""
        x, y = (-SAMPLES_PER_PIXEL * (corner + 0.5) for corner in self.corner_at(frame, gaze))
        return Plane(self.shape, frame, self._tile, x % self._tile.period, y % len(self._tile.samples), [])

    def truth(self, frame: float, gaze: Gaze | None = None) -> Truth:
        """Ground truth at a frame; see `scenes.protocol.Truth`."""
        truth = super().truth(frame, gaze)
        return replace(truth, poses={"texture": self.corner_at(frame, gaze)} | truth.poses)

    def lit(self, gain: float) -> SlidingTexture:
        """The same texture with `gain` times its light."""
        other = copy.copy(self)
        other._tile = self._tile.lit(gain)
        return other

    def velocity(self, gaze: Gaze | None = None) -> tuple[float, float]:
        """(x, y) in the picture [pixels/frame]."""
        pan, tilt = (gaze or AT_REST).rate
        return self.velocity_px_s[0] / self.frame_rate_hz - pan, self.velocity_px_s[1] / self.frame_rate_hz - tilt

    def corner_at(self, frame: Any, gaze: Gaze | None = None) -> tuple[Any, Any]:
        """(x, y) in the picture of the texture's upper left corner [pixels], at a frame or at each of several; it
        started at (-0.5, -0.5)."""
        seconds = frame / self.frame_rate_hz
        pan, tilt = (gaze or AT_REST).at(frame)
        return self.velocity_px_s[0] * seconds - pan - 0.5, self.velocity_px_s[1] * seconds - tilt - 0.5


def _area_average(values: NDArray[np.floating], texel_px: float) -> Floats:
    """Averages over a pixel along the first axis, SAMPLES_PER_PIXEL a pixel; the first is that of a pixel whose
    upper edge is the texture's.

    Exact for squares of light: differences of the integral, which is straight between their edges.  To read between
    two samples blurs by 1 / 6 m^2 pixels^2 more (m: samples a pixel), so the box is that much narrower than a pixel.
    The period is rounded to whole samples.
    """
    texels = len(values)
    samples = max(1, round(texels * texel_px * SAMPLES_PER_PIXEL))
    pixel = SAMPLES_PER_PIXEL * texels / samples
    half = pixel / 2 * np.sqrt(1 - 2 / SAMPLES_PER_PIXEL**2)
    middle = np.arange(samples) * (texels / samples) + pixel / 2
    integral = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0, dtype=np.float64)])

    def up_to(place: Floats) -> Floats:
        turns, rest = np.divmod(place, texels)
        whole = np.minimum(rest.astype(int), texels - 1)
        part = (rest - whole)[:, None]
        light: Floats = integral[whole] + part * values[whole] + turns[:, None] * integral[-1]
        return light

    average: Floats = (up_to(middle + half) - up_to(middle - half)) / (2 * half)
    return average


def _check(
    shape: tuple[int, int],
    velocity_px_s: tuple[float, float],
    texture: Pictures,
    texel_px: float,
    light: tuple[float, float],
    frame_rate_hz: float,
    motion_per_key: float,
) -> None:
    checked_shape(shape)
    if texture.ndim != 2 or not texture.size or not (texture.min() >= 0 and texture.max() <= 1):
        raise InputError(f"texture has shape {texture.shape}; it must be (n, m) with values in [0, 1]")
    for axis in (0, 1):
        checked_number(velocity_px_s[axis], f"velocity_px_s[{axis}]", -MOST_PLACE, MOST_PLACE)
    if not 0 <= light[0] < light[1] <= MOST_LIGHT:
        raise InputError(f"light is {light}; it must be (dark, bright) with 0 <= dark < bright <= {MOST_LIGHT:g}")
    checked_number(frame_rate_hz, "frame_rate_hz", *FRAME_RATES_HZ)
    checked_number(motion_per_key, "motion_per_key", 1e-9, MOST_PLACE)
    checked_number(texel_px, "texel_px", 1e-3, 1e3)
    samples = texture.size * (texel_px * SAMPLES_PER_PIXEL) ** 2
    checked_memory(int(32 * max(samples, texture.size)), f"a texture of {texture.shape} texels of {texel_px:g} pixels")
