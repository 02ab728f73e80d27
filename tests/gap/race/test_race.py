"""The race over sets of effects, on made-up statistics: nothing is simulated."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from small import MODEL, added_by, effect, unit

from spikecam_env.errors import InputError
from spikecam_env.gap import diagnose
from spikecam_env.gap.baseline.off_nominal import OffNominal
from spikecam_env.gap.compare.distance import residual_and_misfit
from spikecam_env.gap.compare.prediction import Draw, Null, Prediction
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.race import contest, neighbours, race
from spikecam_env.gap.race.contest import Heat, heats_of, shaped_while_open
from spikecam_env.gap.race.hypothesis import (
    Fidelity,
    Hypothesis,
    added_to,
    leaves_something,
    nothing_added,
)
from spikecam_env.gap.race.neighbours import Field, Start
from spikecam_env.gap.race.race import is_better
from spikecam_env.gap.race.rounds import rounds_of
from spikecam_env.gap.screen.screen import Screened
from spikecam_env.gap.statistics import Key
from spikecam_env.gap.twins.budget import Budget
from spikecam_env.gap.unit.refit import BaseFit

COUNT, TWINS = 200, 12
PLACES = {"dead_time": range(0, 40), "crosstalk": range(60, 80), "photodiode_lag": range(100, 140)}
"""Statistics that each made-up effect changes."""


@dataclass(frozen=True)
class MadeUp:
    """What of a case a race asks."""

    budget: Budget = field(default_factory=Budget)
    conditions: tuple[None, ...] = (None,)
    base: BaseFit = field(default_factory=unit)

    def to_fit(self, keys):
        return np.ones(len(keys), bool)


def change(name: str, noises: float) -> np.ndarray:
    return np.where(np.isin(np.arange(COUNT), PLACES[name]), noises, 0.0)


def problem_of(budget: Budget | None = None, **noises: float) -> Problem:
    """A measurement with effects that show by so many noises."""
    draws = np.random.default_rng(0).standard_normal((TWINS, COUNT))
    keys = tuple(Key("rates", "r", str(i)) for i in range(COUNT))
    null = Null(keys, draws.mean(axis=0), np.ones(COUNT), np.zeros(COUNT), TWINS, 100.0,
                draws=tuple(Draw(n, v, None) for n, v in enumerate(draws)))  # fmt: skip
    seen = null.mean + 0.7 * np.random.default_rng(1).standard_normal(COUNT)
    seen = seen + sum(change(name, size) for name, size in noises.items())
    return Problem(MadeUp(budget or Budget()), MODEL, null, seen, seen)  # type: ignore[arg-type]


def a_fit(problem: Problem, here: Problem, noises: dict[str, float]) -> Fit:
    """What effects of so many noises leave beside `here`."""
    null = problem.null
    there = null.mean + sum(change(name, size) for name, size in noises.items())
    prediction = Prediction(there, null.sd / np.sqrt(TWINS), null.sd, null.draws)
    model = MODEL
    for name in noises:
        model = model.with_effect(effect(name))
    rho, left = residual_and_misfit(here.null, here.seen, prediction)
    return Fit(list(noises)[-1], {}, {}, prediction, unit(), rho, left, model)


class Truths:
    """A field in which each effect is fitted at once as it is."""

    def __init__(self, **noises: float):
        self.noises, self.asked = noises, []

    def neighbours(self, problem, one):
        self.asked.append(one.effects)
        left = [n for n in self.noises if n not in one.effects]
        yield [Start(n, 1, lambda n=n: self.make(problem, one, n)) for n in left]

    def no_larger(self, problem, one):
        self.asked.append(("no larger", *one.effects))
        return []

    def make(self, problem: Problem, one: Hypothesis, name: str) -> Hypothesis:
        here = problem.standing_on(one.fit.model, one.fit.base, one.fit.prediction) if one.effects else problem
        found = a_fit(problem, here, {n: self.noises[n] for n in (*one.effects, name)})
        return added_to(problem, one, found, (name,))


@pytest.fixture
def no_twins(monkeypatch):
    """More twins say the same."""

    def joint(problem, one):
        return replace(one, misfit=problem.misfit(one.fit.prediction), fidelity=Fidelity.JOINT)

    monkeypatch.setattr(contest, "shaped", lambda problem, one: replace(one, fidelity=Fidelity.SHAPED))
    monkeypatch.setattr(contest, "jointly_fitted", joint)


def raced(problem: Problem, field_of: Truths, monkeypatch) -> list:
    monkeypatch.setattr(race, "Field", lambda names, templates: field_of)
    return race.race(problem, list(PLACES), None)


@pytest.mark.parametrize("loud", [20.0, 1000.0])
def test_a_second_effect_is_looked_for_however_loud_the_first(loud, no_twins, monkeypatch):
    """Eight noises, beside a thousand: each is more than chance."""
    sizes = {"dead_time": loud, "crosstalk": 8.0}
    rounds = raced(problem_of(**sizes), Truths(**sizes, photodiode_lag=3.0), monkeypatch)
    assert [f.name for f in added_by(rounds)] == ["dead_time", "crosstalk"]


def test_where_nothing_is_left_only_hypotheses_no_larger_are_tried(no_twins, monkeypatch):
    asked = Truths(dead_time=20.0, crosstalk=8.0)
    rounds = raced(problem_of(dead_time=20.0), asked, monkeypatch)
    assert [f.name for f in added_by(rounds)] == ["dead_time"]
    assert asked.asked == [(), ("no larger", "dead_time")]


def test_what_no_candidate_changes_ends_the_race(no_twins, monkeypatch):
    rounds = raced(problem_of(photodiode_lag=20.0), Truths(dead_time=20.0), monkeypatch)
    assert added_by(rounds) == [] and len(rounds) == 1 and [f.name for f in rounds[-1].fits] == ["dead_time"]


def test_without_budget_a_second_effect_is_left_out(no_twins, monkeypatch):
    sizes = {"dead_time": 20.0, "crosstalk": 8.0}
    budget = Budget(limit=10.0)
    rounds = raced(problem_of(budget, **sizes), Truths(**sizes), monkeypatch)
    assert [f.name for f in added_by(rounds)] == ["dead_time"] and budget.left_out == ["a second effect"]


def of(problem: Problem, name: str, removed: float, fidelity: Fidelity = Fidelity.STRENGTH) -> Hypothesis:
    """A hypothesis that removes so much of the null's deviance."""
    nothing = nothing_added(problem)
    return replace(nothing, misfit=nothing.misfit - removed, effects=(name,), newest=(name,), parent=nothing,
                   fidelity=fidelity)  # fmt: skip


