"""The bank as a whole: statistics where nothing is missing, and their floors."""

from __future__ import annotations

import pytest
from small import null, quiet, recorded, seen, summary

from spikecam_env.gap.statistics import GROUPS, StatisticKey, floor_of


@pytest.mark.parametrize("seed", [5, 6, 7])
def test_no_group_alarms_where_nothing_is_missing(seed):
    z = seen(recorded(seed=seed))
    print(summary(z))
    worst = max(z, key=lambda k: abs(z[k]))
    assert abs(z[worst]) < quiet(len(z)), worst


def test_every_group_says_something_of_the_small_design():
    """But for `clock`, which is of unknown scenes (test_unknown_scene.py)."""
    assert {k.group for k in null().keys} == {*GROUPS, "pattern"} - {"clock"}


def test_names_are_given_once():
    assert len(set(null().keys)) == len(null().keys)


def test_floor_is_that_of_the_longest_name_that_fits():
    assert floor_of(StatisticKey("noise", "flat", "A_16")) == 0.01
    assert floor_of(StatisticKey("drift", "flat", "pixel tail")) == 0.02
    assert floor_of(StatisticKey("drift", "flat", "trend")) == 2e-5
    assert floor_of(StatisticKey("rates", "flat", "scatter")) == 0.05
    assert floor_of(StatisticKey("rates", "flat", "level")) == 2e-5
    assert floor_of(StatisticKey("another", "flat", "level")) == 0.0
