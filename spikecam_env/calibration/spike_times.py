"""Spike times of a recording, in one pass over its bits, as calibration needs them in place of counts.

A steady pixel's count is known to a spike, its first and last spike to a frame: with n spikes the rate is
(n - 1) / (last - first), T times better than n / frames.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.compiled import njit
from spikecam_env.streams.bits import as_words, by_pixel, times_of
from spikecam_env.threads import as_many
from spikecam_env.types import Floats

STEPS = (1, 2, 4, 8, 16, 32, 64, 128)
"""k of A_k by default: short ones see dim light's jitter, long ones bright light's and slow noise."""


@dataclass(frozen=True)
class SpikeTimes:
    """Spike times of P pixels, row-major."""

    frames: int
    """Length of the recording."""
    count: NDArray[np.int64]
    """(P,) number of spikes."""
    first: NDArray[np.int64]
    """(P,) frame of the first spike, -1 without spikes."""
    last: NDArray[np.int64]
    """(P,) frame of the last spike, -1 without spikes."""
    steps: NDArray[np.int64]
    """(K,) the k of A_k."""
    square: NDArray[np.float64]
    """(P, K) sums of (t_(n+2k) - 2 t_(n+k) + t_n)^2."""
    terms: NDArray[np.int64]
    """(P, K) number of terms of the sums."""

    @property
    def rate(self) -> NDArray[np.float64]:
        """(P,) spikes a frame between first and last spike; NaN below two spikes."""
        span = np.where(self.count > 1, self.last - self.first, 1)
        return np.where(self.count > 1, (self.count - 1) / span, np.nan)


def spike_times(
    packed: NDArray[np.uint8], pixels: int, steps: ArrayLike = STEPS, *, threads: int | None = None
) -> SpikeTimes:
    """Spike times of a packed recording.

    Args:
        packed: (frames, ceil(pixels/8)) uint8 bits, as `streams.pack_frames` gives them.
        pixels: number of pixels.
        steps: (K,) the k of A_k.
        threads: number of threads, default NUMBA_NUM_THREADS.
    """
    ks = np.asarray(steps, dtype=np.int64)
    words = as_words(np.asarray(packed))
    whole = words.shape[1] * 64
    ends = np.full((whole, 3), -1, dtype=np.int64)
    square = np.zeros((whole, ks.size))
    terms = np.zeros((whole, ks.size), dtype=np.int64)
    cuts = np.linspace(0, words.shape[1], as_many(threads, words.shape[1]) + 1).astype(int)
    with ThreadPoolExecutor(len(cuts) - 1) as pool:
        jobs = [pool.submit(_scan, words, a, b, ks, ends, square, terms) for a, b in pairwise(cuts)]
        for job in jobs:
            job.result()
    count, first, last = ends[:pixels].T
    return SpikeTimes(len(words), count, first, last, ks, square[:pixels], terms[:pixels])


def ideal_second_difference(k: NDArray[np.int64], interval: Floats) -> Floats:
    """A_k of a noise-free pixel of interval T, phase uniform: 2 min(x, 1 - x), x the fractional part of kT."""
    x = np.mod(k * interval, 1.0)
    return 2.0 * np.minimum(x, 1.0 - x)


def plausible_rates(times: SpikeTimes, white: float, rng: np.random.Generator) -> Floats:
    """Draw rates that agree with the first and the last spike of each pixel, under jitter of variance `white`.

    Measured rates crowd at simple fractions: a pixel of interval 5.004 shows one of 5 for a hundred spikes.  A camera
    simulated at exactly such rates has second differences that no real one has.  Drawn rates lie as the true ones do.

    Args:
        times: spikes of each pixel.
        white: s^2, the variance of an interval over its square.
        rng: source of the draws.

    Returns:
        (P,) rates [spikes/frame].
    """
    n = np.maximum(times.count - 1, 1)
    interval = np.maximum(times.last - times.first, 1) / n
    after = times.frames - 1 - times.last
    begin = times.first + rng.random(n.size) * np.clip(interval - times.first, 0.0, 1.0)
    end = times.frames - after - rng.random(n.size) * np.clip(interval - after, 0.0, 1.0)
    walk = np.sqrt(n * white) * interval * rng.standard_normal(n.size)
    least = n  # a pixel fires once a frame at most, however wide the jitter
    return np.asarray(n / np.maximum(end - begin + walk, least))


@njit(cache=True, nogil=True, boundscheck=False)
def _scan(
    words: NDArray[np.uint64],
    first_word: int,
    last_word: int,
    ks: NDArray[np.int64],
    ends: NDArray[np.int64],
    square: NDArray[np.float64],
    terms: NDArray[np.int64],
) -> None:
    frames = words.shape[0]
    bits = np.empty((64, (frames + 63) // 64), np.uint64)
    times = np.empty(frames + 1, np.int32)
    for column in range(first_word, last_word):
        by_pixel(words, column, bits)
        for within in range(64):
            pixel = 64 * column + within
            n = times_of(bits[within], times)
            fill_ends_and_differences(times, n, ks, ends[pixel], square[pixel], terms[pixel])


@njit(cache=True, nogil=True, boundscheck=False)
def fill_ends_and_differences(
    t: NDArray[np.int32],
    n: int,
    ks: NDArray[np.int64],
    ends: NDArray[np.int64],
    square: NDArray[np.float64],
    terms: NDArray[np.int64],
) -> None:
    """Fill a pixel's ends (count, first, last), and sums and numbers (K,) of its second differences, from the n spike
    times at the start of t."""
    ends[0] = n
    if n == 0:
        return
    ends[1], ends[2] = t[0], t[n - 1]
    for i in range(ks.size):
        k = ks[i]
        if n > 2 * k:
            square[i] = second_differences(t, n, k)
            terms[i] = n - 2 * k


@njit(cache=True, nogil=True, fastmath={"reassoc"})
def second_differences(t: NDArray[np.int32], n: int, k: int) -> float:
    """Sum of (t_(i+2k) - 2 t_(i+k) + t_i)^2 over the n spike times at the start of t: of whole numbers, in any
    order."""
    first, middle, last = t[: n - 2 * k], t[k : n - k], t[2 * k : n]  # views: indices that cannot wrap vectorise
    total = 0.0
    for i in range(n - 2 * k):
        d = np.float64(np.int32(last[i] - np.int32(2) * middle[i] + first[i]))
        total += d * d
    return total
