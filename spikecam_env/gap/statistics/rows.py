"""Noise that rows or columns have in common, in steady light.  Reveals row_temporal_noise, common_threshold_noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.observe.conditions import STEADY
from spikecam_env.gap.statistics.reading import CampaignReading, log


def statistics(reading: CampaignReading, i: int) -> dict[str, float]:
    """row n, column n: log variance in time of a row's (column's) spikes in n frames less the array's share."""
    if reading.conditions[i].kind not in STEADY:
        return {}
    o = reading.observations[i]
    if o.frame.sum() < 500:
        return {}
    values = {}
    for name, lines in (("row", o.row), ("column", o.column)):
        for n in (1, 16):
            values[f"{name} {n}"] = log(_common_variance(lines, n), 1e-9)
    return values


def _common_variance(lines: NDArray[np.int32], frames: int) -> float:
    whole = len(lines) // frames * frames
    counts = lines[:whole].reshape(-1, frames, lines.shape[1]).sum(axis=1) if frames > 1 else lines
    binned = counts.astype(np.float64)
    binned -= binned.mean(axis=0)
    binned -= binned.mean(axis=1, keepdims=True)
    return float(np.mean(np.square(binned, out=binned)))  # in place: fresh memory costs as much as the sums
