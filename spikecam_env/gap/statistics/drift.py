"""Slow change within a recording of steady light, of the array and of single pixels.

Reveals lamp_drift, dark_current_drift, random_telegraph_noise, threshold_flicker_noise, and effects that begin later.
"""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.observe import BLOCKS
from spikecam_env.gap.statistics.reading import STILL, Reading, log, slope


def statistics(reading: Reading, i: int) -> dict[str, float]:
    """trend: relative change of the array from start to end.  bend: half against half, curvature.  wander: log
    variance of what is left.  pixels: log variance of blocks within a pixel, over x.  pixel tail: of the
    one pixel in 50 that varies most, by mean."""
    if reading.conditions[i].kind not in STILL:
        return {}
    o = reading.observations[i]
    blocks = o.blocks[:-1] if o.frames % BLOCKS else o.blocks
    total = blocks[:, reading.base.live].sum(axis=1).astype(np.float64)
    if total.sum() < 500:
        return {}
    relative = total / total.mean() - 1.0
    t = np.linspace(-1.0, 1.0, len(total))
    found = {"trend": slope(relative, t), "bend": slope(relative, t**2)}
    left = relative - found["trend"] * t - found["bend"] * (t**2 - np.mean(t**2))
    found["wander"] = log(float(np.mean(left**2)), 1e-14)
    own = blocks[:, reading.base.live].astype(np.float64)
    variance = own.var(axis=0)
    found["pixels"] = log(float(variance.mean()), 1e-6)
    most = np.sort(variance)[-max(variance.size // 50, 1) :].mean()  # counts are whole: a quantile of them would jump
    found["pixel tail"] = log(float(most / max(variance.mean(), 1e-6)), 1e-6)
    return found