def test_parameters_cost_and_open_ones_may_remove_as_much_again():
    problem = problem_of(dead_time=20.0)
    null = nothing_added(problem)
    strength_alone, with_time = of(problem, "dead_time", 100.0), of(problem, "photodiode_lag", 100.0)
    assert strength_alone.score == pytest.approx(null.score - 100.0 + 6.0)
    assert with_time.score == pytest.approx(null.score - 100.0 + 12.0)
    assert strength_alone.hope == strength_alone.score, "its strength is all there is"
    assert with_time.hope == pytest.approx(with_time.score - 100.0)
    shaped = replace(with_time, fidelity=Fidelity.SHAPED)
    assert shaped.hope == shaped.score
    beside = replace(shaped, effects=("crosstalk", "photodiode_lag"))
    assert beside.hope == pytest.approx(beside.score - 20.0), "the other effect may have its share"
    assert replace(beside, fidelity=Fidelity.JOINT).hope == beside.score


def test_only_those_that_may_still_win_are_raised(monkeypatch):
    problem = problem_of(dead_time=20.0)
    raised = []
    monkeypatch.setattr(contest, "shaped", lambda p, h: raised.append(h) or replace(h, fidelity=Fidelity.SHAPED))
    best = of(problem, "dead_time", 500.0)
    near, far = of(problem, "crosstalk", 486.0), of(problem, "crosstalk", 484.0)
    open_, closed = (of(problem, "photodiode_lag", removed) for removed in (251.0, 230.0))
    poor = of(problem, "crosstalk", 5.0)
    shaped_while_open(problem, nothing_added(problem), [closed, far, best, open_, near, poor])
    assert raised == [best, near, open_]
    raised.clear()
    shaped_while_open(problem, nothing_added(problem), [poor])
    assert raised == [], "it removes less than it costs"


