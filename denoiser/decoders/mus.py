"""Intervals to spikes by the multi-stage update strategy (MUS), paper (23), the decoder of `paper` mode.

From a spike at t0 the predicted end of its interval is t0 + ISI_t0.  Each later plane predicts another end; the
interval ends at the running minimum,

    end = min over t0 <= t < end of (t + ISI_t)

so one predicted end a pixel suffices.  Lower it as planes arrive, fire in the first frame that it does not exceed, and
start again from it.  Ends are real numbers, and the fraction is carried into the next interval: ends rounded to a frame
would make bright pixels 22 to 29 % too fast or slow.  A spike at time t0 falls into frame ceil(t0), whose plane gives
its first predicted end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from denoiser.decoders.phase import starting_phase
from spikecam_env.compiled import njit

SLOWEST = 1e-4
"""Least rate that is believed [spikes/frame]; the greatest is 1, one spike a frame."""


class MusState(NamedTuple):
    """The decoder's state."""

    wait: NDArray[np.float64]
    """(H, W) time from the next frame to the predicted end [frames]; before frame 0 the share of the first interval
    that is still to come, in (0, 1]."""
    started: bool
    """False before frame 0."""


def start(shape: tuple[int, int]) -> MusState:
    """Before frame 0."""
    return MusState(1.0 - starting_phase(shape), False)


def step(inverse_intervals: NDArray[np.float32], state: MusState) -> tuple[NDArray[np.uint8], MusState]:
    """(K, H, W) 1/ISI planes, cut to [SLOWEST, 1] -> (K, H, W) spikes and the state after them."""
    wait = state.wait.copy()
    if not state.started and len(inverse_intervals):  # the spike before frame 0 is at -1 - (share over) * ISI_0
        wait = wait / np.clip(inverse_intervals[0].astype(np.float64), SLOWEST, 1.0) - 1.0
    spikes = np.empty(inverse_intervals.shape, np.uint8)
    _update(inverse_intervals, wait, spikes)
    return spikes, MusState(wait, state.started or len(inverse_intervals) > 0)


@njit(cache=True, nogil=True)
def _update(inverse_intervals: NDArray[np.float32], wait: NDArray[np.float64], spikes: NDArray[np.uint8]) -> None:
    count, height, width = spikes.shape
    for t in range(count):
        for y in range(height):
            for x in range(width):
                interval = 1.0 / min(max(np.float64(inverse_intervals[t, y, x]), SLOWEST), 1.0)
                end = wait[y, x]
                fires = end <= 0.0
                spikes[t, y, x] = fires
                wait[y, x] = (end + interval if fires else min(end, interval)) - 1.0
