"""How far static pixels whose interval is a whole number of frames follow the read-out's clock.

Free of the clock, as many pixels lie within 0.005 frames of a whole interval as the lengths of their recordings make
look so, and a spike comes a frame late, the next one back on time, as often as early.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_NEAR = 0.005


class Locking(NamedTuple):
    """pixels: within _NEAR of a whole mean interval.

    late, early: of 10 000 of their spikes, those a frame late (early) after which the next is back on time.
    """

    pixels: float
    late: float
    early: float


def clock_locking(spikes: NDArray[np.uint8], rate: NDArray[np.float64]) -> Locking:
    """Of (T, rows, columns) spikes of steady light; rate: (P,) of their pixels, as measured [spikes/frame]."""
    streams = spikes.reshape(len(spikes), -1)
    interval = 1.0 / rate
    near = np.flatnonzero(np.abs(interval - np.round(interval)) < _NEAR)
    total = late = early = 0
    for pixel in near:
        off = np.diff(np.flatnonzero(streams[:, pixel])) - round(float(interval[pixel]))
        total += off.size
        late += int(np.sum((off[:-1] == 1) & (off[1:] == -1)))
        early += int(np.sum((off[:-1] == -1) & (off[1:] == 1)))
    return Locking(float(near.size), 1e4 * late / max(total, 1), 1e4 * early / max(total, 1))
