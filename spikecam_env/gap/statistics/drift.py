"""Slow change within a recording of steady light, of the array and of single pixels.

Reveals lamp_drift, dark_current_drift, random_telegraph_noise, threshold_flicker_noise, and effects that begin later.
"""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.observe.conditions import STEADY
from spikecam_env.gap.observe.observation import TIME_BLOCKS, ObservedRecording
from spikecam_env.gap.statistics.reading import CampaignReading, log, slope

PARTS, PIECES = 8, 8
"""Equal parts of a dark recording whose intervals are compared, and pieces of each by which its scatter is measured."""

LEAST_INTERVALS = 100
"""Intervals, at least, in a part whose mean is taken."""

CONSTANCY = 1e-4
"""Relative change of intervals' mean length during a recording, up to which all but the dark current is known to be
constant: the floor of `late`."""

SCATTER = 2e-4
"""Relative standard error of the median part's mean, from which lateness is stated in units of that error."""


def statistics(reading: CampaignReading, i: int) -> dict[str, float]:
    """Statistics of slow change.

    Returns:
        trend: relative change of the array from start to end.
        bend: half against half, curvature.
        wander: log variance of the rest.
        pixels: log variance of blocks within a pixel, about the mean of all.
        pixel tail: that of the one pixel in 50 that varies most, over the mean.
        late 0 .. 7: `lateness`, in the dark.
    """
    if reading.conditions[i].kind not in STEADY:
        return {}
    o = reading.observations[i]
    blocks = o.blocks[:-1] if o.frames % TIME_BLOCKS else o.blocks
    total = blocks[:, reading.base.live].sum(axis=1).astype(np.float64)
    if total.sum() < 500:
        return {}
    relative = total / total.mean() - 1.0
    t = np.linspace(-1.0, 1.0, len(total))
    values = {"trend": slope(relative, t), "bend": slope(relative, t**2)}
    left = relative - values["trend"] * t - values["bend"] * (t**2 - np.mean(t**2))
    values["wander"] = log(float(np.mean(left**2)), 1e-14)
    own = blocks[:, reading.base.live].astype(np.float64)
    common = own.mean(axis=0) * (1.0 + relative[:, None])  # without it, a lamp that drifts would count twice
    variance = np.mean((own - common) ** 2, axis=0)
    values["pixels"] = log(float(variance.mean()), 1e-6)
    most = np.sort(variance)[-max(variance.size // 50, 1) :].mean()  # counts are whole: a quantile of them would jump
    values["pixel tail"] = log(float(most / max(variance.mean(), 1e-6)), 1e-6)
    return values | (lateness(o) if reading.conditions[i].kind == "dark" else {})


def lateness(o: ObservedRecording) -> dict[str, float]:
    """Relative excess of the intervals that end in each part of a recording over each pixel's own mean.

    In the dark pixels fire seldom but evenly: a slow change shows far better in the length of intervals than in their
    number.  Where noise of whole frames or ripple makes the pieces of a part scatter, lateness is divided by that.

    Args:
        o: the recording.
    """
    usual = o.frames * o.shape[0] * o.shape[1] / max(int(o.frame.sum()), 1)
    begins = np.arange(PARTS * PIECES) * o.frames // (PARTS * PIECES)
    late, timed = (np.add.reduceat(a, begins).reshape(PARTS, PIECES) for a in (o.late / usual, o.timed))
    count = timed.sum(axis=1)
    known = np.flatnonzero(count >= LEAST_INTERVALS)
    mean = late.sum(axis=1) / np.maximum(count, 1)
    own2 = np.sum((late - mean[:, None] * timed) ** 2, axis=1)[known] / count[known] ** 2
    unit = np.sqrt(1.0 + np.median(own2) / SCATTER**2) if known.size else 1.0
    return {f"late {i}": float(mean[i] / unit) for i in known}
