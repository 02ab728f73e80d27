"""A recording reduced to numbers, in two passes over its bits: what every statistic is computed from.

Per pixel: spike times at both ends, second differences A_k, interval moments, counts by block of time.
Per frame: spikes of the array, of each row and of each column.  Neighbours: coincidences at lags of 0 to 2 frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from spikecam_env.calibration.spike_times import SpikeTimes, second_differences
from spikecam_env.streams.bits import as_words, by_pixel, ones, times_of
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

FEW = 0.3
"""Share of pixels below which those with odd intervals are left out where noise of all pixels is asked for."""

SPARSE = 0.05
"""Spikes a frame below which a pixel's are gone through one by one."""

LAGS = 3
"""Lags 0 .. LAGS - 1 [frames] of neighbours' coincidences."""


@dataclass(frozen=True)
class Observation:
    """One recording in numbers; P pixels row-major, F frames, shape (H, W).

    times: ends, counts and A_k of each pixel.  variance, covariance: (P,) of intervals, and of successive ones, about
    the pixel's own mean [frames^2]; NaN below 3 intervals.  short, long: (P,) intervals T below 0.6 T - 1 or
    above 1.5 T + 1 of the mean.  lengths: (LENGTHS,) intervals of the array by length, 1 frame first.
    blocks: (BLOCKS, P) counts.
    frame, row, column: (F,), (F, H), (F, W) spikes.  coincidences: (LAGS, 2) spikes of one pixel with its neighbour's,
    lag by lag, along rows and along columns.  film: (F // BIN, P) uint8 counts, or None for static light.
    late: (F,) sum over the `timed` (F,) intervals that end in a frame of what they are longer than the pixel's mean
    [frames], of pixels without short or long ones; scatter: (F,) of the variances of those pixels' intervals.
    odd: (F,) short and long intervals that end in a frame.
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
    late: Array
    scatter: Array
    timed: NDArray[np.int32]
    odd: NDArray[np.int32]

    @property
    def frames(self) -> int:
        return self.times.frames

    @property
    def rate(self) -> Array:
        """(P,) spikes a frame between first and last spike; count over frames below two spikes."""
        return np.where(self.times.count > 1, self.times.rate, self.times.count / self.frames)

    @property
    def struck(self) -> NDArray[np.bool_]:
        """(P,) pixels with a short or long interval, where they are FEW; none where odd intervals are the rule."""
        odd: NDArray[np.bool_] = self.short + self.long > 0
        return odd & (odd.mean() < FEW)


def observe(packed: NDArray[np.uint8], shape: tuple[int, int], *, film: bool = False) -> Observation:
    """Reduce (F, ceil(H W / 8)) uint8 bits; film: keep counts in bins of time."""
    pixels = shape[0] * shape[1]
    ends = np.full((pixels, 3), -1, np.int64)
    square, terms = np.zeros((pixels, len(STEPS))), np.zeros((pixels, len(STEPS)), np.int64)
    moments = np.full((pixels, 4), np.nan)
    blocks = np.zeros((BLOCKS, pixels), np.int32)
    lengths = np.zeros(LENGTHS + 1, np.int64)
    late, scatter = np.zeros((2, len(packed)))
    timed, odd = np.zeros((2, len(packed)), np.int32)
    _pixels(as_words(packed), ends, square, terms, moments, blocks, lengths, late, scatter, timed, odd)
    by_row = _rows_in_words(packed, shape)
    row = np.zeros((len(packed), shape[0]), np.int32)
    coincidences = np.zeros((LAGS, 2))
    _neighbours(by_row, shape[0], row, coincidences)
    count, first, last = ends.T
    return Observation(
        shape,
        SpikeTimes(len(packed), count, first, last, np.array(STEPS), square, terms),
        moments[:, 0],
        moments[:, 1],
        np.nan_to_num(moments[:, 2]).astype(np.int64),
        np.nan_to_num(moments[:, 3]).astype(np.int64),
        lengths[1:],
        blocks,
        row.sum(axis=1, dtype=np.int32),
        row,
        _columns(by_row, shape),
        coincidences,
        _film(unpack_frames(packed, shape)) if film else None,
        late,
        scatter,
        timed,
        odd,
    )


def _rows_in_words(packed: NDArray[np.uint8], shape: tuple[int, int]) -> NDArray[np.uint64]:
    """(F, rows * words) bits with every row of pixels in words of its own."""
    if shape[1] % 64 == 0:
        return as_words(packed)
    padded = np.pad(unpack_frames(packed, shape), ((0, 0), (0, 0), (0, -shape[1] % 64)))
    return np.packbits(padded, axis=2, bitorder="little").reshape(len(padded), -1).view(np.uint64)


_SPREAD = np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1, bitorder="little").view(np.uint64)[:, 0]
"""(256,) the eight bits of a byte as eight bytes of a word, which add up side by side."""


def _columns(by_row: NDArray[np.uint64], shape: tuple[int, int]) -> NDArray[np.int32]:
    """(F, W) spikes of each column, frame by frame."""
    each = by_row.shape[1] * 8 // shape[0]
    sums = np.zeros((-(-shape[0] // 255), len(by_row), each), np.uint64)
    _add_rows(by_row.view(np.uint8), shape[0], _SPREAD, sums)
    parts = sums.view(np.uint8)[..., : shape[1]]
    return parts[0].astype(np.int32) if len(parts) == 1 else parts.sum(axis=0, dtype=np.int32)


def _film(spikes: NDArray[np.uint8]) -> NDArray[np.uint8]:
    bins = len(spikes) // BIN
    return spikes[: bins * BIN].reshape(bins, BIN, -1).sum(axis=1, dtype=np.uint8)


@njit(cache=True, nogil=True, boundscheck=False)
def _pixels(words, ends, square, terms, moments, blocks, lengths, late, scatter, timed, odd):  # type: ignore[no-untyped-def]
    frames = words.shape[0]
    bits = np.empty((64, (frames + 63) // 64), np.uint64)
    t = np.empty(frames + 1, np.int32)
    d = np.empty(frames + 1, np.int32)
    block = (frames + BLOCKS - 1) // BLOCKS
    for column in range(words.shape[1]):
        by_pixel(words, column, bits)
        known, means, variances = np.uint64(0), np.zeros(64), np.zeros(64)
        for within in range(64):
            p = 64 * column + within
            if p >= ends.shape[0]:
                break
            n = times_of(bits[within], t)
            ends[p, 0] = n
            if n == 0:
                continue
            ends[p, 1], ends[p, 2] = t[0], t[n - 1]
            i = 0
            for b in range(BLOCKS):
                start, stop = i, min((b + 1) * block, frames)
                i = np.searchsorted(t[:n], stop)
                blocks[b, p] = i - start
            for j in range(len(STEPS)):
                k = STEPS[j]
                if n > 2 * k:
                    square[p, j] = second_differences(t, n, k)
                    terms[p, j] = n - 2 * k
            if n < 2:
                continue
            least, most = np.int32(frames), np.int32(0)
            for i in range(n - 1):
                d[i] = t[i + 1] - t[i]
                least, most = min(least, d[i]), max(most, d[i])
            _count(d[: n - 1], least, most, lengths)
            if n < 4:
                continue
            mean = (t[n - 1] - t[0]) / (n - 1)
            squares, products = np.int64(0), np.int64(0)
            for i in range(n - 1):
                squares += np.int64(d[i]) * d[i]
            for i in range(n - 2):
                products += np.int64(d[i]) * d[i + 1]
            variance = squares / (n - 1) - mean * mean
            # sum (d - m)(d' - m) = sum d d' - m (sum d + sum d') + (n - 2) m^2
            inner = 2.0 * (t[n - 1] - t[0]) - d[0] - d[n - 2]
            moments[p, 0], moments[p, 1] = variance, (products - mean * inner) / (n - 2) + mean * mean
            below, above = np.int32(np.ceil(0.6 * mean - 1.0)), np.int32(np.floor(1.5 * mean + 1.0))
            moments[p, 2], moments[p, 3] = 0.0, 0.0
            if least < below or most > above:
                for i in range(n - 1):
                    moments[p, 2] += d[i] < below
                    moments[p, 3] += d[i] > above
                    odd[t[i + 1]] += d[i] < below or d[i] > above
            elif n < SPARSE * frames:
                for i in range(n - 1):
                    late[t[i + 1]] += d[i] - mean
                    scatter[t[i + 1]] += variance
                    timed[t[i + 1]] += 1
            else:
                for i in range(n - 1):
                    late[t[i + 1]] += d[i]
                known |= np.uint64(1) << np.uint64(within)
                means[within], variances[within] = mean, variance
                late[t[0]] += mean  # no interval ends with the first spike
                scatter[t[0]] -= variance
                timed[t[0]] -= 1
        if known:
            _add_to_spikes(words[:, column].copy(), known, means, variances, late, scatter, timed)
    for f in range(frames):
        if timed[f] == 0:
            late[f], scatter[f] = 0.0, 0.0  # but for rounding


@njit(cache=True, nogil=True, boundscheck=False)
def _count(d, least, most, lengths):  # type: ignore[no-untyped-def]
    """Add the intervals d, of least to most, to those of their length: length by length where these are few."""
    if most - least < 8:
        for length in range(least, most + 1):
            count = 0
            for i in range(d.size):
                count += d[i] == length
            lengths[min(length, LENGTHS)] += count
    else:
        for i in range(d.size):
            lengths[min(d[i], LENGTHS)] += 1


@njit(cache=True, nogil=True, boundscheck=False)
def _add_to_spikes(words, known, mean, variance, late, scatter, timed):  # type: ignore[no-untyped-def]
    """Take a mean and add a variance (64,) for the spikes (F,) of each of 64 pixels, bit by bit those `known`; eight
    pixels at a time, from sums over all that may fire together."""
    means, variances = np.zeros((8, 256)), np.zeros((8, 256))
    for octet in range(8):
        for i in range(8):
            for j in range(1 << i):
                means[octet, j + (1 << i)] = means[octet, j] + mean[8 * octet + i]
                variances[octet, j + (1 << i)] = variances[octet, j] + variance[8 * octet + i]
    for f in range(words.size):
        fired = words[f] & known
        usual, own = 0.0, 0.0
        for octet in range(8):
            at = (fired >> np.uint64(8 * octet)) & np.uint64(255)
            usual += means[octet, at]
            own += variances[octet, at]
        late[f] -= usual
        scatter[f] += own
        timed[f] += ones(fired)


@njit(cache=True, nogil=True, boundscheck=False)
def _add_rows(octets, rows, spread, sums):  # type: ignore[no-untyped-def]
    """octets: (F, rows * each) uint8; sums: (parts, F, each), 255 rows a part, the most a byte can count."""
    parts, frames, each = sums.shape
    for part in range(parts):
        for f in range(frames):
            for r in range(255 * part, min(255 * (part + 1), rows)):
                for b in range(each):
                    sums[part, f, b] += spread[octets[f, r * each + b]]


@njit(cache=True, nogil=True, boundscheck=False)
def _neighbours(words, rows, row, coincidences):  # type: ignore[no-untyped-def]
    """words: (F, rows * n) uint64, each row of pixels n whole words, padded with zeros."""
    frames = words.shape[0]
    each = words.shape[1] // rows
    right = words >> np.uint64(1)  # every pixel's neighbour to the right in its place
    for f in range(frames):
        for at in range(words.shape[1]):
            if (at + 1) % each:
                right[f, at] |= words[f, at + 1] << np.uint64(63)
            row[f, at // each] += ones(words[f, at])
    for lag in range(LAGS):
        across, down = np.uint64(0), np.uint64(0)
        for f in range(lag, frames):
            now, then = words[f], words[f - lag]
            across += _common(now, right[f - lag]) + _common(right[f], then)
            down += _common(now[each:], then[:-each]) + _common(now[:-each], then[each:])
        coincidences[lag] = across, down


@njit(cache=True, nogil=True, boundscheck=False)
def _common(a, b):  # type: ignore[no-untyped-def]
    """Number of bits that two rows of words (n,) have in common."""
    total = np.uint64(0)
    for i in range(a.size):
        total += ones(a[i] & b[i])
    return total
