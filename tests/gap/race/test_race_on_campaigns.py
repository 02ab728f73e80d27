"""The race on small campaigns: a strong pair, and two effects of which neither shows alone."""

from __future__ import annotations

import pytest
from small import MODEL, TWINS, added_by, effect, recorded

from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.race.pairs import BENDS, EDGE, PAIRS
from spikecam_env.gap.race.race import race
from spikecam_env.gap.screen.templates import shipped_templates
from spikecam_env.sensor import CATALOGUE


def found_by_race(*hidden, names):
    case = recorded(*hidden)
    null = model_null(case, MODEL, TWINS)
    rounds = race(Problem.of(case, MODEL, null, values_of(case.bank, null.keys)), names, shipped_templates())
    found = {f.name: f for f in added_by(rounds)}
    print({name: (f.parameters, f.sd) for name, f in found.items()}, case.budget.simulated)
    return found


def test_of_a_strong_pair_both_are_found_and_nothing_else():
    """155 noises and 20."""
    hidden = effect("missed_spikes", probability=0.01), effect("row_temporal_noise", sigma_mV=20.0)
    names = ["missed_spikes", "row_temporal_noise", "dead_time"]
    found = found_by_race(*hidden, names=names)
    assert set(found) == {"missed_spikes", "row_temporal_noise"}
    for there in hidden:
        key = CATALOGUE[there.name].strength
        assert found[there.name].parameters[key] == pytest.approx(there.parameters()[key], rel=0.1)
        assert found[there.name].sd[key] > 0


def test_two_bends_that_cancel_are_found_together():
    tau_us = 2.0
    hidden = effect("dead_time", tau_us=tau_us), effect("photo_response_nonlinearity", beta=-tau_us / 25.0)
    found = found_by_race(*hidden, names=[*BENDS, "comparator_delay"])
    assert set(found) == set(BENDS)
    assert found["dead_time"].parameters["tau_us"] == pytest.approx(tau_us, rel=0.1)
    assert all(sd > 0 for f in found.values() for sd in f.sd.values())


def test_bends_are_started_together_where_one_was_found():
    bends, edge = PAIRS
    assert (bends.names, edge.names) == (BENDS, EDGE)
    assert bends.may_hide(None, ("comparator_delay",)) and bends.may_hide(None, ("crosstalk", "ir_drop"))
    assert not bends.may_hide(None, ()) and not bends.may_hide(None, BENDS)
