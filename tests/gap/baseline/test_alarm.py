"""The alarm, and the recordings that are fitted where held-out motion alone disagrees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from small import null, recorded

from spikecam_env.gap.baseline.alarm import is_discrepant, with_held_out_motion
from spikecam_env.gap.compare.prediction import Null, values_of
from spikecam_env.gap.fit.problem import values_to_fit
from spikecam_env.gap.statistics import StatisticKey


def test_steady_light_held_out_is_not_fitted_since_the_unit_would_be_another():
    case = recorded()
    assert [c.use for c in case.conditions if c.use == "holdout"] == ["holdout"]
    assert with_held_out_motion(case) is case


def test_held_out_motion_is_fitted_and_nothing_else():
    case = recorded()
    held = replace(case, conditions=tuple(replace(c, use="holdout") if c.moves else c for c in case.conditions))
    assert [c.use for c in with_held_out_motion(held).conditions] == [c.use for c in case.conditions]


def test_the_alarm_depends_on_the_statistics_that_it_is_given_alone():
    case, there = recorded(), null()
    values = values_of(case.bank, there.keys)
    assert not is_discrepant(there, values)
    values[~case.to_fit(there.keys)] += 20 * there.noise[~case.to_fit(there.keys)]
    assert is_discrepant(there, values) and not is_discrepant(there, values_to_fit(case, there, values))


@pytest.mark.parametrize("p, alarm", [(0.012, True), (0.033, False)])
def test_one_campaign_in_fifty_gives_a_false_alarm(p, alarm):
    """Of one statistic whose noise is known, at the normal deviate of a two-sided p."""
    one = Null((StatisticKey("rates", "flat", "level"),), np.zeros(1), np.ones(1), np.zeros(1), 1e9, 1e9)
    assert is_discrepant(one, np.array([stats.norm.isf(p / 2)])) == alarm
