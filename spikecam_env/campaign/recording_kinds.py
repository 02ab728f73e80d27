"""The kinds of recordings a campaign is made of, each with the light it is taken in.

`light(shape, frames)` is a pure function: keys that are linear between and whole frames apart, stored along the axes on
which the light changes and no others.  Radiance 1.0 makes the nominal pixel fire once a frame.

    dark            reveals dark current, its patterns and its noise;
    flat            rate curve, response patterns, noise of a spike, row and frame noise;
    step            lag, drift, history;
    bars            effects of place and time together: read-out skew, blur;
    disk            textures in motion before a static one, unlike all others: for judging;
    masked_rows     coupling along a row: pixels of the same light in rows of different load.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from scenes import TEXTURES, RotatingDisk
from scenes.protocol import MOST_LIGHT
from spikecam_env.checked import checked_number, checked_seed, checked_whole
from spikecam_env.errors import InputError
from spikecam_env.sensor import Keyframes

MOTION_PER_KEY = 1.2
"""Most pixels of motion between two keys; beyond it light that is linear between keys no longer looks like motion."""

SLOWEST = 1e-9
"""Least speed of a motion [pixels/frame]: a pixel in 7 hours at 40 kHz."""


@dataclass(frozen=True, kw_only=True)
class Planned:
    """A recording to be made; its subclasses are the kinds of light.

    Example:
        >>> planned = [Dark(), Flat(radiance=0.2, use="holdout"), Step(frames=4000)]
        >>> [(p.file_name, p.use, p.frames) for p in planned if isinstance(p, Planned)]
        [('dark', 'fit', None), ('flat-0.2', 'holdout', None), ('step', 'fit', 4000)]
    """

    kind: ClassVar[str]

    name: str = ""
    """Of its files; empty: made from the kind and its level."""
    use: str = "fit"
    """`fit`, or `holdout` for judging."""
    v_d: float | None = None
    """V_D - V_ref [V]; None: the model's own."""
    frames: int | None = None
    """Length [frames]; None: the campaign's."""

    def light(self, shape: tuple[int, int], frames: int) -> Keyframes:
        """Keys over frames [0, frames]; radiance is (K, H, W), or (K, 1, W), ... where it is even along an axis."""
        raise NotImplementedError

    def check(self) -> None:
        """Check the numbers of the recording.

        Raises:
            InputError: for a number that is not finite, or larger than any light is.
        """
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(value, float):
                checked_number(value, f"{self.kind}.{f.name}", -MOST_LIGHT, MOST_LIGHT)
            elif isinstance(value, int) and not isinstance(value, bool):
                checked_whole(value, f"{self.kind}.{f.name}")

    @property
    def file_name(self) -> str:
        """The name, or one made from the kind and its level."""
        return self.name or self._default_name() + ("" if self.v_d is None else f"-at-{self.v_d:g}V")

    def _default_name(self) -> str:
        return self.kind


@dataclass(frozen=True, kw_only=True)
class Dark(Planned):
    """No light.

    Example:
        >>> Dark().light((4, 6), frames=100).radiance.tolist()
        [[[0.0]]]
    """

    kind = "dark"

    def light(self, shape: tuple[int, int], frames: int) -> Keyframes:
        return _unchanging(np.zeros((1, 1)))


@dataclass(frozen=True, kw_only=True)
class Flat(Planned):
    """An evenly lit screen.

    Example:
        >>> Flat(radiance=0.5).light((4, 6), frames=100).radiance.tolist()
        [[[0.5]]]
    """

    kind = "flat"

    radiance: float
    """Of the screen; 1.0 makes the nominal pixel fire once a frame."""

    def light(self, shape: tuple[int, int], frames: int) -> Keyframes:
        return _unchanging(np.full((1, 1), self.radiance))

    def _default_name(self) -> str:
        return f"flat-{self.radiance:g}"


@dataclass(frozen=True, kw_only=True)
class Step(Planned):
    """A lamp switched between two radiances every `half_period` frames, low first.

    An edge takes one frame: light goes from one level to the other between frames n - 1 and n, n = half_period, ...

    Example:
        >>> light = Step(low=0.25, high=0.5, half_period=20).light((4, 6), frames=50)
        >>> list(zip(light.frame.tolist(), light.radiance[:, 0, 0].tolist()))
        [(0.0, 0.25), (19.0, 0.25), (20.0, 0.5), (39.0, 0.5), (40.0, 0.25)]
    """

    kind = "step"

    low: float = 0.05
    """Radiance of one level."""
    high: float = 0.4
    """Radiance of the other."""
    half_period: int = 200
    """Between two edges [frames]."""

    def light(self, shape: tuple[int, int], frames: int) -> Keyframes:
        if self.half_period < 2:
            raise InputError(f"half_period = {self.half_period} frames; it must be 2 or more, an edge takes one frame")
        edges = np.arange(self.half_period, frames, self.half_period)
        levels = np.where(np.arange(edges.size + 1) % 2, self.high, self.low)
        frame = np.concatenate([[0], np.stack([edges - 1, edges], axis=1).reshape(-1)])
        radiance = np.concatenate([levels[:1], np.stack([levels[:-1], levels[1:]], axis=1).reshape(-1)])
        return Keyframes(frame.astype(np.float64), radiance.astype(np.float32).reshape(-1, 1, 1))


