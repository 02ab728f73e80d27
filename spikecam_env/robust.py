"""How far values scatter, whatever a few of them do."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

LOWER, UPPER = 0.1587, 0.8413
"""Quantiles of a Gaussian a standard deviation to either side of its mean."""


def scatter(values: NDArray[Any]) -> float:
    """Robust standard deviation of values of any shape and unit: half of the middle 68 %."""
    low, high = np.quantile(values, [LOWER, UPPER])
    return float(high - low) / 2