def test_a_runner_up_is_fitted_jointly_where_the_winner_leaves_something(no_twins, monkeypatch):
    for left_over, fitted in ((0.0, 1), (9.0, 2)):
        problem = problem_of(dead_time=20.0, crosstalk=left_over)
        asked = []
        monkeypatch.setattr(contest, "jointly_fitted", lambda p, h, asked=asked: asked.append(h.newest) or h)
        monkeypatch.setattr(contest, "heats_of", lambda p, ready: [Heat(tuple(ready), ())])
        winner = Truths(dead_time=20.0).make(problem, nothing_added(problem), "dead_time")
        both = ("dead_time", "crosstalk")
        another = replace(winner.fit, prediction=replace(winner.fit.prediction))
        hopeful = replace(
            winner, fit=another, misfit=winner.misfit + 1.0, fidelity=Fidelity.SHAPED, effects=both, newest=both[1:]
        )
        starts = [Start("", 0, lambda h=h: h) for h in (replace(winner, fidelity=Fidelity.SHAPED), hopeful)]
        contest.contest(problem, nothing_added(problem), starts)
        assert len(asked) == fitted


def test_a_neighbour_is_better_by_more_than_its_price_unless_it_alone_leaves_nothing():
    problem = problem_of(dead_time=20.0)
    best = nothing_added(problem)
    silent = Truths(dead_time=20.0).make(problem, best, "dead_time")
    assert leaves_something(problem, best) and not leaves_something(problem, silent)
    loud = of(problem, "dead_time", 0.0)
    for margin, better in ((7.0, True), (5.0, False)):
        assert (
            is_better(problem, replace(loud, misfit=best.score - problem.settings.deviance.tie - margin), best)
            is better
        )
    assert is_better(problem, replace(silent, misfit=best.score - problem.settings.deviance.tie - 1.0), best)
    assert not is_better(problem, best, best)
    assert not is_better(problem, replace(loud, misfit=0.0), silent), "it leaves something, and the other does not"


@pytest.mark.parametrize(("worse", "better"), [(5.0, True), (7.0, False)])
def test_an_effect_is_left_out_where_it_removes_less_than_it_costs(worse, better):
    problem = problem_of(dead_time=20.0)
    field_of = Truths(dead_time=20.0, crosstalk=0.0)
    one = field_of.make(problem, nothing_added(problem), "dead_time")
    both = field_of.make(problem, one, "crosstalk")
    assert is_better(problem, replace(one, misfit=both.misfit + worse), both) is better


@pytest.mark.parametrize(("more", "as_given"), [(5.0, True), (7.0, False)])
def test_a_parameter_of_the_model_is_off_where_that_removes_more_than_it_costs(more, as_given, monkeypatch):
    problem = problem_of(dead_time=20.0)
    noisy = replace(unit(), white=9.0 * unit().white)
    found = Truths(dead_time=20.0).make(problem, nothing_added(problem), "dead_time")
    off = replace(found, fit=replace(found.fit, base=noisy), off=("reset_noise",), fidelity=Fidelity.JOINT)
    asked = []

    def confirm(problem, fit, count):
        asked.append((fit.base.white, count))
        return replace(fit, prediction=replace(fit.prediction))

    monkeypatch.setattr(neighbours, "confirmed", confirm)
    monkeypatch.setattr(neighbours, "off_nominal", lambda case, model, base: OffNominal({}, replace(base, white=1e-5)))
    [start] = Field((), None).no_larger(problem, off)
    made = replace(start.make(), misfit=off.misfit + more)
    assert asked == [(1e-5, TWINS)] and made.off == () and made.parameters == off.parameters - 1
    assert is_better(problem, made, off) is as_given
    assert Field((), None).no_larger(problem, made) == []


