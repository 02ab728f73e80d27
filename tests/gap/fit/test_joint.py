"""The last step: all parameters refined together, and the unit with them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from small import MODEL, effect, null, recorded, unit

from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.fit.candidate import fit
from spikecam_env.gap.fit.confirm import confirmed
from spikecam_env.gap.fit.joint import refined_together
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.fit.slopes import NO_SLOPES
from spikecam_env.gap.twins.budget import Budget
from spikecam_env.gap.twins.recent import RecentTwins


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 12])
def test_noise_of_the_unit_is_found_beside_common_noise(seed):
    """3 mV in common take a fifth of the noise that the refit assigns to the unit."""
    name = "common_threshold_noise"
    case = recorded(effect(name, sigma_mV=3.0), seed=seed)
    values = values_of(case.bank, null().keys)
    seen = np.where([case.use(k.recording) == "fit" for k in null().keys], values, np.nan)
    first = fit(Problem(case, MODEL, null(), seen, seen), name, {"sigma_mV": 4.0})
    best, errors, _ = refined_together(Problem(case, MODEL, null(), seen, values), first, [name])
    own, before = best.base.white / unit().white, first.base.white / unit().white
    print(best.parameters, errors, f"s^2 {before:.2f}, then {own:.2f} of the unit's")
    assert own == pytest.approx(1.0, abs=0.1) and abs(own - 1.0) < abs(before - 1.0)
    assert best.parameters["sigma_mV"] == pytest.approx(3.0, abs=3 * errors[name]["sigma_mV"])


def test_shapes_left_to_save_effort_are_in_the_errors_of_strengths(monkeypatch):
    """A lag whose time constant is a fifth off: strengths alone are refined, and a last step is of both."""
    name, true = "photodiode_lag", {"fraction": 0.05, "tau_us": 600.0}
    monkeypatch.setattr(Problem, "is_explained", lambda *_: False)
    known = {}
    for limit in (0.0, math.inf):
        case = replace(recorded(effect(name, **true), seed=2), budget=Budget(limit))
        values = values_of(case.bank, null().keys)
        seen = np.where([case.use(k.recording) == "fit" for k in null().keys], values, np.nan)
        problem = Problem(case, MODEL, null(), seen, values)
        first = fit(Problem(case, MODEL, null(), seen, seen), name, true | {"tau_us": 720.0})
        best, known[limit], _ = refined_together(problem, first, [name])
        print(limit, best.parameters, known[limit], case.budget.left_out)
        assert case.budget.left_out == ([] if limit else ["finer shapes of the effects found"])
        for key, value in true.items():
            assert best.parameters[key] == pytest.approx(value, abs=3 * known[limit][name][key])
    assert all(known[0.0][name][key] > 0.8 * sd for key, sd in known[math.inf][name].items())


@pytest.mark.parametrize(
    "name, strength, value", [("dead_time", "tau_us", 0.3), ("ir_drop", "droop", 0.02), ("readout_skew", "span", 0.7)]
)
def test_an_effect_in_proportion_to_its_strength_needs_no_twins_for_a_derivative(name, strength, value):
    """Its own change is the derivative: the strength is that of a descent, its error no smaller, at two thirds of the
    campaigns."""
    made = {}
    for known in (True, False):
        case = replace(recorded(effect(name, **{strength: value}), seed=3), budget=Budget(), recent=RecentTwins())
        problem = Problem.of(case, MODEL, null(), values_of(case.bank, null().keys))
        first = confirmed(problem, fit(problem, name, {strength: 1.5 * value}))
        before = case.budget.simulated
        given = first if known else replace(first, slopes=NO_SLOPES)
        best, errors, _ = refined_together(problem, given, [name])
        made[known] = best.parameters[strength], errors[name][strength], case.budget.simulated - before
        print(name, known, first.parameters, *made[known])
    (one, error, few), (other, by_descent, many) = made[True], made[False]
    assert abs(one - other) < by_descent and abs(one - value) < 3 * error
    assert by_descent < error < 1.6 * by_descent
    assert few <= 2 / 3 * many
