"""What calibration needs of a recording, in one pass over its bits: spike times, not counts.

A steady pixel's count is known to a spike, its first and last spike to a frame: with n spikes the rate is
(n - 1) / (last - first), T times better than n / frames.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import config, njit
from numpy.typing import ArrayLike, NDArray

STEPS = (1, 2, 4, 8, 16, 32, 64, 128)
"""k of A_k by default: short ones see dim light's jitter, long ones bright light's and slow noise."""


@dataclass(frozen=True)
class SpikeTimes:
    """Per pixel, row-major: count, first, last (P,) int64 (-1 without spikes); frames: length of the recording.

    square: (P, K) float64 sums of (t_(n+2k) - 2 t_(n+k) + t_n)^2 and terms: (P, K) how many, at k = steps.
    """

    frames: int
    count: NDArray[np.int64]
    first: NDArray[np.int64]
    last: NDArray[np.int64]
    steps: NDArray[np.int64]
    square: NDArray[np.float64]
    terms: NDArray[np.int64]

    @property
    def rate(self) -> NDArray[np.float64]:
        """(P,) spikes a frame between first and last spike; NaN below two spikes."""
        span = np.where(self.count > 1, self.last - self.first, 1)
        return np.where(self.count > 1, (self.count - 1) / span, np.nan)


def spike_times(
    packed: NDArray[np.uint8], pixels: int, steps: ArrayLike = STEPS, *, threads: int | None = None
) -> SpikeTimes:
    """Summarise (frames, ceil(pixels/8)) uint8 bits, as `streams.pack_frames` gives them.

    threads: default NUMBA_NUM_THREADS.
    """
    ks = np.asarray(steps, dtype=np.int64)
    bits = np.asarray(packed)
    whole = bits.shape[1] * 8
    ends = np.full((whole, 3), -1, dtype=np.int64)
    square = np.zeros((whole, ks.size))
    terms = np.zeros((whole, ks.size), dtype=np.int64)
    workers = config.NUMBA_NUM_THREADS if threads is None else threads  # type: ignore[attr-defined]
    cuts = np.linspace(0, bits.shape[1], max(1, min(workers, bits.shape[1])) + 1).astype(int)
    with ThreadPoolExecutor(len(cuts) - 1) as pool:
        jobs = [pool.submit(_scan, bits, a, b, ks, ends, square, terms) for a, b in pairwise(cuts)]
        for job in jobs:
            job.result()
    count, first, last = ends[:pixels].T
    return SpikeTimes(len(bits), count, first, last, ks, square[:pixels], terms[:pixels])


@njit(cache=True, nogil=True, boundscheck=False)
def _scan(bits, first_byte, last_byte, ks, ends, square, terms):  # type: ignore[no-untyped-def]
    frames = bits.shape[0]
    times = np.empty((8, frames), np.int32)
    count = np.empty(8, np.int64)
    for column in range(first_byte, last_byte):
        count[:] = 0
        for t in range(frames):
            byte = bits[t, column]
            if byte:
                for bit in range(8):
                    if (byte >> bit) & 1:
                        times[bit, count[bit]] = t
                        count[bit] += 1
        for bit in range(8):
            pixel, n = 8 * column + bit, count[bit]
            ends[pixel, 0] = n
            if n == 0:
                continue
            ends[pixel, 1] = times[bit, 0]
            ends[pixel, 2] = times[bit, n - 1]
            for i in range(ks.size):
                k = ks[i]
                if n > 2 * k:
                    square[pixel, i] = _second_differences(times[bit], n, k)
                    terms[pixel, i] = n - 2 * k


@njit(inline="always")
def _second_differences(t, n, k):  # type: ignore[no-untyped-def]
    total = np.float64(0.0)
    for start in range(0, n - 2 * k, 4096):  # in blocks, so that int64 sums vectorise and cannot overflow
        part = np.int64(0)
        for j in range(start, min(start + 4096, n - 2 * k)):
            d = np.int64(t[j + 2 * k]) - 2 * np.int64(t[j + k]) + np.int64(t[j])
            part += d * d
        total += part
    return total
