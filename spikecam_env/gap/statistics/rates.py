"""Rates against the straight line gain L + dark that each pixel has through all fit levels.

Reveals a bent response (dead_time, comparator_delay, photo_response_nonlinearity, incomplete_reset, ir_drop), labels
that are wrong, and responses that hold only in a part of the array.
"""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.observe.conditions import STEADY_KNOWN
from spikecam_env.gap.statistics.reading import CampaignReading, log, slope


def statistics(reading: CampaignReading, i: int) -> dict[str, float]:
    """Statistics of the residuals.

    Returns:
        level: mean relative residual.
        slope: of the residual on the pixel's own rate.
        scatter: log rms.
        top-left corner, ...: mean residual of a quarter of the array less the array's.
    """
    condition = reading.conditions[i]
    if condition.kind not in STEADY_KNOWN:
        return {}
    order = [j for j, c in enumerate(reading.conditions) if c.kind in STEADY_KNOWN].index(i)
    residual = reading.base.residual[order]
    known = np.isfinite(residual) & reading.base.live
    if known.sum() < 100:
        return {}
    r = np.clip(residual[known], *np.quantile(residual[known], [0.005, 0.995]))
    values = {"level": float(r.mean())}
    x = reading.expected(i)[known]
    if condition.kind != "dark":
        values["slope"] = slope(r, x / x.mean())
        values["scatter"] = log(float(np.sqrt(np.mean((r - r.mean()) ** 2))))
        rows, columns = reading.observations[i].shape
        half = (np.arange(rows) >= rows // 2)[:, None] * 2 + (np.arange(columns) >= columns // 2)[None, :]
        quarter = half.reshape(-1)[known]
        for q, name in enumerate(("top-left", "top-right", "bottom-left", "bottom-right")):
            if np.any(quarter == q):
                values[f"{name} corner"] = float(r[quarter == q].mean() - r.mean())
    return values
