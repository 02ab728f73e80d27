"""The exponential of a decay in multiplications alone: numpy and a compiled loop then give the same bits.

No two libraries' exp agree in the last bit, and a call a spike costs more than many pixels at once by arithmetic.
"""

from __future__ import annotations

from typing import TypeVar

from spikecam_env.types import Floats

LONG = 40.0
"""Time constants after which nothing is left beside 1 in double precision."""

Number = TypeVar("Number", float, Floats)

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
