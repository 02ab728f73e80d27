"""Rates to spikes by accumulation, the decoder of `best` mode.

    a <- a + rate_t;  fire and a <- a - 1 where a >= 1          rate in [0, 1] spikes/frame, one bit a frame

The spike count of any stretch is the sum of its rates to within one spike: no bias at any rate, and as little
quantisation as a stream of spikes can have.  It is the ideal pixel, exposed to the denoised light.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from denoiser.decoders.phase import starting_phase
from spikecam_env.compiled import njit


class AccumulateState(NamedTuple):
    """The decoder's state."""

    charge: NDArray[np.float64]
    """(H, W) in [0, 1), the charge that each pixel carries into the next frame."""


def start(shape: tuple[int, int]) -> AccumulateState:
    """Before frame 0."""
    return AccumulateState(starting_phase(shape))


def step(rates: NDArray[np.float32], state: AccumulateState) -> tuple[NDArray[np.uint8], AccumulateState]:
    """(K, H, W) rates [spikes/frame], cut to [0, 1] -> (K, H, W) spikes and the state after them."""
    charge = state.charge.copy()
    spikes = np.empty(rates.shape, np.uint8)
    _accumulate(rates, charge, spikes)
    return spikes, AccumulateState(charge)


@njit(cache=True, nogil=True)
def _accumulate(rates: NDArray[np.float32], charge: NDArray[np.float64], spikes: NDArray[np.uint8]) -> None:
    count, height, width = rates.shape
    for t in range(count):
        for y in range(height):
            for x in range(width):
                charge[y, x] += min(max(np.float64(rates[t, y, x]), 0.0), 1.0)
                fires = charge[y, x] >= 1.0
                if fires:
                    charge[y, x] -= 1.0
                spikes[t, y, x] = fires
