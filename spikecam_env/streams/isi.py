"""Inter-spike interval (ISI) planes.

For a stream of T frames and a pixel with spikes at frames s (0 <= s < T):

    last(t) = max{s : s <= t},            -1 if there is none
    next(t) = min{s : s > t},             T if there is none
    ISI(t)  = min(next(t), t + future + 1) - last(t)          [frames], an integer >= 1

The interval at t is the one that runs at the end of frame t: a spike in frame t opens a new interval.
Where a bounding spike is missing the interval counts to the edge of the frames seen, a lower bound on the true
interval.  The edge is one frame before the data, one after them, or one after the look-ahead.

`future` is the look-ahead in frames.  Plane t depends on frames 0 .. t + future only, so a causal
filter that lags by `future` frames computes the same plane.  None looks to the end of the data.
Intervals are exact to 2^24 frames (7 minutes at 40 kHz); a longer one is the nearest float32.
Normalised plane: 1 / ISI, in (0, 1], an estimate of the rate [spikes/frame].
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.compiled import njit
from spikecam_env.errors import InputError
from spikecam_env.streams.packing import as_spikes

MOST_FRAMES = 2**31 - 1
"""Frames are counted in int32; 15 hours at 40 kHz."""


def isi_plane(spikes: ArrayLike, t: int, *, future: int | None = None, normalised: bool = False) -> NDArray[np.float32]:
    """The plane at a frame.

    Args:
        spikes: (T, H, W).
        t: frame.
        future: look-ahead [frames]; None for the end of the data.
        normalised: return 1 / ISI [spikes/frame] instead of ISI [frames].

    Returns:
        (H, W).

    Example:
        >>> isi_plane(np.uint8([1, 0, 0, 1, 0, 1]).reshape(6, 1, 1), t=2).tolist()
        [[3.0]]
    """
    return np.asarray(isi_planes(spikes, start=t, stop=t + 1, future=future, normalised=normalised)[0])


def isi_planes(
    spikes: ArrayLike,
    *,
    start: int = 0,
    stop: int | None = None,
    future: int | None = None,
    normalised: bool = False,
) -> NDArray[np.float32]:
    """Planes of frames `start` to `stop`, of which each sees the whole stream; time is O(T) a pixel.

    Args:
        spikes: (T, H, W).
        start: first frame.
        stop: frame after the last; default T.
        future: look-ahead [frames]; None for the end of the data.
        normalised: return 1 / ISI [spikes/frame] instead of ISI [frames].

    Returns:
        (stop - start, H, W): plane i is `isi_plane(spikes, start + i)`.

    Example:
        >>> isi_planes(np.uint8([1, 0, 0, 1, 0, 1]).reshape(6, 1, 1), start=2, stop=5).ravel().tolist()
        [3.0, 2.0, 2.0]
    """
    frames = as_spikes(spikes)
    count = len(frames)
    stop = count if stop is None else stop
    if not 0 <= start < stop <= count:
        raise InputError(f"planes {start} to {stop} asked of {count} frames; need 0 <= start < stop <= {count}")
    if future is not None and future < 0:
        raise InputError(f"future is {future}; it is a look-ahead in frames, 0 or more")
    ahead = count if future is None else future
    if count >= MOST_FRAMES:
        raise InputError(f"a stream of {count} frames; intervals are counted over fewer than {MOST_FRAMES}")
    flat = np.ascontiguousarray(frames).reshape(count, -1)
    planes = np.empty((stop - start, flat.shape[1]), np.float32)
    _isi(flat, start, stop, min(ahead, count), normalised, planes, planes.view(np.int32))
    return planes.reshape(stop - start, *frames.shape[1:])


# Not parallel: numba's OpenMP layer changes torch's number of threads, and the networks then ran 60 times slower.
@njit(cache=True, nogil=True)
def _isi(
    spikes: NDArray[np.uint8],
    start: int,
    stop: int,
    ahead: int,
    normalised: bool,
    planes: NDArray[np.float32],
    last_of: NDArray[np.int32],
) -> None:
    """Fill `planes`; `last_of` is the same memory as int32, which holds last(t) until the interval is known.

    In float32 frames beyond 2^24 would be rounded.
    """
    count, pixels = spikes.shape
    strip = 2048
    for s in range((pixels + strip - 1) // strip):
        a, b = s * strip, min((s + 1) * strip, pixels)
        last = np.full(b - a, -1, np.int32)
        for t in range(_first_that_matters(spikes, start, a, b), stop):
            for i in range(b - a):
                if spikes[t, a + i]:
                    last[i] = t
            if t >= start:
                for i in range(b - a):
                    last_of[t - start, a + i] = last[i]
        horizon = min(count, stop + ahead)
        following = np.full(b - a, horizon, np.int32)
        for t in range(horizon - 1, start - 1, -1):
            if t < stop:
                limit = min(t + ahead + 1, count)
                for i in range(b - a):
                    interval = np.float32(min(following[i], limit) - last_of[t - start, a + i])
                    planes[t - start, a + i] = np.float32(1.0) / interval if normalised else interval
            for i in range(b - a):
                if spikes[t, a + i]:
                    following[i] = t


@njit(cache=True)
def _first_that_matters(spikes: NDArray[np.uint8], start: int, a: int, b: int) -> int:
    """The latest t <= start such that every pixel in [a, b) has a spike in t .. start, or 0."""
    missing = b - a
    seen = np.zeros(b - a, np.uint8)
    t = start
    while missing > 0 and t > 0:
        for i in range(b - a):
            if spikes[t, a + i] and not seen[i]:
                seen[i] = 1
                missing -= 1
        if missing > 0:
            t -= 1
    return t
