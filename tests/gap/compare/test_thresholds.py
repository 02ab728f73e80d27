"""Every threshold of deviance decides at its number: each by a case on either side of it."""

from __future__ import annotations

from dataclasses import replace
from itertools import repeat
from types import SimpleNamespace

import numpy as np
import pytest
from scripted import COUNT, FREE, NAME, found_at, null, scripted, some_fit, with_reset
from small import MODEL, effect, unit

from spikecam_env.gap.fit.candidate import fit
from spikecam_env.gap.fit.gauss_newton import descend
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.fit.shapes import with_fitted_shapes
from spikecam_env.gap.search import choice, forward, neighbours
from spikecam_env.gap.search.choice import chosen_of, confirmed_in_order
from spikecam_env.gap.search.neighbours import is_missed, try_without_earlier
from spikecam_env.gap.settings import Deviance, DiagnosisSettings, Searching


@pytest.mark.parametrize("promised, steps", [(0.7, 0), (1.5, 1)])
def test_a_step_has_to_promise_1_for_another(promised: float, steps: int):
    problem = scripted([10.0, 10.0 - promised], repeat(10.0))
    descend(problem, lambda m, b: problem.predict(m, b, 1), with_reset(0.016), unit(), FREE)
    assert len(problem.predicted) == 1 + len(FREE) + steps


@pytest.mark.parametrize("promised, steps", [(3.0, 0), (8.0, 1)])
def test_a_step_has_to_promise_5_where_candidates_are_compared(promised: float, steps: int):
    problem = scripted([10.0, 10.0 - promised], repeat(10.0))
    with_fitted_shapes(problem, found_at(0.016, 100.0))
    assert len(problem.predicted) == 1 + len(FREE) + steps


@pytest.mark.parametrize("worse, kept", [(2.0, True), (4.5, False)])
def test_a_step_may_seem_3_worse_by_chance(worse: float, kept: bool):
    problem = scripted([10.0, 0.0], repeat(10.0 + worse))
    end = descend(problem, lambda m, b: problem.predict(m, b, 1), with_reset(0.016), unit(), FREE)
    assert (end.model != with_reset(0.016)) is kept


@pytest.mark.parametrize("removed, goes_on", [(3.0, False), (8.0, True)])
def test_a_twin_has_to_remove_5_for_its_fit_to_go_on(removed: float, goes_on: bool):
    problem = scripted([100.0], repeat(100.0 - removed))
    problem = replace(problem, values=problem.seen)
    found = fit(problem, NAME, {"fraction": 0.005, "tau_us": 300.0})
    assert (len(problem.predicted) > 1) is goes_on and (found.parameters["fraction"] > 0.01) is goes_on


@pytest.mark.parametrize("removed, joined", [(3.0, [1]), (6.0, [1, 2])])
def test_a_later_effect_has_to_remove_4_to_be_fitted_with_those_before_it(removed, joined, monkeypatch):
    """The first removes 50; significance and twins are left out of it."""
    monkeypatch.setattr(forward, "is_significant", lambda *_: True)
    monkeypatch.setattr(forward, "is_small_share", lambda *_: False)
    monkeypatch.setattr(forward, "is_improvement", lambda *_: True)
    monkeypatch.setattr(forward, "is_discrepant", lambda *_: True)
    monkeypatch.setattr(forward, "try_cancelling_pair", lambda problem, names, rounds: rounds)
    monkeypatch.setattr(Problem, "standing_on", lambda problem, *_: problem)
    asked, strong = [], 10.0 * null().sd

    def with_candidates(problem, here, names, templates, turn):
        gain = removed if asked else 50.0
        best = some_fit("crosstalk", turn.misfit - gain)
        return replace(turn, fits=(replace(best, prediction=replace(best.prediction, mean=null().mean + strong)),))

    monkeypatch.setattr(forward, "with_candidates", with_candidates)
    monkeypatch.setattr(forward, "joined", lambda problem, rounds, chance: asked.append(len(rounds)) or list(rounds))
    case = SimpleNamespace(
        base=unit(),
        conditions=(),
        observations=(),
        scenes_only=False,
        settings=DiagnosisSettings(),
        budget=SimpleNamespace(allows=lambda *_, **__: True),
    )
    n = replace(null(), settings=DiagnosisSettings(searching=Searching(most_effects=2)))
    forward.forward_selection(Problem(case, MODEL, n, n.mean, n.mean), [], None)
    assert asked == joined


