"""A rotating textured disk: the fast scene with a closed-form truth.

    angle(t) = angle(0) + w t,  w = 2 pi rpm / (60 frame_rate_hz)      [radians, radians/frame]
    flow inside the disk: w (dy, -dx) + drift - gaze rate             [pixels/frame]
    flow outside the disk: - gaze rate

(dx, dy) is the offset from the disk's centre, y down; w > 0 turns counter-clockwise in the picture.  At
2000 rpm and 40 kHz the rim of a disk of radius 110 moves 0.58 pixels a frame.

The texture is resampled once to `TEXELS_PER_PIXEL` and filtered by the area of a pixel, then read
bilinearly for each key, inside the rim alone; the rim is covered by area.  Keys are so close that the rim moves
at most `motion_per_key` pixels between two, down to one a frame, and are painted by several threads.
"""

from __future__ import annotations

import copy
from typing import Any

import cv2
import numpy as np
import scipy
from numpy.typing import ArrayLike

from scenes.flat.painted_disk import PlacedDisc, Plane, Texels, Tile, prefiltered
from scenes.flat.planes import MovingDisc, PlanarScene
from scenes.keys import AT_REST
from scenes.protocol import FRAME_RATES_HZ, MOST_LIGHT, MOST_PLACE, Gaze
from scenes.textures import Texture, dead_leaves, fractal_noise
from spikecam_env.checked import LARGEST_DERIVED_SEED, checked_number, checked_seed, checked_shape
from spikecam_env.errors import InputError
from spikecam_env.numbers import MOST_RPM
from spikecam_env.types import Floats, Pictures

MOST_RADIUS = 6000.0
"""[pixels] Texels are counted in 32 bits, TEXELS_PER_PIXEL^2 of them to a pixel of the disk's square."""

RADIUS = 0.44
"""Of the disk, as a share of the shorter side: the whole disk is seen."""

_RANGES = {
    "rpm": (-MOST_RPM, MOST_RPM),
    "radius": (1.0, MOST_RADIUS),
    "frame_rate_hz": FRAME_RATES_HZ,
    "centre": (-MOST_PLACE, MOST_PLACE),
    "drift_px_s": (-MOST_PLACE, MOST_PLACE),
    "angle": (-MOST_PLACE, MOST_PLACE),
    "motion_per_key": (1e-9, MOST_PLACE),
}


