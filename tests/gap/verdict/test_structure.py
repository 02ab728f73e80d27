"""The description of an unexplained discrepancy, in numbers."""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.verdict.structure import level_exponent

LEVELS = {"flat-0.1": 0.1, "flat-0.2": 0.2, "flat-0.4": 0.4}


def test_of_statistics_seen_on_as_many_flats_the_first_gives_the_exponent() -> None:
    """Statistic n goes with level^n; any but the first would give another exponent.  Eight, so that an order of chance
    (of a set of names, another in every process) would pass once in eight."""
    names = [f"statistic {n}" for n in range(8)]
    keys = tuple(StatisticKey("rates", flat, name) for name in names for flat in LEVELS)
    ones = np.ones(len(keys))
    null = Null(keys, 0 * ones, ones, 0 * ones, np.inf, 100.0)
    for first in range(8):
        power = {name: (n + first) % 8 for n, name in enumerate(names)}
        off = np.array([1e9 * LEVELS[k.recording] ** power[k.name] for k in keys])
        exponent = level_exponent(null, off, dict.fromkeys(LEVELS, "flat"), LEVELS)
        print(first, exponent)
        assert exponent == first
