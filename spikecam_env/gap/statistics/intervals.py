"""Irregular intervals: much shorter or longer than the pixel's mean, or of one fixed length.

Reveals missed_spikes (doubled intervals), spurious_spikes (cut ones), afterpulsing (one short length).
"""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.observe.conditions import STEADY
from spikecam_env.gap.statistics.reading import CampaignReading, root


def statistics(reading: CampaignReading, i: int) -> dict[str, float]:
    """Counts of irregular intervals.

    Returns:
        short, long: intervals below 0.6 T - 1 and above 1.5 T + 1.
        length n: intervals of n frames, where that is below half the interval of nearly all pixels.
    """
    if reading.conditions[i].kind not in STEADY:
        return {}
    o = reading.observations[i]
    values = {"short": root(o.short[reading.base.live].sum()), "long": root(o.long[reading.base.live].sum())}
    fastest = 1.0 / max(float(np.quantile(reading.expected(i)[reading.base.live], 0.999)), 1e-4)
    for n in (1, 2, 3, 4, 6, 8):
        if n < 0.5 * fastest:
            values[f"length {n}"] = root(float(o.lengths[n - 1]))
    return values
