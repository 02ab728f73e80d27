"""Intervals to spikes without an update, which the paper's ablation has in place of its multi-stage update (MUS).

At a spike the pixel takes the interval predicted for that instant, and keeps it to its end,

    end = t0 + ISI_t0

whatever later planes say.  Ends are real numbers and rates are cut as in `mus.py`, so that the two differ by the
update alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from denoiser.decoders.mus import SLOWEST, MusState, start

__all__ = ["start", "step"]


def step(inverse_intervals: NDArray[np.float32], state: MusState) -> tuple[NDArray[np.uint8], MusState]:
    """(K, H, W) 1/ISI planes -> (K, H, W) spikes and the state after them; `state` as of `denoiser.decoders.mus`."""
    intervals = 1.0 / np.clip(inverse_intervals.astype(np.float64), SLOWEST, 1.0)
    wait = state.wait
    if not state.started and len(intervals):
        wait = wait * intervals[0] - 1.0
    spikes = np.empty(inverse_intervals.shape, np.uint8)
    for fired, interval in zip(spikes, intervals, strict=True):
        fired[:] = wait <= 0.0
        wait = wait + interval * fired - 1.0
    return spikes, MusState(wait, state.started or len(intervals) > 0)
