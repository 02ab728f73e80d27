"""Noise of intervals: their variance, their serial correlation, and A_k, against the laws of a charge-conserving pixel.

Reveals noise of every colour (excess_threshold_noise, frame_threshold_noise, threshold_flicker_noise,
random_telegraph_noise) and resets that lose or keep charge (synchronous_reset).
"""

from __future__ import annotations

import numpy as np

from spikecam_env.calibration.jitter import second_difference
from spikecam_env.gap.observe.conditions import STEADY
from spikecam_env.gap.observe.observation import DIFFERENCES
from spikecam_env.gap.statistics.reading import CampaignReading, log


def statistics(reading: CampaignReading, i: int) -> dict[str, float]:
    """Noise of pixels without irregular intervals: single events are counted as such (`intervals`), and are no noise.

    Returns:
        variance: mean over pixels of interval variance less f(1-f), over T.
        lag-1: pooled serial correlation.
        A_k: measured over expected from the refitted jitter, less one.
        tail: log of the 99 % quantile of A_16 over its median.
    """
    if reading.conditions[i].kind not in STEADY:
        return {}
    o = reading.observations[i]
    rate = o.times.rate
    interval = 1.0 / np.where(rate > 0, rate, np.nan)
    good = (o.times.count > 8) & reading.base.live & np.isfinite(o.variance) & (rate < 0.95) & ~o.irregular
    if good.sum() < 100:
        return {}
    fraction = interval % 1.0
    excess = (o.variance - fraction * (1.0 - fraction))[good]
    values = {
        "variance": float(
            np.mean(np.clip(excess / interval[good], *np.quantile(excess / interval[good], [0.01, 0.99])))
        ),
        "lag-1": float(o.covariance[good].sum() / max(o.variance[good].sum(), 1e-12)),
    }
    white = reading.base.white
    for j, k in enumerate(DIFFERENCES):
        terms = np.where(good, o.times.terms[:, j], 0)
        if terms.sum() < 2000:
            continue
        with_terms = terms > 0
        law = second_difference(np.array(k), interval[with_terms], white)
        ratio = o.times.square[with_terms, j] / (terms[with_terms] * law)
        weight = np.minimum(terms[with_terms], 200)
        top = np.quantile(ratio, 0.995)
        values[f"A_{k}"] = float((weight * np.minimum(ratio, top)).sum() / weight.sum() - 1.0)
        if k == 16:
            values["tail"] = log(float(np.quantile(ratio, 0.99) / max(np.median(ratio), 1e-6)))
    return values
