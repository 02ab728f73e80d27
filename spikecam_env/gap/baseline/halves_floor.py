"""The floor of the gap: by how much two halves of the measurement differ, on the scale that the gap is stated on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from spikecam_env.campaign.reading import CampaignRecording
from spikecam_env.gap.compare.prediction import Null, values_of
from spikecam_env.gap.observe.conditions import Shown
from spikecam_env.gap.observe.observation import Observation, observe
from spikecam_env.gap.statistics import Key, bank
from spikecam_env.gap.statistics.reading import Reading
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.unit.refit import BaseFit

LEAST_FRAMES = 1000
"""Shortest recording that is divided."""


def floor_of_halves(case: Case, recordings: Sequence[CampaignRecording], null: Null) -> float:
    """Mean of (first - second half)^2 / 4 noise^2 over the statistics that the gap is the mean of.

    A statistic of n frames has a variance in 1/n, so two halves differ by four times the whole's.  What halves cannot
    tell is by how much twins differ: motion, of which each half shows other places, and the pattern, which the gap
    compares with that of fresh units and halves share.  NaN where no steady recording is long enough.
    """
    held = case.held_out(null.keys)
    names = {k.recording for k, there in zip(null.keys, held, strict=True) if there}
    still = [
        (c, r)
        for c in case.conditions
        for r in recordings
        if r.name == c.name and c.name in names and c.kind in ("dark", "flat") and c.frames >= LEAST_FRAMES
    ]
    if not still:
        return float("nan")
    first: dict[Key, float] = {}
    second: dict[Key, float] = {}
    for c, r in still:
        bits, half = r.packed(), c.frames // 2
        for found, part in ((first, bits[:half]), (second, bits[half : 2 * half])):
            found.update(_bank(case.base, replace(c, frames=half), observe(part, case.shape)))
    halves = (values_of(first, null.keys) - values_of(second, null.keys)) / 2.0
    twins2 = null.noise**2 - null.floor**2
    return float(np.mean((np.where(np.isfinite(halves), halves**2, twins2) / null.noise**2)[held]))


def _bank(base: BaseFit, condition: Shown, seen: Observation) -> dict[Key, float]:
    expected = base.gain * condition.picture + base.dark
    residual = np.where(expected > 0, seen.rate / np.where(expected > 0, expected, 1.0) - 1.0, np.nan)
    own = replace(base, residual=residual[None])
    return bank(Reading([seen], [condition], own, {}))
