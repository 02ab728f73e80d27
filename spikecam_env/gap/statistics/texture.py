"""The variation of rates over the array and over pixels, of one map: fine grain, shading, quantiles.

Reveals vignetting (fields, smooth), spreads (fine), dark_current_tail and hot_pixels (quantiles), row_fixed_pattern and
column_fixed_pattern (lags along one axis and not the other).
"""

from __future__ import annotations

import numpy as np
import scipy

from spikecam_env.gap.statistics.reading import log
from spikecam_env.robust import LOWER, UPPER, scatter
from spikecam_env.types import Floats

QUANTILES = (0.001, 0.01, 0.1, 0.25, 0.75, 0.9, 0.99, 0.999)
"""Of the rates, over their median."""

DISTANCES = (2, 8, 32)
"""Of two pixels whose correlation is taken [pixels]."""

FIELDS_A_SIDE = 3
"""Fields along each side of the array."""

_WINDOW = 5
"""Side of a pixel's neighbourhood [pixels]."""


def statistics(rate: Floats) -> dict[str, float]:
    """Statistics of a rate map (H, W); nothing where its median is 0.

    Returns:
        fine: log spread of pixels about the mean of their neighbourhood, outliers clipped.
        grain q: quantiles of the same, in its spreads.
        smooth: log spread of the neighbourhoods.
        field r c: relative mean of a ninth of the array.
        across n, down n: correlation of pixels n apart.
        q: log quantiles over the median, of maps without negative rates.
    """
    middle = float(np.median(rate))
    if middle <= 0:
        return {}
    relative = rate / middle - 1.0
    lower, upper = np.quantile(relative, [LOWER, UPPER])
    clipped = np.clip(relative, 3 * lower - 2 * upper, 3 * upper - 2 * lower)
    around = scipy.ndimage.uniform_filter(clipped, _WINDOW, mode="nearest")
    grain = relative - around
    width = max(scatter(grain), 1e-9)
    values = {"fine": log(width), "smooth": log(float(around.std()))}
    for q in (0.001, 0.01, 0.99, 0.999):
        values[f"grain {q:g}"] = log(abs(float(np.quantile(grain, q))) / width)
    inside = np.clip(relative, -6 * width, 6 * width)
    inside = inside - inside.mean()
    for r, rows in enumerate(np.array_split(inside, FIELDS_A_SIDE)):
        for c, part in enumerate(np.array_split(rows, FIELDS_A_SIDE, axis=1)):
            values[f"field {r} {c}"] = float(part.mean())
    variance = max(float(np.mean(inside**2)), 1e-18)
    for n in DISTANCES:
        if min(rate.shape) > 2 * n:
            values[f"across {n}"] = float((inside[:, n:] * inside[:, :-n]).mean()) / variance
            values[f"down {n}"] = float((inside[n:] * inside[:-n]).mean()) / variance
    least = 0.02 * middle
    for q, value in zip(QUANTILES, np.quantile(rate, QUANTILES), strict=True):
        values[f"q {q:g}"] = log(max(float(value), least) / middle)
    return values
