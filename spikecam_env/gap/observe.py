"""A recording reduced to numbers, in two passes over its bits: what every statistic is computed from.

Per pixel: spike times at both ends, second differences A_k, interval moments, counts by block of time.
Per frame: spikes of the array, of each row and of each column.  Neighbours: coincidences at lags of 0 to 2 frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from spikecam_env.calibration.spike_times import SpikeTimes, spike_times
from spikecam_env.streams.packing import unpack_frames

Array = NDArray[np.float64]

STEPS = (1, 4, 16, 64)
"""k of A_k."""

BLOCKS = 16
"""Equal parts of a recording whose counts are kept pixel by pixel."""

BIN = 16
"""Frames of a bin of the film that is kept of a recording with moving light."""

LENGTHS = 64
"""Intervals are counted by length up to this many frames."""

LAGS = 3
"""Lags 0 .. LAGS - 1 [frames] of neighbours' coincidences."""


@dataclass(frozen=True)
class Observation:
    """One recording in numbers; P pixels row-major, F frames, shape (H, W).

    times: ends, counts and A_k of each pixel.  variance, covariance: (P,) of intervals, and of successive ones, about
    the pixel's own mean [frames^2]; NaN below 3 intervals.  short, long: (P,) intervals T below 0.6 T - 1 or
    above 1.5 T + 1 of the mean.  lengths: (LENGTHS,) intervals of the array by length, 1 frame first.  blocks: (BLOCKS, P) counts.
    frame, row, column: (F,), (F, H), (F, W) spikes.  coincidences: (LAGS, 2) spikes of one pixel with its neighbour's,
    lag by lag, along rows and along columns.  film: (F // BIN, P) uint8 counts, or None for static light.
    """

    shape: tuple[int, int]
    times: SpikeTimes
    variance: Array
    covariance: Array
    short: NDArray[np.int64]
    long: NDArray[np.int64]
    lengths: NDArray[np.int64]
    blocks: NDArray[np.int32]
    frame: NDArray[np.int32]
    row: NDArray[np.int32]
    column: NDArray[np.int32]
    coincidences: Array
    film: NDArray[np.uint8] | None

    @property
    def frames(self) -> int:
        return self.times.frames

    @property
    def rate(self) -> Array:
        """(P,) spikes a frame between first and last spike; count over frames below two spikes."""
        return np.where(self.times.count > 1, self.times.rate, self.times.count / self.frames)


def observe(packed: NDArray[np.uint8], shape: tuple[int, int], *, film: bool = False) -> Observation:
    """Reduce (F, ceil(H W / 8)) uint8 bits; film: keep counts in bins of time."""
    pixels = shape[0] * shape[1]
    bits = np.ascontiguousarray(packed)
    times = spike_times(bits, pixels, STEPS, threads=1)
    moments = np.full((8 * bits.shape[1], 4), np.nan)
    blocks = np.zeros((BLOCKS, 8 * bits.shape[1]), np.int32)
    lengths = np.zeros(LENGTHS + 1, np.int64)
    _intervals(bits, moments, blocks, lengths)
    spikes = unpack_frames(bits, shape)
    row, column = np.zeros((len(bits), shape[0]), np.int32), np.zeros((len(bits), shape[1]), np.int32)
    coincidences = np.zeros((LAGS, 2))
    _neighbours(spikes, row, column, coincidences)
    return Observation(
        shape,
        times,
        moments[:pixels, 0],
        moments[:pixels, 1],
        np.nan_to_num(moments[:pixels, 2]).astype(np.int64),
        np.nan_to_num(moments[:pixels, 3]).astype(np.int64),
        lengths[1:],
        blocks[:, :pixels],
        row.sum(axis=1, dtype=np.int32),
        row,
        column,
        coincidences,
        _film(spikes) if film else None,
    )


def _film(spikes: NDArray[np.uint8]) -> NDArray[np.uint8]:
    bins = len(spikes) // BIN
    return spikes[: bins * BIN].reshape(bins, BIN, -1).sum(axis=1, dtype=np.uint8)


@njit(cache=True, nogil=True, boundscheck=False)
def _intervals(bits, moments, blocks, lengths):  # type: ignore[no-untyped-def]
    frames = bits.shape[0]
    times = np.empty((8, frames), np.int32)
    count = np.empty(8, np.int64)
    block = (frames + BLOCKS - 1) // BLOCKS
    for column in range(bits.shape[1]):
        count[:] = 0
        for t in range(frames):
            byte = bits[t, column]
            if byte:
                b = t // block
                for bit in range(8):
                    if (byte >> bit) & 1:
                        times[bit, count[bit]] = t
                        count[bit] += 1
                        blocks[b, 8 * column + bit] += 1
        for bit in range(8):
            n = count[bit]
            if n < 2:
                continue
            t = times[bit]
            for i in range(n - 1):
                lengths[min(t[i + 1] - t[i] - 1, LENGTHS - 1) + 1] += 1
            if n < 4:
                continue
            mean = (t[n - 1] - t[0]) / (n - 1)
            square, product, short, long = 0.0, 0.0, 0, 0
            before = t[1] - t[0] - mean
            for i in range(n - 1):
                d = t[i + 1] - t[i] - mean
                square += d * d
                product += d * before if i else 0.0
                short += d < -0.4 * mean - 1.0
                long += d > 0.5 * mean + 1.0
                before = d
            p = 8 * column + bit
            moments[p, 0] = square / (n - 1)
            moments[p, 1] = product / (n - 2)
            moments[p, 2] = short
            moments[p, 3] = long


@njit(cache=True, nogil=True, boundscheck=False)
def _neighbours(spikes, row, column, coincidences):  # type: ignore[no-untyped-def]
    frames, rows, columns = spikes.shape
    for t in range(frames):
        for r in range(rows):
            fired = 0
            for c in range(columns):
                fired += spikes[t, r, c]
                column[t, c] += spikes[t, r, c]
            row[t, r] = fired
            if not fired:
                continue
            for lag in range(min(LAGS, t + 1)):
                across, down = np.int64(0), np.int64(0)
                now, then = spikes[t, r], spikes[t - lag, r]
                for c in range(columns - 1):
                    across += (now[c] & then[c + 1]) + (now[c + 1] & then[c])
                if r:
                    above, was = spikes[t, r - 1], spikes[t - lag, r - 1]
                    for c in range(columns):
                        down += (now[c] & was[c]) + (above[c] & then[c])
                coincidences[lag, 0] += across
                coincidences[lag, 1] += down
