"""The null model: how many twins each statistic is learnt from, and the freedom of its noise."""

from __future__ import annotations

import numpy as np
from small import TWINS, null

from spikecam_env.gap.baseline.null_model import with_more_twins
from spikecam_env.gap.compare.prediction import Draw, Null
from spikecam_env.gap.statistics import StatisticKey


def test_recordings_in_motion_have_twice_as_many_twins_and_the_pattern_has_drawn_units():
    there = null()
    moving = np.array([k.recording in ("step", "bars") for k in there.keys])
    pattern = np.array([k.group == "pattern" for k in there.keys])
    assert moving.any() and pattern.any()
    assert set(there.twins[moving]) == {2 * TWINS} and set(there.freedom[moving]) == {2 * TWINS - 1}
    assert set(there.twins[pattern]) == {24} and set(there.freedom[pattern]) == {23}
    assert set(there.twins[~moving & ~pattern]) == {TWINS} and there.freedom[~moving & ~pattern].min() >= TWINS - 1
    assert len(there.draws) == TWINS


def test_more_campaigns_tell_mean_and_noise_of_what_they_have():
    both, one = StatisticKey("moving", "bars", "delay"), StatisticKey("rates", "flat", "level")
    values = np.random.default_rng(0).standard_normal((36, 2))
    draws = tuple(Draw(n, v, None) for n, v in enumerate(values[:12]))
    few = Null((both, one), values[:12].mean(axis=0), values[:12].std(axis=0, ddof=1), np.zeros(2), 12, 11, draws=draws)
    more = with_more_twins(few, [{both: v[0]} for v in values[12:]])
    assert np.allclose(more.mean, [values[:, 0].mean(), few.mean[1]])
    assert np.allclose(more.sd, [values[:, 0].std(ddof=1), few.sd[1]])
    assert list(more.twins) == [36, 12] and list(more.freedom) == [35, 11]