class RotatingDisk(PlanarScene):
    """A disk that spins and drifts over a background.

    Truth: object 1 is the disk; poses["disk"] is (x, y, angle) with the angle in [0, 2 pi).

    Args:
        shape: (rows, columns) of the sensor.
        rpm: turns a minute; positive is counter-clockwise, 0 stands still.
        radius: [pixels]; default 0.44 of the shorter side (110 at 250 x 400).
        light: radiance of texture value 0 and 1, linear: (dark, bright).
        texture: (n, n) in [0, 1], the square around the disk; default `disk_texture` from the seed.
        background: a radiance, or a tile of radiance (one texel a pixel, repeated); default soft noise.
        seed: of the default texture and background.
        frame_rate_hz: frames a second.
        centre: (x, y) of the disk at frame 0 [pixels]; default the middle of the picture.
        drift_px_s: (x, y) velocity of the disk's centre [pixels/s].
        angle: at frame 0 [radians].
        motion_per_key: most the rim may move between two keys [pixels], as far as whole frames allow; the sensor blends
            two keys.  The light of a frame is 1.2 % rms off at 0.58 pixels a key (2000 rpm), 3.1 % at twice that
            (`python -m benchmarks.scenes`).

    Raises:
        InputError: a value is out of range, by name.

    Example:
        >>> scene = RotatingDisk((16, 24), rpm=2000.0)
        >>> truth = scene.truth(0.5)
        >>> truth.radiance.shape, list(truth.poses)
        ((16, 24), ['disk', 'camera'])
    """

    def __init__(
        self,
        shape: tuple[int, int] = (250, 400),
        rpm: float = 2000.0,
        radius: float | None = None,
        light: tuple[float, float] = (0.05, 0.6),
        texture: ArrayLike | None = None,
        background: float | ArrayLike | None = None,
        seed: int = 0,
        frame_rate_hz: float = 40_000.0,
        centre: tuple[float, float] | None = None,
        drift_px_s: tuple[float, float] = (0.0, 0.0),
        angle: float = 0.0,
        motion_per_key: float = 0.6,
    ) -> None:
        self.shape, seed = checked_shape(shape), checked_seed(seed, most=LARGEST_DERIVED_SEED)
        self.radius = _checked("radius", _default_radius(self.shape) if radius is None else radius)
        self.rpm, self.frame_rate_hz = _checked("rpm", rpm), _checked("frame_rate_hz", frame_rate_hz)
        checked_number(light[0], "light[0]", 0.0, MOST_LIGHT)
        checked_number(light[1], "light[1]", light[0], MOST_LIGHT, above=True)
        self.light = light
        middle = ((self.shape[1] - 1) / 2, (self.shape[0] - 1) / 2)
        self.centre = middle if centre is None else _checked_pair("centre", centre)
        self.drift_px_s, self.angle = _checked_pair("drift_px_s", drift_px_s), _checked("angle", angle)
        self.motion_per_key = _checked("motion_per_key", motion_per_key)
        textures, backgrounds = np.random.default_rng(seed).spawn(2)
        size = int(np.clip(10 * self.radius, 128, 1024))
        values = disk_texture(textures, size) if texture is None else _checked_texture(texture)
        self._disk = Texels.of(prefiltered(light[0] + (light[1] - light[0]) * values, self.radius))
        self._tile = Tile.of(_background(background, backgrounds, self.shape, light), self.shape)

    def __repr__(self) -> str:
        return (
            f"RotatingDisk(shape={self.shape}, rpm={self.rpm:g}, radius={self.radius:g}, light={self.light}, "
            f"centre={self.centre}, drift_px_s={self.drift_px_s}, angle={self.angle:g})"
        )

    def placed_discs(self, frame: float, gaze: Gaze) -> dict[str, MovingDisc]:
        """See `PlanarScene`."""
        x, y = self.drift_px_s
        drift = (x / self.frame_rate_hz, y / self.frame_rate_hz)
        return {"disk": MovingDisc(self.centre_at(frame, gaze), drift, self.angle_at(frame), self._turn)}

    def speed(self) -> float:
        """See `PlanarScene`."""
        return self.rim_speed + float(np.hypot(*self.drift_px_s)) / self.frame_rate_hz

    def plane_at(self, frame: Floats, gaze: Gaze) -> Plane:
        """See `PlanarScene`."""
        x, y = np.clip(self.centre_at(frame, gaze), -MOST_PLACE, MOST_PLACE)
        disk = PlacedDisc(self._disk, self.radius, x, y, self.angle_at(frame))
        return Plane(self.shape, frame, self._tile, *gaze.at(frame), [disk])

    def placed(
        self, centre: tuple[float, float], drift_px_s: tuple[float, float] = (0.0, 0.0), angle: float = 0.0
    ) -> RotatingDisk:
        """The same disk and background with the disk elsewhere at frame 0; shares the textures, costs nothing."""
        other = copy.copy(self)
        other.centre, other.drift_px_s = _checked_pair("centre", centre), _checked_pair("drift_px_s", drift_px_s)
        other.angle = _checked("angle", angle)
        return other

    def lit(self, gain: float) -> RotatingDisk:
        """The same disk and background with `gain` times their light; shares the textures."""
        other = copy.copy(self)
        other.light = (self.light[0] * gain, self.light[1] * gain)
        other._disk, other._tile = self._disk.lit(gain), self._tile.lit(gain)
        return other

    def angle_at(self, frame: Any) -> Any:
        """Of the disk at a frame, or at each of several, in [0, 2 pi) [radians]."""
        return (self.angle + self._turn * frame) % (2 * np.pi)

    def centre_at(self, frame: Any, gaze: Gaze | None = None) -> tuple[Any, Any]:
        """(x, y) of the disk's centre in the picture at a frame, or at each of several [pixels]."""
        seconds = frame / self.frame_rate_hz
        pan, tilt = (gaze or AT_REST).at(frame)
        return (
            self.centre[0] + self.drift_px_s[0] * seconds - pan,
            self.centre[1] + self.drift_px_s[1] * seconds - tilt,
        )

    @property
    def rim_speed(self) -> float:
        """Of the texture at the rim [pixels/frame], without drift."""
        return abs(self._turn) * self.radius

    @property
    def _turn(self) -> float:
        return 2 * np.pi * self.rpm / (60 * self.frame_rate_hz)


