"""Candidates that are fitted, by the misfit of their templates."""

from __future__ import annotations

import numpy as np
import pytest

from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.screen.screen import Screened
from spikecam_env.gap.search.shortlist import groups_that_stand_out, starts_to_fit
from spikecam_env.gap.settings import Searching
from spikecam_env.gap.statistics import StatisticKey

NAMES = ("dead_time", "ir_drop", "crosstalk", "readout_skew", "optical_blur", "missed_spikes", "comparator_delay")


def screened(misfits) -> list[Screened]:
    return [Screened(name, {}, m, np.zeros(1)) for name, m in zip(NAMES, misfits, strict=True)]


@pytest.mark.parametrize("others, count", [(900.0, 3), (110.0, 5)])
def test_three_are_fitted_at_least_and_five_at_most(others: float, count: int):
    """Of seven, beside the best: six that explain little, or as much."""
    assert len(starts_to_fit(screened([100.0, *[others] * 6]), 1000.0, Searching())) == count


@pytest.mark.parametrize("noises, groups", [(4.0, {"rates"}), (9.0, {"rates", "pattern"})])
def test_a_statistic_stands_out_from_six_noises(noises: float, groups: set[str]):
    keys = (StatisticKey("rates", "r", "slope"), StatisticKey("pattern", "r", "rows"))
    null = Null(keys, np.zeros(2), np.ones(2), np.zeros(2), 12, 11.0)
    assert groups_that_stand_out(null, np.array([20.0, -noises])) == groups
