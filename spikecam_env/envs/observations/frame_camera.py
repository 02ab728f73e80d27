"""An ordinary camera in the same place: its own sensor in the light that falls on the spike camera's.

    picture = 255 (number / largest number)^gamma        number: of `FrameSensor`, for the mean light of an exposure

Row r of frame j is exposed over [j P + r R, j P + r R + E): P the frame period, E the exposure time, R the time of a
row, from the episode's beginning on.  R = 0 is a global shutter.  A frame is out when its last row is.  Agents see the
last whole frame, black before the first.  The mean light is exact (`sensor.between_keys`), so motion is blurred, and
skewed by a rolling shutter, as in such a camera.

Noise is drawn for a whole frame, from the camera's seed and the frame's number: no cut of a stream changes it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from spikecam_env.checked import checked_number, checked_switch
from spikecam_env.envs.observations.frame_sensor import FrameSensor
from spikecam_env.envs.observations.protocol import (
    Blocks,
    CameraView,
    Observation,
    checked_gamma,
    checked_white,
    grey,
    picture_space,
)
from spikecam_env.errors import InputError, shown
from spikecam_env.sensor import Keyframes
from spikecam_env.sensor.between_keys import key_weights
from spikecam_env.sensor.model import generator

CLOSE = 9
"""Decimals of a frame to which ends of exposures are rounded: whole frames but for how they were computed."""


class Shutter(NamedTuple):
    """The frames under way of every stream, and the last whole one."""

    collected: NDArray[np.float64]
    """(N, 1 or 2, H, W), light of the frames under way [mean light * frames]; frame j in place j modulo their number.
    Rolling rows of a frame are exposed while the first rows of the next one are: two."""
    picture: NDArray[np.uint8]
    """(N, 1, H, W), the last whole frame."""
    end: NDArray[np.float64]
    """(N,) frame at which its exposure ended; -1 before the first."""
    now: NDArray[np.float64]
    """(N,) frame up to which light was collected."""


class Timing(NamedTuple):
    """Times of a camera [frames]."""

    period: float
    exposure: float
    row: float
    """From the beginning of a row's exposure to that of the next row's."""
    rows: int

    @property
    def lasting(self) -> float:
        """From the beginning of a frame's first row to the end of its last."""
        return self.exposure + (self.rows - 1) * self.row

    def parts(self) -> list[tuple[slice, float]]:
        """Rows that are exposed together, and the delay of each."""
        if not self.row:
            return [(slice(None), 0.0)]
        return [(slice(r, r + 1), r * self.row) for r in range(self.rows)]

    def under_way(self, start: float, stop: float) -> Iterator[tuple[int, float, float]]:
        """Number, beginning and end of the frames that are exposed in [start, stop) or end in (start, stop]."""
        for number in count(max(int((start - self.lasting) / self.period), 0)):
            opens = number * self.period
            if opens >= stop:
                return
            ends = round(opens + self.lasting, CLOSE)
            if ends > start:
                yield number, opens, ends


