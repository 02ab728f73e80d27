"""The floor of the gap: the mean square distance of two halves of the measurement, on the scale of the gap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from spikecam_env.campaign.reading import CampaignRecording
from spikecam_env.gap.compare.prediction import Null, values_of
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import ObservedRecording, observe
from spikecam_env.gap.statistics import StatisticKey, statistics_bank
from spikecam_env.gap.statistics.reading import CampaignReading
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.unit.refit import BaseFit

LEAST_FRAMES = 1000
"""Shortest recording whose halves are compared: at first, pixels of one rate make a line of their own."""


def floor_of_halves(case: Case, recordings: Sequence[CampaignRecording], null: Null) -> float:
    """Mean of (first - second half)^2 / 4 noise^2 over the statistics that the gap is the mean of.

    A statistic of n frames has a variance in 1/n, so the difference of two halves has four times the whole's.  Where
    halves do not show it, the variance is that of twins: in motion, where each half shows other places, and in the
    pattern, which halves share and the gap compares with fresh units.

    Args:
        case: the measurement, refitted.
        recordings: its files.
        null: the null model.

    Returns:
        The floor; NaN where no steady recording is long enough.
    """
    held = case.held_out(null.keys)
    names = {k.recording for k, is_held in zip(null.keys, held, strict=True) if is_held}
    steady = [
        (c, r)
        for c in case.conditions
        for r in recordings
        if r.name == c.name and c.name in names and c.kind in ("dark", "flat") and c.frames >= LEAST_FRAMES
    ]
    if not steady:
        return float("nan")
    first: dict[StatisticKey, float] = {}
    second: dict[StatisticKey, float] = {}
    for c, r in steady:
        bits, half = r.packed(), c.frames // 2
        for bank, part in ((first, bits[:half]), (second, bits[half : 2 * half])):
            bank.update(_half_bank(case.base, replace(c, frames=half), observe(part, case.shape)))
    halves = (values_of(first, null.keys) - values_of(second, null.keys)) / 2.0
    twins2 = null.noise**2 - null.floor**2
    return float(np.mean((np.where(np.isfinite(halves), halves**2, twins2) / null.noise**2)[held]))


def _half_bank(base: BaseFit, condition: Condition, seen: ObservedRecording) -> dict[StatisticKey, float]:
    expected = base.gain * condition.picture + base.dark
    residual = np.where(expected > 0, seen.rate / np.where(expected > 0, expected, 1.0) - 1.0, np.nan)
    own = replace(base, residual=residual[None])
    return statistics_bank(CampaignReading([seen], [condition], own, {}))
