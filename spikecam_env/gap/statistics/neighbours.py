"""Neighbours that fire together, or one after the other.  Reveals crosstalk and noise that pixels share."""

from __future__ import annotations

from spikecam_env.gap.observe.conditions import STEADY
from spikecam_env.gap.observe.observation import FRAME_LAGS
from spikecam_env.gap.statistics.reading import CampaignReading


def statistics(reading: CampaignReading, i: int) -> dict[str, float]:
    """across n, down n: coincidences at a lag of n frames over those of independent phases, less one."""
    if reading.conditions[i].kind not in STEADY:
        return {}
    o = reading.observations[i]
    rate = (o.times.count / o.frames).reshape(o.shape)
    values = {}
    for axis, name in enumerate(("across", "down")):
        chance = float((rate[:, 1:] * rate[:, :-1]).sum() if axis == 0 else (rate[1:] * rate[:-1]).sum())
        for lag in range(FRAME_LAGS):
            expected = 2.0 * chance * (o.frames - lag)
            if expected > 200:
                values[f"{name} {lag}"] = float(o.coincidences[lag, axis] / expected - 1.0)
    return values