class Led:
    """Leads of a first candidate over another: by recordings to fit, and by all."""

    def __init__(self, monkeypatch, to_fit: float, by_all: float, rival: bool = False):
        n = null()
        self.here = Problem(None, MODEL, n, n.mean.copy(), n.mean.copy())
        self.first, self.other = some_fit("dead_time", 10.0), some_fit("dead_time", 10.0 + to_fit)

        def lead(_null, measured, _one, other):
            ahead = to_fit if measured is self.here.seen else by_all
            return ahead if other is self.other.prediction else 0.0

        monkeypatch.setattr(choice, "lead", lead)
        monkeypatch.setattr(choice, "is_rival", lambda *_: rival)

    def chosen(self, first: str, other: str):
        self.first, self.other = (
            replace(fit, name=name, model=MODEL.with_effect(effect(name)))
            for fit, name in ((self.first, first), (self.other, other))
        )
        fits, names = chosen_of(self.here, self.here.null.draws, [self.first, self.other])
        return fits[0].name, names


@pytest.mark.parametrize("behind, name", [(9.0, "comparator_delay"), (18.0, "dead_time")])
def test_a_lead_of_12_on_recordings_to_fit_is_final(behind: float, name: str, monkeypatch):
    """The other is far better on all."""
    assert Led(monkeypatch, behind, -50.0).chosen("dead_time", "comparator_delay")[0] == name


@pytest.mark.parametrize("ahead, name", [(4.0, "dead_time"), (9.0, NAME)])
def test_a_parameter_more_has_to_remove_6_to_be_chosen(ahead: float, name: str, monkeypatch):
    assert Led(monkeypatch, 0.0, -ahead).chosen("dead_time", NAME)[0] == name


@pytest.mark.parametrize("ahead, names", [(1.5, ()), (3.0, (NAME,))])
def test_a_parameter_more_has_to_remove_2_to_be_a_rival(ahead: float, names: tuple[str, ...], monkeypatch):
    assert Led(monkeypatch, 0.0, -ahead, rival=True).chosen("dead_time", NAME) == ("dead_time", names)


@pytest.mark.parametrize("missed, kept", [(10.0, False), (20.0, True)])
def test_an_earlier_effect_has_to_be_missed_by_15_to_be_kept(missed: float, kept: bool, monkeypatch):
    both = replace(some_fit("crosstalk", 100.0), model=MODEL.with_effect(effect("dead_time", tau_us=0.5)))
    monkeypatch.setattr(neighbours, "resettled", lambda problem, found, model: replace(found, model=model))
    monkeypatch.setattr(neighbours, "no_more_certain", lambda problem, found, known: found)
    monkeypatch.setattr(neighbours, "is_missed", lambda *_: False)
    monkeypatch.setattr(
        neighbours,
        "confirmed",
        lambda problem, found: found if found.model is both.model else replace(found, misfit=100.0 + missed),
    )
    after = try_without_earlier(SimpleNamespace(settings=DiagnosisSettings()), both, {"dead_time": np.zeros(COUNT)})
    assert ("dead_time" in {e.name for e in after.model.effects}) is kept


@pytest.mark.parametrize("missed, plainly", [(100.0, False), (220.0, True)])
def test_an_effect_missed_by_150_is_kept_without_a_simulation(missed: float, plainly: bool):
    problem = SimpleNamespace(misfit=lambda predicted: 100.0 + missed, settings=DiagnosisSettings())
    assert is_missed(problem, some_fit("dead_time", 100.0), np.zeros(COUNT)) is plainly


@pytest.mark.parametrize("above, asked", [(10.0, 3), (22.0, 2)])
def test_a_fit_15_above_the_best_confirmed_is_not_confirmed(above: float, asked: int):
    fits = [some_fit(name, misfit) for name, misfit in (("a", 100.0), ("b", 101.0), ("c", 100.0 + above))]
    assert len(confirmed_in_order(fits, lambda f: f, Deviance().keep)[0]) == asked
