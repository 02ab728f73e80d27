"""Steps that are skipped once enough has been simulated, and their notes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
import small
from small import effect, recorded

from spikecam_env.cli.diagnose import Diagnose
from spikecam_env.gap.baseline.off_nominal import OffNominal
from spikecam_env.gap.compare.distance import residual, residual_and_misfit
from spikecam_env.gap.compare.prediction import Null, Prediction, values_of
from spikecam_env.gap.fit import joint as polish
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.report.sentence import sentence, unfinished
from spikecam_env.gap.search import forward as searching
from spikecam_env.gap.search import neighbours, shortlist
from spikecam_env.gap.search.forward import SECOND, joined
from spikecam_env.gap.search.neighbours import may_try_without_earlier, try_cancelling_pair, try_in_place_of_earlier
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.search.shortlist import may_be_shaped
from spikecam_env.gap.settings import DiagnosisSettings
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.twins.budget import CAMPAIGNS, Budget
from spikecam_env.gap.verdict.comparison import Comparison
from spikecam_env.gap.verdict.verdict import conclude

PER_EFFECT = DiagnosisSettings().searching.campaigns_per_effect


def problem_of(case: SimpleNamespace) -> Problem:
    """Of a case that has a budget alone."""
    return Problem(case, None, SimpleNamespace(settings=DiagnosisSettings()), None, None)  # type: ignore[arg-type]


def test_nothing_is_left_out_while_there_is_less_than_the_most():
    budget = Budget(20, [13, 6])
    assert budget.allows("a third effect") and budget.simulated == 19
    assert budget.left_out == [] and unfinished(budget) == []


def test_a_skipped_step_is_noted_once():
    budget = Budget(20, [13, 7])
    assert not budget.allows("a third effect") and not budget.allows("a third effect")
    assert not budget.allows("photodiode_lag of another shape")
    assert unfinished(budget) == [
        "Skipped to stay within --effort: a third effect and photodiode lag of another shape. A larger --effort "
        "includes them."
    ]


def test_skipped_refinements_are_noted_to_widen_intervals():
    (said,) = unfinished(Budget(20, [20], ["finer strengths"]))
    (other,) = unfinished(Budget(20, [20], ["a third effect"]))
    assert said.endswith("Intervals are wider for it.") and "wider" not in other


def test_a_step_over_the_rest_of_the_budget_does_not_begin():
    budget = Budget(20, [13])
    assert budget.allows("photodiode_lag of another shape", 6) and budget.left_out == []
    assert not budget.allows("photodiode_lag of another shape", 7)
    assert budget.left_out == ["photodiode_lag of another shape"]


def test_a_step_that_a_verdict_needs_may_take_more():
    budget = Budget(20, [13])
    assert budget.allows("a second effect", 12, needed=True) and not budget.allows("a second effect", 13, needed=True)


def test_a_verdict_that_is_settled_can_do_without_all():
    budget = Budget(20, [20], verdict_known=True)
    assert not budget.allows("a second effect", needed=True) and budget.left_out == ["a second effect"]


@pytest.mark.parametrize(
    "most, names, silent, shapes",
    [
        (16, ["photodiode_lag"], False, True),
        (0, ["photodiode_lag"], True, True),
        (15, ["photodiode_lag"], False, False),
        (21, ["photodiode_lag", "crosstalk"], True, True),
        (20, ["photodiode_lag", "crosstalk"], True, False),
    ],
)
def test_of_several_effects_strengths_alone_are_refined_when_enough_was_simulated(
    most: int, names: list[str], silent: bool, shapes: bool, monkeypatch
):
    """Five recordings, three of these or four twins: the start and one for each parameter."""
    monkeypatch.setattr(Problem, "is_explained", lambda *_: silent)
    monkeypatch.setattr(polish, "simulated_for", lambda *_: (list(range(5)), 1))
    case, found = SimpleNamespace(budget=Budget(most)), SimpleNamespace(prediction=None)
    free = polish.to_refine(problem_of(case), found, names)
    assert (("photodiode_lag", "tau_us") in free) == shapes == (not case.budget.left_out)
    assert {name for name, _ in free} == set(names)


def test_parameters_that_were_not_refined_are_known_no_better_than_before():
    assert polish.no_smaller({"fraction": 0.1}, {"fraction": 0.3, "tau_us": 5.0}) == {"fraction": 0.3, "tau_us": 5.0}
    assert polish.no_smaller({"fraction": 0.4}, {"fraction": 0.3, "tau_us": 5.0}) == {"fraction": 0.4, "tau_us": 5.0}
    assert polish.no_smaller({"fraction": 0.1, "tau_us": 2.0}, {"fraction": 0.3}) == {"fraction": 0.1, "tau_us": 2.0}


def test_without_a_most_there_is_no_end():
    assert Budget(math.inf, [10**9]).allows("a third effect")


def test_runners_up_are_not_tried_anew_when_enough_was_simulated():
    fits = tuple(SimpleNamespace(name=name, misfit=misfit) for name, misfit in (("blooming", 10.0), ("ir_drop", 20.0)))
    turn = SimpleNamespace(misfit=100.0, fits=fits)
    best = SimpleNamespace(model=SimpleNamespace(effects=()))
    case = SimpleNamespace(budget=Budget(0))
    assert try_in_place_of_earlier(problem_of(case), best, turn) == (best, turn)
    assert case.budget.left_out == ["alternatives to blooming"]


def test_a_shape_is_fitted_up_to_three_tenths_more(monkeypatch):
    """Of two parameters, three predictions of five recordings, of twenty and three tenths more."""
    monkeypatch.setattr(shortlist, "recordings_of", lambda *_: 5)
    lag = SimpleNamespace(name="photodiode_lag")
    spent, more = (SimpleNamespace(budget=Budget(20, [n])) for n in (10, 11))
    assert may_be_shaped(problem_of(spent), lag) and not may_be_shaped(problem_of(more), lag)
    assert more.budget.left_out == ["photodiode_lag of finer shape"]


def test_two_effects_are_simulated_together_and_alone_while_effort_is_left():
    """Two by two twins of five recordings, of forty and three tenths more."""
    left, spent = (SimpleNamespace(budget=Budget(40, [n]), conditions=range(5)) for n in (31, 32))
    assert may_try_without_earlier(problem_of(left), 2) and left.budget.left_out == []
    assert not may_try_without_earlier(problem_of(spent), 2)
    assert spent.budget.left_out == ["a test of each effect found"]


@pytest.mark.parametrize("spent", [51, 52])
def test_bends_that_cancel_are_looked_for_while_effort_is_left(spent: int, monkeypatch):
    """Of forty recordings and three tenths more."""
    asked = []
    monkeypatch.setattr(neighbours, "is_significant", lambda *_: True)
    monkeypatch.setattr(neighbours, "residual", lambda *_: None)
    monkeypatch.setattr(neighbours, "fit_pair", lambda *_: asked.append("twins"))
    case = SimpleNamespace(budget=Budget(40, [spent]))
    turn = SimpleNamespace(fits=(SimpleNamespace(name="dead_time"),), prediction=None)
    assert try_cancelling_pair(problem_of(case), (), [turn]) == [turn]
    assert (asked == ["twins"]) == (spent < 52) == (case.budget.left_out == [])


@dataclass(frozen=True)
class Found:
    """The fits of a round."""

    fits: tuple[SimpleNamespace, ...]


@pytest.mark.parametrize("spent, settled", [(38, False), (30, True)])
def test_a_fit_takes_one_step_when_no_effort_is_left(spent: int, settled: bool, monkeypatch):
    """Two predictions of five recordings, each made twice, and four twins more: forty, of sixty and three tenths."""
    monkeypatch.setattr(searching, "with_errors", lambda turn, errors: (turn, errors))
    monkeypatch.setattr(searching, "stepped_once", lambda problem, found, names: (found, {names[0]: {"share": 0.1}}))
    monkeypatch.setattr(searching, "is_small_share", lambda *_: False)
    monkeypatch.setattr(searching, "simulated_for", lambda *_: (list(range(5)), 1))
    model = SimpleNamespace(effects=(SimpleNamespace(name="blooming"),))
    best = SimpleNamespace(name="blooming", model=model, misfit=10.0)
    case = SimpleNamespace(budget=Budget(60, [spent], verdict_known=settled))
    [(turn, errors)] = joined(problem_of(case), [Found((best,))], 0.0)
    assert turn == Found((best,)) and errors == {"blooming": {"share": 0.1}}
    assert case.budget.left_out == ["finer strengths"]


def test_pairs_without_a_simulation_are_judged_by_the_model_given(monkeypatch):
    """And not by the one with the first effect, whose noise is no price to the second."""
    monkeypatch.setattr(searching, "simulated_for", lambda *_: ([0], 1))
    monkeypatch.setattr(searching, "stepped_once", lambda problem, found, names: (found, {}))
    monkeypatch.setattr(searching, "with_errors", lambda turn, errors: turn)
    keys = tuple(StatisticKey("g", "r", str(i)) for i in range(3))
    null = Null(keys, np.zeros(3), np.ones(3), np.full(3, 0.1), 12, 11.0)
    both = Prediction(np.ones(3), np.full(3, 0.3), np.full(3, 2.0), ())
    model = SimpleNamespace(effects=(SimpleNamespace(name="lamp_drift"), SimpleNamespace(name="blooming")))
    last = Fit("blooming", {}, {}, both, None, np.zeros(3), -10.0, model)
    turn = Round(SimpleNamespace(effects=model.effects[:1]), None, null.prediction, np.zeros(3), 50.0, (last,))
    first = Found((SimpleNamespace(name="lamp_drift"),))
    seen = np.array([0.5, 1.0, 2.0])
    case = SimpleNamespace(budget=Budget(0), conditions=range(5))
    _, joint = joined(Problem(case, None, null, seen, seen), [first, turn], 0.0)
    rho, misfit = residual_and_misfit(null, seen, both)
    assert joint.fits[0].misfit == misfit > 0 and np.array_equal(joint.fits[0].rho, rho)
    assert case.budget.left_out == ["a test of each effect found", "finer strengths"]


def test_the_command_asks_for_what_the_function_does():
    assert Diagnose.__dataclass_fields__["effort"].default == pytest.approx(CAMPAIGNS)


@pytest.mark.parametrize("left_out, verdict", [([], "named"), (["a third effect"], "named"), ([SECOND], "unknown")])
def test_nothing_is_named_where_a_second_effect_was_not_looked_for(left_out: list[str], verdict: str):
    """A dead time leaves so little that it may be named, once a second effect was looked for beside it."""
    found = effect("dead_time", tau_us=0.5)
    null, model = small.null(), small.MODEL.with_effect(found)
    case = replace(recorded(found), budget=Budget(400, [300], left_out))
    values = values_of(case.bank, null.keys)
    close = Prediction(values, null.noise, null.sd, null.draws)
    fit = Fit("dead_time", {"tau_us": 0.5}, {"tau_us": 0.01}, close, case.base, np.zeros(len(values)), 1.0, model)
    first = Round(small.MODEL, case.base, null.prediction, residual(null, values, null.prediction), 900.0, (fit,))
    rounds = [first, Round(model, case.base, close, fit.rho, 1.0)]
    off = OffNominal({}, case.base)
    comparison = Comparison(case, small.MODEL, small.MODEL, null, values, null.mean, (), off, ())
    said = conclude(comparison, rounds, floor=1.0)
    assert said.verdict == verdict and said.patched == model
    if verdict == "unknown":
        asked = said.unknown["effort"]
        assert said.unknown["not_looked_for"] == SECOND and said.unknown["best_candidate"] == "dead_time"
        assert len(case.conditions) * asked > 300 + PER_EFFECT * len(case.conditions) and asked % 10 == 0
        assert f"--effort {asked}" in sentence(said, "scsim") and "dead time comes nearest" in sentence(said, "scsim")


def test_the_most_by_default_is_enough_to_look_for_a_second_effect():
    """Of thirteen recordings: after the twins of the noise, a first effect and all its shapes."""
    assert Budget(CAMPAIGNS * 13, [100 * 13]).allows(SECOND, PER_EFFECT * 13, needed=True)
