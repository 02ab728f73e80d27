"""Keys: when they lie, and how they are painted.  They are pictures of their own, so several threads paint at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.protocol import Gaze
from spikecam_env.checked import checked_memory, checked_whole
from spikecam_env.errors import InputError
from spikecam_env.sensor import Keyframes
from spikecam_env.threads import as_many, share_out
from spikecam_env.types import Floats, Pictures

AT_REST = Gaze.fixed(0.0, 0.0)
"""The camera where no gaze is given."""

LONGEST_INTERVAL = 64
"""Frames between two keys, at most."""

_WORTH_A_THREAD = 4
"""Keys below which another thread costs more than it saves."""


def interval_for(speed: float, motion_per_key: float) -> int:
    """Whole frames from key to key: the fastest point, at speed [pixels/frame], moves at most motion_per_key [pixels].

    Returns:
        1 to LONGEST_INTERVAL: a faster point moves further than that from frame to frame.
    """
    return int(min(max(motion_per_key / max(speed, 1e-9) + 1e-9, 1), LONGEST_INTERVAL))


def key_frames(shape: tuple[int, int], start: int, stop: int, interval: int, gaze: Gaze | None) -> Floats:
    """Frames (K,) of the keys that cover [start, stop].

    Without gaze they are multiples of the interval; with gaze there are keys at `start` and `stop` too, where the
    camera's path may bend.

    Raises:
        InputError: start is not before stop, or the pictures do not fit in memory.
    """
    checked_whole(start, "start")
    checked_whole(stop, "stop")
    check_frames(start, stop)
    keys = (stop - start) // interval + 2
    checked_memory(4 * keys * shape[0] * shape[1], f"light of frames {start} to {stop}, {keys} keys,")
    if gaze is None:
        return (np.arange(start // interval, -(-stop // interval) + 1) * interval).astype(np.float64)
    inner = range((start // interval + 1) * interval, stop, interval)
    return np.array([start, *inner, stop], np.float64)


def check_frames(start: int, stop: int) -> None:
    """Refuse an empty range of frames."""
    if not start < stop:
        raise InputError(f"frames run from {start} to {stop}; the first must be before the second")


def paint_keys(shape: tuple[int, int], frame: NDArray[Any], paint: Callable[[float, Pictures], None]) -> Keyframes:
    """Keys at these frames (K,), rising, painted side by side by paint(frame, picture (H, W))."""
    light = np.empty((len(frame), *shape), np.float32)
    side_by_side(lambda key: paint(float(frame[key]), light[key]), len(frame))
    return Keyframes.known(frame.astype(np.float64), light)


def side_by_side(paint: Callable[[int], None], keys: int, threads: int | None = None) -> None:
    """Call paint(0) ... paint(keys - 1) in any order, on threads as `threads_for` counts them."""
    share_out(paint, keys, threads_for(keys, threads))


def threads_for(keys: int, threads: int | None = None) -> int:
    """Threads that pay to paint so many keys; default NUMBA_NUM_THREADS at most."""
    return as_many(threads, keys // _WORTH_A_THREAD)
