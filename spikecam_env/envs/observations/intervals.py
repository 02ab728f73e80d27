"""Intervals (ISI) and texture from interval (TFI), as far as they are known at the end of a step.

    ISI = max(the last whole interval, frames since the last spike + 1)          [frames]
    TFI = 1 / ISI                                                                [spikes/frame]

A wait that is longer than the last interval shows that the light has fallen.  The episode begins as if every pixel had
fired just before its first frame.  Follows motion; coarse where it is bright.  Source: as of `streams.pictures`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.envs.observations.protocol import (
    Blocks,
    CameraView,
    Observation,
    checked_white,
    grey,
    picture_space,
)

LONGEST = 1 << 24
"""Frames up to which float32 counts one by one (7 minutes at 40 kHz); a longer interval is given as this."""


class Waiting(NamedTuple):
    """The interval under way of every pixel, and the one before."""

    since: NDArray[np.int32]
    """(N, H, W) int32, frames since the last spike."""
    interval: NDArray[np.int32]
    """(N, H, W) int32, the last whole interval [frames]; 0 before the first."""


def waiting(view: CameraView, streams: int) -> Waiting:
    """Before the first frame."""
    shape = (streams, *view.shape)
    return Waiting(np.zeros(shape, np.int32), np.zeros(shape, np.int32))


def waited(spikes: NDArray[np.uint8], state: Waiting) -> Waiting:
    """After (N, K, H, W) more frames."""
    since, interval = state.since.copy(), state.interval.copy()
    streams, frames = spikes.shape[:2]
    _wait(
        np.ascontiguousarray(spikes).reshape(streams, frames, -1),
        since.reshape(streams, -1),
        interval.reshape(streams, -1),
    )
    return Waiting(since, interval)


def known_interval(state: Waiting) -> NDArray[np.int32]:
    """(N, H, W) ISI [frames]."""
    return np.minimum(np.maximum(state.interval, state.since + 1), LONGEST)


@dataclass(frozen=True)
class ISI(Observation):
    """(1, H, W) float32, the interval [frames], 1 or more."""

    def space(self, view: CameraView) -> spaces.Box:
        return spaces.Box(1.0, float(LONGEST), (1, *view.shape), np.float32)

    def start(self, view: CameraView, streams: int) -> Waiting:
        return waiting(view, streams)

    def step(self, blocks: Blocks, state: Waiting) -> tuple[NDArray[np.float32], Waiting]:
        after = waited(blocks.spikes.view(np.uint8), state)
        return known_interval(after)[:, None].astype(np.float32), after


@dataclass(frozen=True)
class TFI(Observation):
    """(1, H, W) uint8: 255 where the rate is `white` or above; by default where a pixel fires in every frame.

    Raises:
        InputError: for a white not above 0.
    """

    white: float = field(default=1.0, kw_only=True)
    """[spikes/frame]; 0.25 shows light four times brighter, all above it as 255."""

    def __post_init__(self) -> None:
        checked_white(self.white)

    def space(self, view: CameraView) -> spaces.Box:
        return picture_space(view)

    def start(self, view: CameraView, streams: int) -> Waiting:
        return waiting(view, streams)

    def step(self, blocks: Blocks, state: Waiting) -> tuple[NDArray[np.uint8], Waiting]:
        after = waited(blocks.spikes.view(np.uint8), state)
        return grey(np.float32(1.0) / known_interval(after)[:, None].astype(np.float32), white=self.white), after


@njit(cache=True, nogil=True)
def _wait(spikes: NDArray[np.uint8], since: NDArray[np.int32], interval: NDArray[np.int32]) -> None:
    streams, frames, pixels = spikes.shape
    for n in range(streams):
        for k in range(frames):
            for i in range(pixels):
                waited = min(since[n, i] + 1, LONGEST)
                fired = spikes[n, k, i] != 0
                interval[n, i] = waited if fired else interval[n, i]
                since[n, i] = 0 if fired else waited
