"""The fixed pattern of a recording's rates: how wide, how lopsided, how smooth, along rows and columns.

Reveals hot_pixels, dark_current_tail, dead_pixels, row_fixed_pattern, column_fixed_pattern, vignetting.
Compared with fresh units drawn from the model, not with the twin, whose pattern is the measured one.
"""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.statistics.reading import log, root, slope
from spikecam_env.robust import LOWER, UPPER
from spikecam_env.types import Floats

NARROW = 5e-4
"""Relative spread below which a map has no pattern: the error of rates read between whole frames."""

OUTLYING = (5, 10, 20, 40)
"""Spreads above the median beyond which pixels are counted; of a Gaussian one in 3 million lies beyond 5."""

PATCHES_A_SIDE = 8
"""Patches along each side of the array."""


def statistics(rate: Floats) -> dict[str, float]:
    """Statistics of a rate map (H, W); of a NARROW map only that width, and `silent`.

    Returns:
        width: log of the robust relative spread.
        low tail, high tail: distance of the 0.5 % and 99.5 % quantiles from the median, in spreads; high as a log.
        top: log of the largest, in spreads.
        over 5, 10, 20, 40: pixels so many spreads above the median, counted.
        silent: pixels below a tenth of the median, counted.
        rows, columns: log variance of their means over a pixel's.
        bowl, across, down: radial slope and gradients.
        near: correlation of neighbours.
        patch: log of the mean of a patch of pixels that is furthest off, in its standard errors.
    """
    flat = rate.reshape(-1)
    middle = float(np.median(flat))
    if middle <= 0:
        return {}
    relative = rate / middle - 1.0
    low, lower, upper, high = np.quantile(relative, [0.005, LOWER, UPPER, 0.995])
    width = max((upper - lower) / 2, 1e-9)
    silent = root(float((flat < 0.1 * middle).sum()))
    if width < NARROW:
        return {"width": log(NARROW), "silent": silent}
    inside = np.clip(relative, -4 * width, 4 * width)
    rows, columns = rate.shape
    y, x = np.mgrid[:rows, :columns] - np.array([(rows - 1) / 2, (columns - 1) / 2])[:, None, None]
    radius = (y**2 + x**2) / (y**2 + x**2).max()
    smooth = inside - inside.mean()
    variance = max(float(np.mean(smooth**2)), 1e-18)
    across = (smooth[:, 1:] * smooth[:, :-1]).mean() / variance
    down = (smooth[1:] * smooth[:-1]).mean() / variance
    return {
        "width": log(width),
        "lopsided": float((upper + lower) / width),
        "low tail": float(-low / width),
        "high tail": log(max(high / width, 0.1)),
        "top": log(max(float(relative.max()) / width, 0.1)),
        **{f"over {n}": root(float((relative > n * width).sum())) for n in OUTLYING},
        "silent": silent,
        "rows": log(float(inside.mean(axis=1).var()) / variance * columns),
        "columns": log(float(inside.mean(axis=0).var()) / variance * rows),
        "bowl": slope(inside.reshape(-1), radius.reshape(-1)) / width,
        "across": slope(inside.reshape(-1), x.reshape(-1)) * columns / width,
        "down": slope(inside.reshape(-1), y.reshape(-1)) * rows / width,
        "near": float((across + down) / 2),
        "patch": log(max(_furthest_patch(inside) / width, 0.1)),
    }


def _furthest_patch(values: Floats) -> float:
    """The patch mean that is furthest from the median of patch means, times the root of a patch's pixels."""
    high, wide = (max(n // PATCHES_A_SIDE, 1) for n in values.shape)
    rows, columns = values.shape[0] // high, values.shape[1] // wide
    means = values[: rows * high, : columns * wide].reshape(rows, high, columns, wide).mean(axis=(1, 3))
    return float(np.abs(means - np.median(means)).max() * np.sqrt(high * wide))
