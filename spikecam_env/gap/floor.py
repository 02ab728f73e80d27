"""The floor of the gap: by how much two halves of the measurement differ, or two units in their pattern, on the scale
that the gap is stated on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from spikecam_env.calibration.campaign import CampaignRecording
from spikecam_env.gap.case import Case
from spikecam_env.gap.compare import Null, values_of
from spikecam_env.gap.observe import Observation, observe
from spikecam_env.gap.refit import BaseFit
from spikecam_env.gap.statistics import Key, bank
from spikecam_env.gap.statistics.reading import Reading
from spikecam_env.gap.world import Shown

LEAST_FRAMES = 1000
"""Shortest recording that is divided."""


def floor_of_halves(case: Case, recordings: Sequence[CampaignRecording], null: Null) -> float:
    """Mean of (first - second half)^2 / 4 noise^2 over the statistics of held-out steady recordings (of all steady
    ones where none is held out).

    A statistic of n frames has a variance in 1/n, so two halves differ by four times the whole's.  Both are of one
    unit: where the gap has the measured pattern against those of fresh units, the floor is by how much these differ.
    NaN where no recording is long enough.
    """
    still = [
        (c, r)
        for c in case.conditions
        for r in recordings
        if r.name == c.name and c.kind in ("dark", "flat") and c.frames >= LEAST_FRAMES
    ]
    held = [(c, r) for c, r in still if c.use == "holdout"] or still
    if not held:
        return float("nan")
    first: dict[Key, float] = {}
    second: dict[Key, float] = {}
    for c, r in held:
        bits, half = r.packed(), c.frames // 2
        for found, part in ((first, bits[:half]), (second, bits[half : 2 * half])):
            found.update(_bank(case.base, replace(c, frames=half), observe(part, case.shape)))
    keys = [k for k in null.keys if k in first and k in second]
    at = [null.keys.index(k) for k in keys]
    halves = ((values_of(first, keys) - values_of(second, keys)) / 2.0) ** 2
    units = (null.noise**2 - null.floor**2)[at]
    return float(np.mean(np.where([k.group == "pattern" for k in keys], units, halves) / null.noise[at] ** 2))


def _bank(base: BaseFit, condition: Shown, seen: Observation) -> dict[Key, float]:
    expected = base.gain * condition.picture + base.dark
    residual = np.where(expected > 0, seen.rate / np.where(expected > 0, expected, 1.0) - 1.0, np.nan)
    own = replace(base, residual=residual[None])
    return bank(Reading([seen], [condition], own, {}))