def _default_radius(shape: tuple[int, int]) -> float:
    radius = RADIUS * min(shape)
    if radius < _RANGES["radius"][0]:
        raise InputError(f"shape is {shape}; the disk's radius, {RADIUS} of the shorter side, needs 3 pixels there")
    return radius


def _checked(name: str, value: float) -> float:
    return checked_number(value, name, *_RANGES[name])


def _checked_pair(name: str, pair: tuple[float, float]) -> tuple[float, float]:
    for value in pair:
        _checked(name, value)
    return pair


def disk_texture(rng: np.random.Generator, size: int = 1024) -> Texture:
    """The default disk: hub, sectors, fallen leaves, a line of text, and a scale of ticks; (size, size) in [0, 1]."""
    fine = 2 * size
    axis = (np.arange(fine, dtype=np.float32) + 0.5) / size - 1
    x, y = axis[None, :], axis[:, None]
    radius = np.hypot(x, y)
    turn = (np.arctan2(y, x) / (2 * np.pi) + 0.5).astype(np.float32)
    image = np.full((fine, fine), 0.85, np.float32)

    def fill(inner: float, outer: float, value: ArrayLike) -> None:
        np.copyto(image, value, where=(radius >= inner) & (radius < outer))

    fill(0.00, 0.05, 0.0)
    fill(0.10, 0.36, _sectors(turn, 24))
    fill(0.38, 0.66, cv2.resize(dead_leaves(rng, size), (fine, fine), interpolation=cv2.INTER_LINEAR))
    fill(0.68, 0.86, _round_text("SPIKE CAMERA * 40000 FRAMES A SECOND * ", turn, radius, 0.68, 0.86))
    fill(0.88, 0.93, np.floor(turn * 12) % 12 / np.float32(11))
    fill(0.93, 1.00, _sectors(turn, 144))
    fill(1.00, 2.00, 0.5)
    return np.asarray(cv2.resize(image, (size, size), interpolation=cv2.INTER_AREA), np.float32)


def _sectors(turn: Pictures, count: int) -> Pictures:
    """Alternating 0 and 1, `count` of them in a turn."""
    sectors: Pictures = np.floor(turn * count) % 2
    return sectors


def _round_text(text: str, turn: Pictures, radius: Pictures, inner: float, outer: float) -> Pictures:
    """Text around a ring, tops outward, clockwise, as wide as the ring; white on black."""
    (width, _), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_DUPLEX, 4.0, 12)
    height = 140
    strip = np.zeros((height, width), np.uint8)
    cv2.putText(strip, text, (0, 114), cv2.FONT_HERSHEY_DUPLEX, 4.0, 255, 12, cv2.LINE_AA)
    across = (outer - radius) / np.float32(outer - inner) * height
    ring = cv2.remap(strip, turn * width, across, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    white: Pictures = ring / np.float32(255)
    return white


def _background(
    background: float | ArrayLike | None, rng: np.random.Generator, shape: tuple[int, int], light: tuple[float, float]
) -> Pictures:
    """(h, w) float32 radiance, to be repeated."""
    if background is None:
        noise = scipy.ndimage.gaussian_filter(fractal_noise(rng, 2 * (max(shape) // 2) + 64), 1.0, mode="wrap")
        cloudy: Pictures = np.float32(light[0]) + np.float32(0.4 * (light[1] - light[0])) * noise
        return cloudy
    tile = np.atleast_2d(np.asarray(background, np.float32))
    if tile.ndim != 2 or not tile.size or not np.isfinite(tile).all() or tile.min() < 0:
        raise InputError("background must be a radiance or a (rows, columns) tile of it, finite and 0 or more")
    return np.ascontiguousarray(tile)


def _checked_texture(texture: ArrayLike) -> Pictures:
    values = np.asarray(texture, np.float32)
    if values.ndim != 2 or values.shape[0] != values.shape[1] or len(values) < 2:
        raise InputError(f"texture has shape {values.shape}; it must be square, (n, n) with n at least 2")
    if not (values.min() >= 0 and values.max() <= 1):
        raise InputError(f"texture runs from {values.min()} to {values.max()}; it must lie in [0, 1]")
    return values
