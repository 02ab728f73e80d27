"""Light of a step for the fast engine: stretches of 64 frames at most, with the addresses of its pictures."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.sensor.compiled_tools.intrinsics import address_of
from spikecam_env.sensor.imaging import Imaging
from spikecam_env.sensor.kernels import loop
from spikecam_env.sensor.kernels.fast import FastState, Stretch
from spikecam_env.sensor.light import COUNT, FIRST, KEY0, KEY1, LENGTH, MAX_SEGMENT, Keyframes, Segment, cuts, segments
from spikecam_env.types import Pictures, Spikes


def stretches(
    state: FastState, light: Keyframes | Pictures, start: int, imaging: Imaging, spikes: Spikes
) -> Iterator[Stretch]:
    """The frames from `start` on, as many as there are in spikes (frames, P), through the optics."""
    if isinstance(light, Keyframes) and not imaging:
        rows = cuts(light.frame, start, start + len(spikes))
        pieces = _at_keys(rows, address_of(light.radiance), light.radiance.strides[0])
        if len(pieces):
            return _of_keys(state, light.radiance, pieces, spikes)
    return _of_segments(state, map(imaging.seen, segments(light, start, len(spikes))), spikes)


def _of_keys(state: FastState, radiance: Pictures, pieces: NDArray[np.int64], spikes: Spikes) -> Iterator[Stretch]:
    """Stretches between keys at whole frames, whose pictures are not copied."""
    if len(spikes) <= MAX_SEGMENT:
        yield Stretch(state, pieces, (radiance,), spikes, spikes.shape[1])
        return
    ends = np.cumsum(pieces[:, loop.COUNT])
    first = done = 0
    while first < len(pieces):
        after = int(np.searchsorted(ends, done + MAX_SEGMENT, side="right"))
        stop = int(ends[after - 1])
        yield Stretch(state, pieces[first:after], (radiance,), spikes[done:stop], spikes.shape[1])
        first, done = after, stop


@njit(cache=True, nogil=True)
def _at_keys(rows: NDArray[np.int64], address: int, size: int) -> NDArray[np.int64]:
    """Rows of `cuts` as pieces of `loop.advance`; none where a row needs a picture that is no key's.

    Args:
        rows: of `cuts`.
        address: of the first key's picture.
        size: bytes from one picture to the next.
    """
    pieces = np.empty((len(rows), loop.PIECE_COLUMNS), np.int64)
    for k in range(len(rows)):
        if rows[k, KEY0] < 0 or rows[k, KEY1] < 0:
            return pieces[:0]
        pieces[k, loop.LIGHT0] = address + rows[k, KEY0] * size
        pieces[k, loop.LIGHT1] = address + rows[k, KEY1] * size
        pieces[k, loop.LENGTH], pieces[k, loop.FIRST] = rows[k, LENGTH], rows[k, FIRST]
        pieces[k, loop.COUNT] = rows[k, COUNT]
    return pieces


def _of_segments(state: FastState, segments: Iterator[Segment], spikes: Spikes) -> Iterator[Stretch]:
    """Stretches of pictures that are computed one after another."""
    waiting: list[Segment] = []
    done = frames = 0
    for segment in segments:
        if frames + segment.count > MAX_SEGMENT:
            yield Stretch.of(state, waiting, spikes[done : done + frames])
            waiting, done, frames = [], done + frames, 0
        waiting.append(segment)
        frames += segment.count
    yield Stretch.of(state, waiting, spikes[done : done + frames])
