"""Which recordings are lent to the search where those held out alone disagree."""

from __future__ import annotations

from dataclasses import replace

from small import null, recorded

from spikecam_env.gap.baseline.alarm import lent, rings
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.fit.problem import values_to_fit


def test_steady_light_held_out_is_not_lent_since_the_unit_would_be_another():
    case = recorded()
    assert [c.use for c in case.conditions if c.use == "holdout"] == ["holdout"]
    assert lent(case) is case


def test_what_moves_is_lent_and_nothing_else():
    case = recorded()
    held = replace(case, conditions=tuple(replace(c, use="holdout") if c.moves else c for c in case.conditions))
    assert [c.use for c in lent(held).conditions] == [c.use for c in case.conditions]


def test_the_alarm_hears_only_what_it_is_given():
    case, there = recorded(), null()
    values = values_of(case.bank, there.keys)
    assert not rings(there, values)
    values[~case.to_fit(there.keys)] += 20 * there.noise[~case.to_fit(there.keys)]
    assert rings(there, values) and not rings(there, values_to_fit(case, there, values))
