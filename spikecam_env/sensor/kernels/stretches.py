"""Light of a step as the fast engine takes it: stretches of 64 frames at most, with the addresses of its pictures."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor.imaging import Imaging
from spikecam_env.sensor.kernels.fast import FastState, Stretch
from spikecam_env.sensor.kernels.intrinsics import address_of
from spikecam_env.sensor.light import COUNT, FIRST, KEY0, KEY1, LENGTH, MAX_SEGMENT, Keyframes, Segment, cuts, segments

_OF_PIECE = (KEY0, KEY1, LENGTH, FIRST, COUNT)
"""Columns of `cuts` in the order of those of a table of pieces."""


def stretches(
    state: FastState, light: Keyframes | NDArray[np.float32], start: int, imaging: Imaging, spikes: NDArray[np.uint8]
) -> Iterator[Stretch]:
    """The frames from `start` on, as many as there are in spikes (frames, P), through the optics."""
    if isinstance(light, Keyframes) and not imaging:
        rows = cuts(light.frame, start, start + len(spikes))
        if rows[:, : KEY1 + 1].min() >= 0:
            return _of_keys(state, light.radiance, rows, spikes)
    return _of_segments(state, map(imaging.seen, segments(light, start, len(spikes))), spikes)


def _of_keys(
    state: FastState, radiance: NDArray[np.float32], rows: NDArray[np.int64], spikes: NDArray[np.uint8]
) -> Iterator[Stretch]:
    """Between keys at whole frames, whose pictures are taken where they lie."""
    pieces = rows[:, _OF_PIECE]
    pieces[:, :2] *= radiance.strides[0]
    pieces[:, :2] += address_of(radiance)
    ends = np.cumsum(rows[:, COUNT])
    first = done = 0
    while first < len(pieces):
        after = int(np.searchsorted(ends, done + MAX_SEGMENT, side="right"))
        stop = int(ends[after - 1])
        yield Stretch(state, pieces[first:after], (radiance,), spikes[done:stop], spikes.shape[1])
        first, done = after, stop


def _of_segments(state: FastState, segments: Iterator[Segment], spikes: NDArray[np.uint8]) -> Iterator[Stretch]:
    """Of pictures that are worked out one after another."""
    waiting: list[Segment] = []
    done = frames = 0
    for segment in segments:
        if frames + segment.count > MAX_SEGMENT:
            yield Stretch.of(state, waiting, spikes[done : done + frames])
            waiting, done, frames = [], done + frames, 0
        waiting.append(segment)
        frames += segment.count
    yield Stretch.of(state, waiting, spikes[done : done + frames])
