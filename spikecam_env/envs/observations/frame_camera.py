"""An ordinary camera in the same place: a global shutter on the light that falls on the spike camera's sensor.

    picture = 255 * mean light of an exposure / `white`          light: 1.0 makes the nominal pixel fire once a frame

Exposure j is over [j P, j P + E), P the frame period and E the exposure time, from the episode's beginning on.  Agents
see the last whole exposure, black before the first.  No noise but the eight bits; light above `white` is cut.  The mean
is exact (`sensor.between_keys`), so motion is blurred as in such a camera.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import floor
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from spikecam_env.checked import checked_number
from spikecam_env.envs.observations.protocol import Blocks, CameraView, Observation, grey, picture_space
from spikecam_env.errors import InputError
from spikecam_env.sensor import Keyframes
from spikecam_env.sensor.between_keys import key_weights


class Shutter(NamedTuple):
    """The exposure under way of every stream, and the last whole one."""

    collected: NDArray[np.float64]
    """(N, H, W), light of the exposure under way [mean light * frames]."""
    picture: NDArray[np.uint8]
    """(N, 1, H, W), the last whole exposure."""
    end: NDArray[np.float64]
    """(N,) frame at which that exposure ended; -1 before the first."""
    now: NDArray[np.float64]
    """(N,) frame up to which light was collected."""


@dataclass(frozen=True)
class FrameCamera(Observation):
    """(1, H, W) uint8 of a camera with `rate_hz` frames a second.

    Raises:
        InputError: for a rate, an exposure or a white that is not above 0, for an exposure longer than the period, and
            in `step` where the light is not known.
    """

    rate_hz: float
    exposure_s: float | None = field(default=None, kw_only=True)
    """Exposure of a frame [s]; None is the whole period."""
    white: float = field(default=1.0, kw_only=True)
    """Light that gives 255."""

    def __post_init__(self) -> None:
        checked_number(self.rate_hz, "rate_hz", 0.0, above=True, unit="Hz")
        checked_number(self.white, "white", 0.0, above=True)
        if self.exposure_s is not None:
            checked_number(self.exposure_s, "exposure_s", 0.0, 1.0 / self.rate_hz, above=True, unit="s")

    def space(self, view: CameraView) -> spaces.Box:
        return picture_space(view)

    def start(self, view: CameraView, streams: int) -> Shutter:
        return Shutter(
            np.zeros((streams, *view.shape)),
            np.zeros((streams, 1, *view.shape), np.uint8),
            np.full(streams, -1.0),
            np.zeros(streams),
        )

    def step(self, blocks: Blocks, state: Shutter) -> tuple[NDArray[np.uint8], Shutter]:
        if not len(blocks.light):
            raise InputError("a frame camera needs the light on the sensor, which this environment does not know")
        period, exposure = self._frames(blocks.frame_rate_hz)
        after = Shutter._make(array.copy() for array in state)
        for own, light in zip(_streams(after), blocks.light, strict=True):
            start, stop = float(own.now), float(own.now) + blocks.spikes.shape[1]
            for begin, end, whole in shutter_open(start, stop, period, exposure):
                own.collected[:] += (end - begin) * mean_light(light, begin, end)
                if whole:
                    own.picture[0] = grey(own.collected / (exposure * self.white))
                    own.collected[:] = 0.0
                    own.end[...] = end
            own.now[...] = stop
        return after.picture.copy(), after

    def info(self, blocks: Blocks, state: Shutter) -> list[dict[str, Any]]:
        """As of `Observation`: a byte a pixel and whole exposure of the step."""
        period, exposure = self._frames(blocks.frame_rate_hz)
        pixels = state.picture[0].size
        return [
            {
                "camera_bits": 8.0
                * pixels
                * sum(whole for *_, whole in shutter_open(now - blocks.frames, now, period, exposure))
            }
            for now in state.now.tolist()
        ]

    def _frames(self, frame_rate_hz: float) -> tuple[float, float]:
        """Period and exposure [frames]."""
        period = frame_rate_hz / self.rate_hz
        return period, period if self.exposure_s is None else self.exposure_s * frame_rate_hz

    def age(self, state: Shutter) -> NDArray[np.float64]:
        return np.where(state.end < 0, -1.0, state.now - state.end)


def _streams(state: Shutter) -> Iterator[Shutter]:
    """Views of one stream each, to be written to."""
    return (Shutter._make(array[n, ...] for array in state) for n in range(len(state.now)))


def shutter_open(start: float, stop: float, period: float, exposure: float) -> Iterator[tuple[float, float, bool]]:
    """The parts of [start, stop) in which the shutter is open: from, to, and whether the exposure ends there."""
    number = max(floor(start / period) - 1, 0)  # the one before may end at `start`, within rounding
    while number * period < stop:
        opens, closes = number * period, number * period + exposure
        if closes > start:
            yield max(opens, start), min(closes, stop), closes <= stop
        number += 1


def mean_light(light: Keyframes | ArrayLike, start: float, stop: float) -> NDArray[np.float64]:
    """(H, W) mean over [start, stop] [frames] of light as sensors take it."""
    if not isinstance(light, Keyframes):
        return np.asarray(light, np.float64)
    first, weights, _ = key_weights(light.frame, start, stop)
    return np.tensordot(weights, light.radiance[first : first + len(weights)], axes=1)
