"""Draws without a generator: hashes of (seed, pixel, number) through a polynomial, for compiled loops."""

from __future__ import annotations

from typing import Any

from spikecam_env.compiled import njit
from spikecam_env.sensor.kernels.loop import GOLDEN, bell, first_key, second_key

__all__ = ["GOLDEN", "first_key", "second_key", "standard"]


@njit(inline="always")
def standard(counter: Any, key: Any, c: Any) -> Any:
    """A standardised draw; c: eight float32 coefficients of its law (`quantile`)."""
    x = bell(counter, key)
    return ((((((c[7] * x + c[6]) * x + c[5]) * x + c[4]) * x + c[3]) * x + c[2]) * x + c[1]) * x + c[0]
