"""The passes over a recording's bits, compiled: pixel by pixel, and frame by frame, into an `ObservedRecording`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spikecam_env.calibration.spike_times import fill_ends_and_differences
from spikecam_env.compiled import njit
from spikecam_env.streams.bits import by_pixel, ones, times_of

SPARSE = 0.05
"""Spikes a frame below which a pixel's are visited one by one: faster there, and the same sums."""

FEW_LENGTHS = 8
"""Different lengths of a pixel's intervals below which each is counted in its own pass: faster, the same counts."""

BESIDE_WHOLE = 0.04
"""Distance of a mean interval from a whole number, up to which a pixel's late and early spikes are counted [frames]."""


@njit(cache=True, nogil=True, boundscheck=False)
def through_pixels(
    words: NDArray[np.uint64],
    steps: NDArray[np.int64],
    ends: NDArray[np.int64],
    square: NDArray[np.float64],
    terms: NDArray[np.int64],
    moments: NDArray[np.float64],
    blocks: NDArray[np.int32],
    lengths: NDArray[np.int64],
    late: NDArray[np.float64],
    scatter: NDArray[np.float64],
    timed: NDArray[np.int32],
    odd: NDArray[np.int32],
    flips: NDArray[np.int32],
) -> None:
    frames = words.shape[0]
    bits = np.empty((64, (frames + 63) // 64), np.uint64)
    t = np.empty(frames + 1, np.int32)
    d = np.empty(frames + 1, np.int32)
    counts = np.zeros((4, lengths.size), np.int64)
    for column in range(words.shape[1]):
        by_pixel(words, column, bits)
        known, means, variances = np.uint64(0), np.zeros(64), np.zeros(64)
        for within in range(64):
            p = 64 * column + within
            if p >= ends.shape[0]:
                break
            n = times_of(bits[within], t)
            fill_ends_and_differences(t, n, steps, ends[p], square[p], terms[p])
            if n > 0:
                _fill_blocks(t[:n], frames, blocks[:, p])
            if n < 2:
                continue
            least, most = _fill_intervals(t[:n], d)
            _count(d[: n - 1], least, most, counts)
            if n < 4:
                continue
            mean = (t[n - 1] - t[0]) / (n - 1)
            variance = _fill_moments(d[: n - 1], mean, moments[p])
            _count_flips(d[: n - 1], mean, flips[p])
            below, above = np.int32(np.ceil(0.6 * mean - 1.0)), np.int32(np.floor(1.5 * mean + 1.0))
            moments[p, 2], moments[p, 3] = 0, 0
            if least < below or most > above:
                moments[p, 2], moments[p, 3] = _count_odd(t[:n], d[: n - 1], below, above, odd)
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
    lengths += counts.sum(axis=0)
    for f in range(frames):
        if timed[f] == 0:
            late[f], scatter[f] = 0.0, 0.0  # but for rounding


@njit(cache=True, nogil=True, boundscheck=False)
def _fill_blocks(t: NDArray[np.int32], frames: int, blocks: NDArray[np.int32]) -> None:
    """Numbers of the spikes t (n,) in blocks (B,) of time of equal length."""
    length = (frames + blocks.size - 1) // blocks.size
    before = np.int64(0)
    for b in range(blocks.size):
        until = np.searchsorted(t, min((b + 1) * length, frames))
        blocks[b] = until - before
        before = until


@njit(cache=True, nogil=True, boundscheck=False)
def _fill_intervals(t: NDArray[np.int32], d: NDArray[np.int32]) -> tuple[np.int32, np.int32]:
    """Intervals of the spikes t (n,) into d; returns the least and the longest."""
    least, most = np.int32(2**31 - 1), np.int32(0)
    for i in range(t.size - 1):
        d[i] = t[i + 1] - t[i]
        least, most = min(least, d[i]), max(most, d[i])
    return least, most


@njit(cache=True, nogil=True, boundscheck=False)
def _fill_moments(d: NDArray[np.int32], mean: float, moments: NDArray[np.float64]) -> float:
    """Variance of intervals d, which is returned too, and covariance of neighbouring ones, by whole sums.

    sum (d - m)(d' - m) = sum d d' - m (sum d + sum d') + (n - 1) m^2        n: intervals
    """
    squares, products, total = np.int64(0), np.int64(0), np.int64(0)
    for i in range(d.size):
        squares += np.int64(d[i]) * d[i]
        total += d[i]
    for i in range(d.size - 1):
        products += np.int64(d[i]) * d[i + 1]
    variance = squares / d.size - mean * mean
    inner = 2.0 * total - d[0] - d[d.size - 1]
    moments[0], moments[1] = variance, (products - mean * inner) / (d.size - 1) + mean * mean
    return variance  # type: ignore[no-any-return]


@njit(cache=True, nogil=True, boundscheck=False)
def _count_flips(d: NDArray[np.int32], mean: float, flips: NDArray[np.int32]) -> None:
    """Count late spikes with the next one on time, and early ones, where the mean interval is nearly whole."""
    whole = np.int32(np.round(mean))
    if abs(mean - whole) < BESIDE_WHOLE:
        for i in range(d.size - 1):
            flips[0] += (d[i] == whole + 1) & (d[i + 1] == whole - 1)
            flips[1] += (d[i] == whole - 1) & (d[i + 1] == whole + 1)


@njit(cache=True, nogil=True, boundscheck=False)
def _count_odd(
    t: NDArray[np.int32], d: NDArray[np.int32], below: np.int32, above: np.int32, odd: NDArray[np.int32]
) -> tuple[np.int64, np.int64]:
    """(number of intervals d shorter than `below`, of those longer than `above`); both into `odd` (F,) where they
    end."""
    short, long = np.int64(0), np.int64(0)
    for i in range(d.size):
        too_short, too_long = d[i] < below, d[i] > above
        short += too_short
        long += too_long
        odd[t[i + 1]] += too_short | too_long
    return short, long


@njit(cache=True, nogil=True, boundscheck=False)
def _count(d: NDArray[np.int32], least: np.int32, most: np.int32, lengths: NDArray[np.int64]) -> None:
    """Add the intervals d, of least to most, to `lengths` (4, n): length by length where these are few.

    The four rows take turns, since a count that is added to twice in a row waits for itself.
    """
    if most - least < FEW_LENGTHS:
        for length in range(least, most + 1):
            count = 0
            for i in range(d.size):
                count += d[i] == length
            lengths[0, min(length, lengths.shape[1] - 1)] += count
    else:
        for i in range(d.size):
            lengths[i & 3, min(d[i], lengths.shape[1] - 1)] += 1


@njit(cache=True, nogil=True, boundscheck=False)
def _add_to_spikes(
    words: NDArray[np.uint64],
    known: np.uint64,
    mean: NDArray[np.float64],
    variance: NDArray[np.float64],
    late: NDArray[np.float64],
    scatter: NDArray[np.float64],
    timed: NDArray[np.int32],
) -> None:
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
def add_rows(octets: NDArray[np.uint8], rows: int, spread: NDArray[np.uint64], sums: NDArray[np.uint64]) -> None:
    """Sum octets (F, rows * each) over rows into `sums` (parts, F, each): 255 rows a part, the most of a byte."""
    parts, frames, each = sums.shape
    for part in range(parts):
        for f in range(frames):
            for r in range(255 * part, min(255 * (part + 1), rows)):
                for b in range(each):
                    sums[part, f, b] += spread[octets[f, r * each + b]]


@njit(cache=True, nogil=True, boundscheck=False)
def through_frames(
    words: NDArray[np.uint64], rows: int, row: NDArray[np.int32], coincidences: NDArray[np.float64]
) -> None:
    """Count spikes by row, and coincidences of neighbours, in words (F, rows * n) padded with zeros to whole words."""
    frames = words.shape[0]
    each = words.shape[1] // rows
    right = words >> np.uint64(1)  # every pixel's neighbour to the right in its place
    for f in range(frames):
        for at in range(words.shape[1]):
            if (at + 1) % each:
                right[f, at] |= words[f, at + 1] << np.uint64(63)
            row[f, at // each] += ones(words[f, at])
    for lag in range(coincidences.shape[0]):
        across, down = np.uint64(0), np.uint64(0)
        for f in range(lag, frames):
            now, then = words[f], words[f - lag]
            across += _common(now, right[f - lag]) + _common(right[f], then)
            down += _common(now[each:], then[:-each]) + _common(now[:-each], then[each:])
        coincidences[lag] = across, down


@njit(cache=True, nogil=True, boundscheck=False)
def _common(a: NDArray[np.uint64], b: NDArray[np.uint64]) -> np.uint64:
    """Number of bits that two rows of words (n,) have in common."""
    total = np.uint64(0)
    for i in range(a.size):
        total += ones(a[i] & b[i])
    return total  # type: ignore[no-any-return]
