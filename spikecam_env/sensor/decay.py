"""The exponential of a decay in multiplications alone, so that numpy and a compiled loop give the same bits, and the
loop takes many pixels at once: no two libraries' exp agree in the last bit, and one call a spike costs more than it."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

LONG = 40.0
"""Time constants after which nothing is left, in double precision beside 1."""

Number = TypeVar("Number", float, NDArray[np.float64])

_HALVINGS = 8
_TERMS = tuple(1.0 / n for n in range(11, 0, -1))


def decayed(x: Number) -> Number:
    """exp(-x), for 0 <= x <= LONG, to 1e-13: a power series at x / 256, squared eight times."""
    y = x * (-1.0 / (1 << _HALVINGS))
    series = y * 0.0 + 1.0
    for term in _TERMS:
        series = series * y * term + 1.0
    for _ in range(_HALVINGS):
        series = series * series
    return series
