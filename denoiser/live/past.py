"""The past of a stream that a window of the denoiser needs, read from packed frames.

    last      (P,) the last spike before the window [frame]; -1: none is known
    means     (M, P) running means e <- e + (s - e) / m over all frames before the window, one for each memory m

These are the numbers that `RollingWindow` keeps of frames that have left its window, with the same
operations in the same order, so the same bits.  Frames are read from a ring: frame f lies in row f % rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spikecam_env.compiled import njit

_TOGETHER = 64
"""Bytes of a frame, 512 pixels, that are taken through all frames before the next: a line of the processor's cache."""
_SPREAD = np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1, bitorder="little").view(np.uint64)[:, 0]
"""(256,) the eight bits of a byte as eight bytes of a word, the first in the lowest."""


@dataclass
class Past:
    """Of frames first .. stop of a stream of P pixels."""

    first: int
    stop: int
    last: NDArray[np.int64]
    means: NDArray[np.float32]

    @classmethod
    def nothing(cls, frame: int, pixels: int, memories: int) -> Past:
        """Before the first frame of a stream, which is number `frame`."""
        return cls(frame, frame, np.full(pixels, -1, np.int64), np.zeros((memories, pixels), np.float32))

    def advance(self, ring: NDArray[np.uint8], stop: int, shares: NDArray[np.float32]) -> None:
        """Take in the frames up to `stop`; ring: (rows, ceil(P / 8)) packed; shares: 1 / m of each memory."""
        if stop > self.stop:
            _running_means(ring, self.stop, stop, shares, _SPREAD, self.means)
            _last_spikes(ring, self.stop, stop, self.last)
            self.stop = stop

    def last_since(self, origin: int) -> NDArray[np.int32]:
        """(P,) the last spikes by frames since `origin`; a spike before is taken there."""
        return np.where(self.last < 0, -1, np.maximum(self.last - origin, 0)).astype(np.int32)


@njit(cache=True, nogil=True, boundscheck=False)
def _running_means(
    ring: NDArray[np.uint8],
    first: int,
    stop: int,
    shares: NDArray[np.float32],
    spread: NDArray[np.uint64],
    means: NDArray[np.float32],
) -> None:
    rows, size = ring.shape
    pixels = means.shape[1]
    words = np.empty(_TOGETHER, np.uint64)
    spikes = words.view(np.uint8)
    for begin in range(0, size, _TOGETHER):
        some = min(_TOGETHER, size - begin)
        at, count = 8 * begin, min(8 * some, pixels - 8 * begin)
        for frame in range(first, stop):
            row = frame % rows
            for j in range(some):
                words[j] = spread[ring[row, begin + j]]
            for i in range(len(shares)):
                share, mean = shares[i], means[i, at : at + count]
                for x in range(count):
                    mean[x] += share * (np.float32(spikes[x]) - mean[x])


@njit(cache=True, nogil=True, boundscheck=False)
def _last_spikes(ring: NDArray[np.uint8], first: int, stop: int, last: NDArray[np.int64]) -> None:
    """From the newest frame back, until every pixel of a byte has fired."""
    rows, size = ring.shape
    pixels = len(last)
    for j in range(size):
        waiting = np.uint8(255)
        frame = stop - 1
        while waiting and frame >= first:
            fired = ring[frame % rows, j] & waiting
            waiting &= ~fired
            x = 8 * j
            while fired:
                if fired & 1 and x < pixels:
                    last[x] = frame
                fired >>= 1
                x += 1
            frame -= 1
