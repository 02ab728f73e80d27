"""A texture that slides past: the simplest motion, the same everywhere, with a closed-form truth.

    light(x, y, t) = texture(x - vx t + pan, y - vy t + tilt),  flow = v - gaze rate      [pixels/frame]

The texture repeats without end.  It is averaged over the area of a pixel once, at `SAMPLES_PER_PIXEL` places along
either side of a pixel, and read between them.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenes.keys import AT_REST, interval_for, key_frames, paint_keys
from scenes.protocol import FRAME_RATES_HZ, MOST_LIGHT, MOST_PLACE, Gaze, Truth
from scenes.textures import dead_leaves
from spikecam_env.checked import checked_memory, checked_number, checked_shape
from spikecam_env.compiled import njit
from spikecam_env.errors import InputError
from spikecam_env.sensor import Keyframes
from spikecam_env.types import Floats, Pictures

SAMPLES_PER_PIXEL = 4


class SlidingTexture:
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
        self._period = samples.shape[1]
        self._samples = _by_phase((light[0] + (light[1] - light[0]) * samples).astype(np.float32), self.shape[1])

    def __repr__(self) -> str:
        return f"SlidingTexture(shape={self.shape}, velocity_px_s={self.velocity_px_s})"

    def radiance(self, start: int, stop: int, gaze: Gaze | None = None, *, device: Any = None) -> Keyframes:
        """Keys that cover frames [start, stop]; arguments are those of `scenes.flat.planes.PlanarScene.radiance`."""
        speed = float(np.hypot(*self.velocity(gaze)))
        frame = key_frames(self.shape, start, stop, interval_for(speed, self.motion_per_key), gaze)
        if device is not None:
            return self._on(device, frame, gaze)
        return paint_keys(self.shape, frame, lambda t, picture: self._paint(t, gaze, picture))

    def truth(self, frame: float, gaze: Gaze | None = None) -> Truth:
        """Ground truth at a frame; see `scenes.protocol.Truth`."""
        radiance = np.empty(self.shape, np.float32)
        self._paint(frame, gaze, radiance)
        flow = np.broadcast_to(np.asarray(self.velocity(gaze), np.float32), (*self.shape, 2)).copy()
        camera = (gaze or AT_REST).at(frame)
        return Truth(
            radiance,
            flow,
            np.zeros(self.shape, np.int32),
            poses={"texture": self.corner_at(frame, gaze), "camera": camera},
        )

    def lit(self, gain: float) -> SlidingTexture:
        """The same texture with `gain` times its light."""
        other = copy.copy(self)
        other._samples = self._samples * np.float32(gain)
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

    def _first_sample(self, frame: Any, gaze: Gaze | None) -> tuple[Any, Any]:
        """(x, y) of the first pixel in the samples."""
        x, y = (-SAMPLES_PER_PIXEL * (corner + 0.5) for corner in self.corner_at(frame, gaze))
        return x, y

    def _on(self, device: Any, frame: Floats, gaze: Gaze | None) -> Keyframes:
        from scenes.flat.planes_on_device import repeated_on  # torch takes seconds

        return repeated_on(
            self._samples,
            lambda samples: _in_order(samples, self._period),
            frame,
            self._first_sample(frame, gaze),
            self.shape,
            SAMPLES_PER_PIXEL,
            device,
        )

    def _paint(self, frame: float, gaze: Gaze | None, picture: Pictures) -> None:
        x, y = self._first_sample(frame, gaze)
        _paint(self._samples, x % self._period, y % len(self._samples), picture)


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


def _by_phase(samples: Pictures, columns: int) -> Pictures:
    """(rows, SAMPLES_PER_PIXEL, n): samples (rows, period) so that those a pixel apart are neighbours, on and on over
    the period's end for as many columns as a picture has from any of them."""
    period = samples.shape[1]
    pixels = np.arange(np.lcm(period, SAMPLES_PER_PIXEL) // SAMPLES_PER_PIXEL + columns)
    place = (SAMPLES_PER_PIXEL * pixels + np.arange(SAMPLES_PER_PIXEL)[:, None]) % period
    return np.ascontiguousarray(samples[:, place])


def _in_order(samples: Pictures, period: int) -> Pictures:
    """(rows, period), of `_by_phase`."""
    place = np.arange(period)
    return samples[:, place % SAMPLES_PER_PIXEL, place // SAMPLES_PER_PIXEL]


@njit(cache=True, nogil=True)
def _paint(samples: Pictures, x: float, y: float, picture: Pictures) -> None:
    """The picture whose first pixel is sample (x, y), bilinear; all pixels lie alike between samples."""
    height, (rows, columns) = samples.shape[0], picture.shape
    left, top = int(x), int(y)
    right_share, lower_share = np.float32(x - left), np.float32(y - top)
    here, place = left % SAMPLES_PER_PIXEL, left // SAMPLES_PER_PIXEL
    right, beside = (left + 1) % SAMPLES_PER_PIXEL, (left + 1) // SAMPLES_PER_PIXEL
    for r in range(rows):
        upper = samples[(top + SAMPLES_PER_PIXEL * r) % height]
        lower = samples[(top + SAMPLES_PER_PIXEL * r + 1) % height]
        upper_left, upper_right = upper[here, place : place + columns], upper[right, beside : beside + columns]
        lower_left, lower_right = lower[here, place : place + columns], lower[right, beside : beside + columns]
        row = picture[r]
        for c in range(columns):
            above = upper_left[c] + right_share * (upper_right[c] - upper_left[c])
            below = lower_left[c] + right_share * (lower_right[c] - lower_left[c])
            row[c] = above + lower_share * (below - above)


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
