"""Which recordings are lent to the search where those held out alone disagree."""

from __future__ import annotations

from dataclasses import replace

from small import null, recorded

from spikecam_env.gap.baseline.alarm import is_discrepant, with_held_out_motion
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.search.forward import of_fit


def test_steady_light_held_out_is_not_lent_since_the_unit_would_be_another():
    case = recorded()
    assert [c.use for c in case.conditions if c.use == "holdout"] == ["holdout"]
    assert with_held_out_motion(case) is case


def test_what_moves_is_lent_and_nothing_else():
    case = recorded()
    held = replace(case, conditions=tuple(replace(c, use="holdout") if c.moves else c for c in case.conditions))
    assert [c.use for c in with_held_out_motion(held).conditions] == [c.use for c in case.conditions]


def test_the_alarm_hears_only_what_it_is_given():
    case, there = recorded(), null()
    values = values_of(case.bank, there.keys)
    assert not is_discrepant(there, values)
    values[~case.to_fit(there.keys)] += 20 * there.noise[~case.to_fit(there.keys)]
    assert is_discrepant(there, values) and not is_discrepant(there, of_fit(case, there, values))