@dataclass(frozen=True, kw_only=True)
class Bars(Planned):
    """Bars, half of each period bright, that move to the right or downward.

    A pixel sees the mean light over its area.  While an edge crosses it, this is linear in time: keys at each pixel of
    motion are exact if 1/speed and period/2 are whole.

    Example:
        >>> light = Bars(low=0.0, high=1.0, period=4, speed=0.5).light((2, 4), frames=4)
        >>> light.frame.tolist(), light.radiance[:, 0].tolist()
        ([0.0, 2.0, 4.0], [[1.0, 1.0, 0.0, 0.0], [0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
    """

    kind = "bars"

    low: float = 0.05
    """Radiance of the dark half."""
    high: float = 0.4
    """Radiance of the bright half."""
    period: float = 16.0
    """Of the bars [pixels]."""
    speed: float = 0.2
    """Of the motion [pixels/frame]; negative: to the left, or upward."""
    down: bool = False
    """Whether they move downward."""

    def light(self, shape: tuple[int, int], frames: int) -> Keyframes:
        if not (self.speed == 0 or SLOWEST <= abs(self.speed) <= MOTION_PER_KEY) or not 2.0 <= self.period < np.inf:
            raise InputError(
                f"bars of period {self.period} at speed {self.speed}; need a period of 2 pixels or more and at most "
                f"{MOTION_PER_KEY} pixels a frame either way, 0 or {SLOWEST:g} at least"
            )
        every = frames if self.speed == 0 else max(int(1.0 / abs(self.speed) + 1e-9), 1)
        frame = np.arange(-(-frames // every) + 1) * every
        place = np.arange(shape[0 if self.down else 1]) - self.speed * frame[:, None]
        bright = self._bright_before(place + 1.0) - self._bright_before(place)
        radiance = (self.low + (self.high - self.low) * bright).astype(np.float32)
        return Keyframes(frame.astype(np.float64), radiance[:, :, None] if self.down else radiance[:, None, :])

    def _bright_before(self, place: NDArray[np.float64]) -> NDArray[np.float64]:
        """Length of bright bar between 0 and a place [pixels]."""
        half = self.period / 2.0
        return np.floor(place / self.period) * half + np.minimum(np.mod(place, self.period), half)


@dataclass(frozen=True, kw_only=True)
class Disk(Planned):
    """A textured disk that turns in front of a static pattern.

    Example:
        >>> Disk(name="slow", rim_speed=0.01, use="holdout").file_name
        'slow'
    """

    kind = "disk"

    low: float = 0.05
    """Least radiance."""
    high: float = 0.5
    """Largest radiance."""
    rim_speed: float = 0.04
    """Of the texture at the rim [pixels/frame]."""
    seed: int = 0
    """Of both textures."""

    def light(self, shape: tuple[int, int], frames: int) -> Keyframes:
        if not abs(self.rim_speed) <= MOTION_PER_KEY:
            raise InputError(f"rim_speed = {self.rim_speed}; it must be within {MOTION_PER_KEY} pixels a frame")
        checked_seed(self.seed, "disk.seed")
        radius = 0.44 * min(shape)
        scene = RotatingDisk(
            shape,
            rpm=60 * 40_000 * self.rim_speed / (2 * np.pi * radius),
            radius=radius,
            light=(self.low, self.high),
            background=self._surround(shape),
            seed=self.seed,
            frame_rate_hz=40_000,
            motion_per_key=MOTION_PER_KEY,
        )
        return scene.radiance(0, frames)

    def _surround(self, shape: tuple[int, int]) -> NDArray[np.floating]:
        texture = TEXTURES["dead_leaves"](np.random.default_rng(self.seed), max(64, *shape))
        return self.low + (self.high - self.low) * texture[: shape[0], : shape[1]]


@dataclass(frozen=True, kw_only=True)
class MaskedRows(Planned):
    """A mask over the right half of the picture darkens every second band of rows.

        bright bright        rows 0 .. band - 1
        bright dark          rows band .. 2 band - 1, ...

    On the left the light is the same in all rows, while half of the rows carry half of the activity.

    Example:
        >>> MaskedRows(dark=0.0, bright=0.5, band=1).light((2, 4), frames=100).radiance.tolist()
        [[[0.5, 0.5, 0.5, 0.5], [0.5, 0.5, 0.0, 0.0]]]
    """

    kind = "masked_rows"

    dark: float = 0.02
    """Radiance behind the mask."""
    bright: float = 0.4
    """Radiance elsewhere."""
    band: int = 8
    """Height of a band [rows]."""

    def light(self, shape: tuple[int, int], frames: int) -> Keyframes:
        if not 1 <= self.band < shape[0]:
            raise InputError(
                f"band = {self.band} rows; it must be 1 to {shape[0] - 1}, so that there are two kinds of rows"
            )
        picture = np.full(shape, self.bright)
        masked = np.arange(shape[0]) // self.band % 2 == 1
        picture[masked, shape[1] // 2 :] = self.dark
        return _unchanging(picture)


KINDS: dict[str, type[Planned]] = {kind.kind: kind for kind in (Dark, Flat, Step, Bars, Disk, MaskedRows)}
"""Kinds of recordings by name."""


def _unchanging(picture: NDArray[np.float64]) -> Keyframes:
    return Keyframes(np.zeros(1), picture[None].astype(np.float32))