def test_what_predicts_the_same_beside_the_same_parent_is_a_rival():
    problem = problem_of(dead_time=20.0)
    nothing = nothing_added(problem)
    one = replace(Truths(dead_time=20.0).make(problem, nothing, "dead_time"), fidelity=Fidelity.SHAPED)
    same = replace(one.fit, name="ir_drop", model=MODEL.with_effect(effect("ir_drop")))
    other = replace(one, fit=same, newest=("ir_drop",), effects=("ir_drop",))
    another_shape = replace(one, misfit=one.misfit + 1.0)
    poor = replace(Truths(crosstalk=1.0).make(problem, nothing, "crosstalk"), fidelity=Fidelity.SHAPED)
    [heat] = heats_of(problem, [poor, another_shape, one, other])
    assert heat.runners == (one, other, poor) and heat.rivals == ("ir_drop",)


def test_an_effect_that_took_anothers_place_is_a_round_without_a_parent():
    """The first effect was replaced, so that nobody knows what the second one leaves alone."""
    problem = problem_of(dead_time=20.0, crosstalk=8.0)
    field_of = Truths(dead_time=20.0, crosstalk=8.0)
    first = field_of.make(problem, nothing_added(problem), "dead_time")
    orphan = replace(first, parent=None)
    both = field_of.make(problem, orphan, "crosstalk")
    other = replace(both, newest=("photodiode_lag",))
    heats = [Heat((both, other), ("photodiode_lag",)), Heat((both,), ())]
    rounds = rounds_of(problem, both, heats, motion_alone=False)
    assert [f.name for f in added_by(rounds)] == ["dead_time", "crosstalk"]
    assert [r.rivals for r in rounds] == [(), ("photodiode_lag",), ()]
    assert rounds[-1].model is both.fit.model and rounds[1].model is first.fit.model


def test_a_search_of_another_name_is_refused():
    with pytest.raises(InputError, match=r"blind.*forward.*race"):
        diagnose("nowhere", search="blind")


def screened(name: str, left: float) -> Screened:
    return Screened(name, effect(name).parameters(), left, np.zeros(COUNT))


def test_three_effects_are_looked_for_and_no_fourth(monkeypatch):
    problem = problem_of(dead_time=20.0)
    monkeypatch.setattr(Field, "screened", lambda *_: [screened("ir_drop", 10.0)])
    monkeypatch.setattr(neighbours, "beside", lambda problem, one: problem)
    for effects, count in ((("dead_time", "crosstalk"), 1), (("dead_time", "crosstalk", "photodiode_lag"), 0)):
        one = replace(nothing_added(problem), effects=effects)
        starts = Field(("ir_drop",), None).added(problem, one)
        assert len(starts) == count
        assert all(s.recordings == 3 * len(problem.case.conditions) and s.removed > 10.0 for s in starts)
        assert count or Field(("ir_drop",), None).standing_out(problem, one) == []


def test_what_removes_half_as_much_by_its_template_runs_for_anothers_place(monkeypatch):
    problem = problem_of(dead_time=20.0)
    rest = replace(nothing_added(problem), effects=("crosstalk",))
    one = replace(rest, misfit=rest.misfit - 100.0, effects=("dead_time", "crosstalk"), newest=("crosstalk",))
    for removed, names in ((51.0, ["dead_time", "ir_drop"]), (49.0, [])):
        start = Start("ir_drop", 1, lambda: rest, removed)
        monkeypatch.setattr(Field, "added", lambda *_, start=start: [start, replace(start, what="dead_time")])
        starts = Field((), None).swapped(problem, one, "dead_time", rest)
        assert [s.what for s in starts] == names
        if starts:
            own = starts[0].make()
            assert own.newest == ("dead_time",) and own.parent is rest and own.fit.prediction is one.fit.prediction


def test_what_is_added_costs_no_less_for_a_parameter_that_was_off_before():
    problem = problem_of(dead_time=20.0)
    parent = replace(nothing_added(problem), off=("reset_noise",))
    nothing = Truths(crosstalk=0.0).make(problem, parent, "crosstalk")
    assert nothing.score - parent.score == pytest.approx(6.0)