@dataclass(frozen=True)
class FrameCamera(Observation):
    """(1, H, W) uint8 of a camera with `rate_hz` frames a second.

    Info has `camera_bits`, those of the sensor's converter a pixel and whole frame.

    Raises:
        InputError: for a value out of range, a sensor that is no `FrameSensor`, an exposure or a read-out longer than
            the period, and in `step` where the light is not known.

    Example:
        >>> law, view = FrameCamera(1000.0, noise=False), CameraView((2, 3), 40)
        >>> blocks = Blocks(np.zeros((1, 40, 2, 3), np.uint8), [np.full((2, 3), 0.2)])
        >>> law.step(blocks, law.start(view, 1))[0].tolist()
        [[[[51, 51, 51], [51, 51, 51]]]]
    """

    rate_hz: float
    exposure_s: float | None = field(default=None, kw_only=True)
    """Exposure of a row [s]; None is the whole period."""
    row_time_s: float = field(default=0.0, kw_only=True)
    """From the beginning of a row's exposure to that of the next row's [s]: above 0 a rolling shutter."""
    white: float = field(default=1.0, kw_only=True)
    """Light that gives 255, whatever the exposure: by gain in the dark, by a filter where it is too bright."""
    gamma: float = field(default=1.0, kw_only=True)
    """Exponent of the picture's law: 0.5, a root, shows dark light brighter."""
    sensor: FrameSensor = field(default_factory=FrameSensor, kw_only=True)
    noise: bool = field(default=True, kw_only=True)
    """False for the mean number of every pixel."""

    def __post_init__(self) -> None:
        checked_number(self.rate_hz, "rate_hz", 0.0, above=True, unit="Hz")
        checked_white(self.white)
        checked_number(self.row_time_s, "row_time_s", 0.0, unit="s")
        checked_gamma(self.gamma)
        checked_switch(self.noise, "noise")
        if not isinstance(self.sensor, FrameSensor):
            raise InputError(f"sensor is {shown(self.sensor)}; give a FrameSensor")
        if self.exposure_s is not None:
            checked_number(self.exposure_s, "exposure_s", 0.0, 1.0 / self.rate_hz, above=True, unit="s")

    def space(self, view: CameraView) -> spaces.Box:
        readout_s, period_s = (view.shape[0] - 1) * self.row_time_s, 1.0 / self.rate_hz
        if readout_s > period_s:
            raise InputError(
                f"row_time_s = {self.row_time_s:g}; the last of {view.shape[0]} rows begins {readout_s:g} s after the "
                f"first, and a frame's period is {period_s:g} s: lower row_time_s or rate_hz"
            )
        return picture_space(view)

    def start(self, view: CameraView, streams: int) -> Shutter:
        shape = self.space(view).shape
        return Shutter(
            np.zeros((streams, 2 if self.row_time_s else 1, *view.shape)),
            np.zeros((streams, *shape), np.uint8),
            np.full(streams, -1.0),
            np.zeros(streams),
        )

    def exposure(self, view: CameraView) -> float:
        return self._exposure(view.frame_rate_hz)

    def step(self, blocks: Blocks, state: Shutter) -> tuple[NDArray[np.uint8], Shutter]:
        if not len(blocks.light):
            raise InputError("a frame camera needs the light on the sensor, which this environment does not know")
        after = Shutter._make(array.copy() for array in state)
        seeds = blocks.seeds or [0] * len(blocks.light)
        for own, light, seed in zip(_streams(after), blocks.light, seeds, strict=True):
            self._expose(own, light, seed, blocks)
        return after.picture.copy(), after

    def _expose(self, own: Shutter, light: Keyframes | ArrayLike, seed: int, blocks: Blocks) -> None:
        """Go on by a block's frames with one stream, whose arrays are written to."""
        timing, start = self._timing(blocks), float(own.now)
        stop = start + blocks.frames
        for number, opens, ends in timing.under_way(start, stop):
            collected = own.collected[number % len(own.collected)]
            for rows, delay in timing.parts():
                begin, end = max(opens + delay, start), min(opens + delay + timing.exposure, stop)
                if begin < end:
                    collected[rows] += (end - begin) * mean_light(light, begin, end, rows)
            if ends <= stop:
                own.picture[0] = self._picture(collected / timing.exposure, timing, blocks.frame_rate_hz, seed, number)
                own.end[...], collected[:] = ends, 0.0
        own.now[...] = stop

    def _picture(
        self, light: NDArray[np.float64], timing: Timing, frame_rate_hz: float, seed: int, number: int
    ) -> NDArray[np.uint8]:
        """(H, W), the picture of a whole frame; light in its own precision, in which no cut of the exposure shows."""
        rng = generator(seed, "frame camera", number) if self.noise else None
        numbers = self.sensor.numbers(light.astype(np.float32), self.white, timing.exposure, frame_rate_hz, rng)
        return grey(numbers / self.sensor.largest, self.gamma)

    def info(self, blocks: Blocks, state: Shutter) -> list[dict[str, Any]]:
        """As of `Observation`: the converter's bits a pixel and whole frame of the step."""
        timing, bits = self._timing(blocks), float(self.sensor.bits * state.picture[0].size)
        return [
            {"camera_bits": bits * sum(ends <= now for *_, ends in timing.under_way(now - blocks.frames, now))}
            for now in state.now.tolist()
        ]

    def _timing(self, blocks: Blocks) -> Timing:
        rate = blocks.frame_rate_hz
        return Timing(rate / self.rate_hz, self._exposure(rate), self.row_time_s * rate, blocks.spikes.shape[2])

    def _exposure(self, frame_rate_hz: float) -> float:
        return frame_rate_hz / self.rate_hz if self.exposure_s is None else self.exposure_s * frame_rate_hz

    def age(self, state: Shutter) -> NDArray[np.float64]:
        return np.where(state.end < 0, -1.0, state.now - state.end)


def _streams(state: Shutter) -> Iterator[Shutter]:
    """Views of one stream each, to be written to."""
    return (Shutter._make(array[n, ...] for array in state) for n in range(len(state.now)))


def mean_light(
    light: Keyframes | ArrayLike, start: float, stop: float, rows: slice = slice(None)
) -> NDArray[np.float64]:
    """(rows, W) mean over [start, stop] [frames] of light as sensors take it.

    Example:
        >>> rise = Keyframes(np.array([0.0, 10.0]), np.array([0.0, 1.0], np.float32).reshape(2, 1, 1))
        >>> float(mean_light(rise, 0.0, 5.0)[0, 0])
        0.25
    """
    if not isinstance(light, Keyframes):
        return np.asarray(light, np.float64)[rows]
    first, weights, _ = key_weights(light.frame, start, stop)
    return np.tensordot(weights, light.radiance[first : first + len(weights), rows], axes=1)
