"""Which candidate is chosen: by the recordings to fit, and between rivals by those held out."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest
from small import MODEL, effect, recorded, unit

from spikecam_env.gap.compare.distance import residual_and_misfit
from spikecam_env.gap.compare.prediction import Draw, Null, Prediction
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.screen.screen import Screened
from spikecam_env.gap.search import forward as search
from spikecam_env.gap.search import neighbours
from spikecam_env.gap.search.choice import PER_PARAMETER, chosen_of, confirmed_in_order
from spikecam_env.gap.search.forward import joined
from spikecam_env.gap.search.neighbours import runner_up, try_in_place_of_earlier
from spikecam_env.gap.search.rivals import is_rival, lead
from spikecam_env.gap.search.round import Round, has_candidate, is_improvement, is_visible
from spikecam_env.gap.settings import Deviance, DiagnosisSettings, Searching
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.twins.budget import Budget
from spikecam_env.gap.unit.conversion import exact_refit
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.gap.verdict import verdict
from spikecam_env.gap.verdict.remainder import explains, squares_left
from spikecam_env.gap.verdict.verdict import with_stand_ins

DEVIANCE = Deviance()

COUNT, TWINS = 200, 12
DEAD_TIME = effect("dead_time", tau_us=0.2)
FIT = np.arange(COUNT) < 150
"""Statistics of the recordings to fit; the others are held out."""


@dataclass(frozen=True)
class OfAll:
    """The part of a case that a search uses, where all statistics are to be fitted."""

    budget: Budget = field(default_factory=Budget)
    conditions: tuple[None, ...] = ()
    base: BaseFit = field(default_factory=unit)
    observations: tuple[None, ...] = ()
    scenes_only: bool = False
    settings: DiagnosisSettings = field(default_factory=DiagnosisSettings)

    def to_fit(self, keys):
        return np.ones(len(keys), bool)


def null() -> Null:
    values = np.random.default_rng(0).standard_normal((TWINS, COUNT))
    draws = tuple(Draw(n, v, None) for n, v in enumerate(values))
    keys = tuple(StatisticKey("rates", "r", str(i)) for i in range(COUNT))
    return Null(keys, values.mean(axis=0), values.std(axis=0, ddof=1), np.zeros(COUNT), TWINS, TWINS - 1, draws=draws)


def a_fit(n: Null, name: str, change, seen) -> Fit:
    prediction = Prediction(n.mean + change, n.sd / np.sqrt(TWINS), n.sd)
    rho, left = residual_and_misfit(n, seen, prediction)
    return Fit(name, {}, {}, prediction, unit(), rho, left, MODEL)


def campaign():
    """An effect of 4 noises on 50 statistics to fit and on all that are held out."""
    n = null()
    effect = np.where((np.arange(COUNT) < 50) | ~FIT, 4.0, 0.0)
    values = n.mean + effect + n.sd * np.random.default_rng(1).standard_normal(COUNT)
    return n, effect, values, np.where(FIT, values, np.nan)


def selected(case, n: Null, values, monkeypatch, joined=lambda _problem, rounds, _chance: list(rounds)) -> list[Round]:
    """Rounds of a search whose joint fit is `joined`, and which tries no two bends that cancel."""
    monkeypatch.setattr(search, "joined", joined)
    monkeypatch.setattr(search, "try_cancelling_pair", lambda _problem, _names, rounds: rounds)
    return search.forward_selection(Problem.of(case, MODEL, n, values), [], None)


def only_polish(polish, monkeypatch) -> None:
    """A joint fit by `polish`, without tests of earlier effects."""
    for module in (search, neighbours):
        monkeypatch.setattr(module, "refined_together", polish)
    monkeypatch.setattr(search, "try_without_earlier", lambda problem, best, earlier: best)
    monkeypatch.setattr(search, "try_in_place_of_earlier", lambda problem, best, turn: (best, turn))


def test_recordings_held_out_decide_between_what_the_others_cannot_tell_apart():
    """A twin that is a little better on the recordings to fit, and wrong on those held out."""
    n, effect, values, seen = campaign()
    nudge = np.where(np.arange(COUNT) < 50, 0.1 * np.sign(values - n.mean - effect), 0.0)
    true, twin = a_fit(n, "dead_time", effect, seen), a_fit(n, "ir_drop", np.where(FIT, effect + nudge, 0.0), seen)
    assert twin.misfit < true.misfit
    fits, rivals = chosen_of(Problem(recorded(), MODEL, n, seen, values), n.draws, [twin, true])
    assert [f.name for f in fits] == ["dead_time", "ir_drop"] and rivals == ()


def test_what_loses_little_and_wins_all_recordings_is_chosen():
    """The true one wins by far on held-out recordings, and loses by more than chance on the others."""
    n, effect, values, seen = campaign()
    nudge = np.where(np.arange(COUNT) < 50, 0.18 * (values - n.mean - effect), 0.0)
    true, twin = a_fit(n, "dead_time", effect, seen), a_fit(n, "ir_drop", np.where(FIT, effect + nudge, 0.0), seen)
    loss = lead(n, seen, twin.prediction, true.prediction)
    print(f"loses {loss:.1f}")
    assert DEVIANCE.tie < loss < DEVIANCE.dismiss and not is_rival(n, n.draws, seen, twin.prediction, true.prediction)
    fits, rivals = chosen_of(Problem(recorded(), MODEL, n, seen, values), n.draws, [twin, true])
    assert [f.name for f in fits] == ["dead_time", "ir_drop"] and rivals == ()


def test_a_later_effect_that_leaves_nothing_to_hear_has_but_to_leave_no_more():
    """Beside a drift of the lamp a skew explained 12 noises, and the price of the drift's scatter was told anew."""
    n, effect, _, seen = campaign()
    seen = seen + 4.0 * effect
    all_of_it, some = a_fit(n, "dead_time", 5.0 * effect, seen), a_fit(n, "dead_time", effect, seen)
    for found, silent in ((all_of_it, True), (some, False)):
        assert is_improvement(n, found.misfit + DEVIANCE.accept, found, later=False)
        assert not is_improvement(n, found.misfit + DEVIANCE.accept - 1.0, found, later=False)
        assert is_improvement(n, found.misfit + 1.0, found, later=True) is silent
        assert not is_improvement(n, found.misfit - 1.0, found, later=True)
        assert is_improvement(n, found.misfit + DEVIANCE.accept, found, later=True, weak=True) is silent


def test_what_all_recordings_together_cannot_tell_apart_are_rivals():
    n, effect, values, seen = campaign()
    one, other = a_fit(n, "dead_time", effect, seen), a_fit(n, "ir_drop", 1.002 * effect, seen)
    assert chosen_of(Problem(recorded(), MODEL, n, seen, values), n.draws, [one, other])[1]


@pytest.mark.parametrize(("better", "first"), [(0.0, "dead_time"), (20.0, "incomplete_reset")])
def test_a_parameter_more_has_to_explain_more(better, first):
    """An incomplete reset, whose time constant is free, with the change of a dead time, and once with the rest."""
    n, effect, values, seen = campaign()
    nudge = np.where((np.arange(COUNT) >= 50) & (np.arange(COUNT) < 60), better * n.sd, 0.0)
    simple = a_fit(n, "dead_time", effect, seen + nudge)
    richer = a_fit(n, "incomplete_reset", effect + nudge, seen + nudge)
    fits, rivals = chosen_of(Problem(recorded(), MODEL, n, seen + nudge, values + nudge), n.draws, [richer, simple])
    assert fits[0].name == first and rivals == ()


def test_what_has_a_parameter_more_is_a_rival_where_it_leaves_more_than_that_less():
    """An incomplete reset with the change of a dead time and ever more of the rest."""
    n, effect, values, seen = campaign()
    told = []
    for better in np.linspace(0.0, 1.0, 21):
        nudge = np.where((np.arange(COUNT) >= 50) & (np.arange(COUNT) < 60), better * n.sd, 0.0)
        simple = a_fit(n, "dead_time", effect, seen + nudge)
        richer = a_fit(n, "incomplete_reset", effect + nudge, seen + nudge)
        ahead = lead(n, values + nudge, richer.prediction, simple.prediction)
        if 0 < ahead < DEVIANCE.tie:
            problem = Problem(recorded(), MODEL, n, seen + nudge, values + nudge)
            told.append((ahead, chosen_of(problem, n.draws, [richer, simple])[1]))
    print([(round(ahead, 2), rivals) for ahead, rivals in told])
    assert {rivals for ahead, rivals in told if ahead < PER_PARAMETER} == {()}
    assert {rivals for ahead, rivals in told if ahead > PER_PARAMETER} == {("incomplete_reset",)}


def test_what_makes_campaigns_scatter_shows_though_their_mean_stays():
    """A few hot pixels are in some units, and in most none: the spread is four times the null's, or as it was."""
    n, effect, _values, seen = campaign()
    still = a_fit(n, "hot_pixels", 0.0 * effect, seen)
    wide = replace(still, prediction=replace(still.prediction, spread=4.0 * n.sd))
    assert is_visible(n, wide) and not is_visible(n, still)


def test_recordings_held_out_have_no_say_where_the_others_tell():
    """The wrong one is perfect where it is not asked, and has nothing to offer where it is."""
    n, effect, values, seen = campaign()
    wrong = a_fit(n, "crosstalk", np.where(FIT, np.roll(effect * FIT, 60), values - n.mean), seen)
    fits, rivals = chosen_of(
        Problem(recorded(), MODEL, n, seen, values), n.draws, [a_fit(n, "dead_time", effect, seen), wrong]
    )
    assert fits[0].name == "dead_time" and rivals == ()
    assert chosen_of(Problem(recorded(), MODEL, n, seen, values), n.draws, []) == ([], ())


def test_fits_are_confirmed_until_one_stands_clear_above_the_best():
    """Confirmation makes each 10 better; the third promises less than the best by more than that and DEVIANCE.keep."""
    n, effect, _values, seen = campaign()
    base = a_fit(n, "", effect, seen)
    asked = []

    def confirm(f: Fit) -> Fit:
        asked.append(f.name)
        return replace(f, misfit=f.misfit - 10.0)

    near, far = 100.0 + DEVIANCE.keep - 1.0, 100.0 + DEVIANCE.keep + 11.0
    fits = [replace(base, name=name, misfit=m) for name, m in (("a", 100.0), ("b", near), ("c", near), ("d", far))]
    sure, rest = confirmed_in_order(fits, confirm, DEVIANCE.keep)
    assert asked == ["a", "b", "c"] and [f.name for f in sure] == ["a", "b", "c"] and [f.name for f in rest] == ["d"]


def test_fits_that_promise_too_little_are_not_confirmed_unless_one_does_not():
    """60 are enough.  Alone, 61 are not worth it; beside one confirmed at 55, those within DEVIANCE.keep of it are."""
    n, effect, _values, seen = campaign()
    base = a_fit(n, "", effect, seen)
    fits = [replace(base, name=name, misfit=m) for name, m in (("a", 61.0), ("b", 66.0), ("c", 55.0 + DEVIANCE.keep))]
    best = replace(base, name="best", misfit=55.0)
    sure, rest = confirmed_in_order(fits, lambda f: f, DEVIANCE.keep, enough=60.0)
    assert sure == [] and [f.name for f in rest] == ["a", "b", "c"]
    sure, rest = confirmed_in_order([best, *fits], lambda f: f, DEVIANCE.keep, enough=60.0)
    assert [f.name for f in sure] == ["best", "a", "b"] and [f.name for f in rest] == ["c"]
    disappointing = replace(best, misfit=75.0)
    sure, rest = confirmed_in_order([best, *fits], lambda f: disappointing, DEVIANCE.keep, enough=60.0)
    assert [f.name for f in sure] == ["best"] and [f.name for f in rest] == ["a", "b", "c"], "as will the others"


def test_a_round_in_which_nothing_promises_enough_is_one_without_a_choice(monkeypatch):
    n, _effect, values, seen = campaign()
    poor = a_fit(n, "crosstalk", np.where(np.arange(COUNT) >= 150, 4.0, 0.0), seen)
    rho, before = residual_and_misfit(n, seen, n.prediction)
    assert poor.misfit == pytest.approx(before)
    monkeypatch.setattr(search, "screened_beside", lambda *_: [])
    monkeypatch.setattr(search, "fits_of", lambda *_: ([poor], {}))
    monkeypatch.setattr(search, "confirmed", lambda *_: pytest.fail("it was confirmed"))
    turn = Round(MODEL, unit(), n.prediction, rho, before)
    problem = Problem(recorded(), MODEL, n, seen, values)
    after = search.with_candidates(problem, problem, [], {}, turn)
    assert after.fits == (poor,) and after.rivals == ()


def test_beside_what_was_found_a_hint_is_enough_to_be_confirmed(monkeypatch):
    """The first effect may have taken the share of a later one: only both together show how much they remove."""
    n, _effect, values, seen = campaign()
    rho, before = residual_and_misfit(n, seen, n.prediction)
    hint = replace(a_fit(n, "crosstalk", 4.0 * n.sd, seen), misfit=before - (DEVIANCE.accept + search.JOIN) / 2)
    asked = []
    monkeypatch.setattr(search, "screened_beside", lambda *_: [])
    monkeypatch.setattr(search, "fits_of", lambda *_: ([hint], {Screened("crosstalk", {}, 0.0, rho): hint}))
    monkeypatch.setattr(search, "confirmed", lambda _problem, found: asked.append(found) or found)
    first = Round(MODEL, unit(), n.prediction, rho, before)
    problem = Problem(recorded(), MODEL, n, seen, values)
    search.with_candidates(problem, problem, [], {}, first)
    assert not asked
    search.with_candidates(problem, problem, [], {}, replace(first, to_join=search.JOIN))
    assert asked == [hint]


def test_a_later_effect_of_little_is_polished_together_with_the_first(monkeypatch):
    n, change, values, seen = campaign()
    values, seen = values + 9 * change, seen + 9 * change
    little = of_two(n, "crosstalk", 0.02 * change, seen)
    left = residual_and_misfit(n, seen, n.prediction)[1]
    first = Round(MODEL, unit(), n.prediction, seen, left + 500.0, (a_fit(n, "dead_time", 0.0 * change, seen),))
    asked = []

    def polish(problem, found, names):
        asked.append(list(names))
        return found, {}, False

    only_polish(polish, monkeypatch)
    joined(Problem(recorded(), MODEL, n, seen, values), [first, replace(first, misfit=left, fits=(little,))], 0.0)
    assert asked == [["dead_time", "crosstalk"]]
    asked.clear()
    joined(Problem(recorded(), MODEL, n, seen, values), [replace(first, misfit=left, fits=(little,))], 0.0)
    assert asked == [], "alone it is a stand-in"
    bend = replace(little, name="comparator_delay")
    beside = replace(first, model=MODEL.with_effect(DEAD_TIME), misfit=left, fits=(bend,))
    joined(Problem(recorded(), MODEL, n, seen, values), [first, beside], 0.0)
    assert asked == [], "and so is another bend"


def test_a_hint_of_another_bend_is_none():
    n, change, _, seen = campaign()
    hint = a_fit(n, "crosstalk", change, seen)
    beside = MODEL.with_effect(DEAD_TIME)
    before = hint.misfit + (DEVIANCE.accept + search.JOIN) / 2
    turn = Round(beside, unit(), n.prediction, seen, before, (hint,), to_join=search.JOIN)
    bend = replace(turn, fits=(replace(hint, name="comparator_delay"),))
    assert has_candidate(turn, n) and not has_candidate(bend, n)
    assert has_candidate(replace(bend, model=MODEL), n), "it is the first"


def test_one_confirmed_before_is_among_those_that_others_are_measured_by():
    n, effect, _values, seen = campaign()
    base = a_fit(n, "", effect, seen)
    known = replace(base, name="known", misfit=10.0)
    fits = [
        replace(base, name=name, misfit=m) for name, m in (("a", 10.0 + DEVIANCE.keep), ("b", 11.0 + DEVIANCE.keep))
    ]
    sure, rest = confirmed_in_order(fits, lambda f: f, DEVIANCE.keep, known=[known])
    assert [f.name for f in sure] == ["known", "a"] and [f.name for f in rest] == ["b"]


def test_beside_a_later_effect_a_runner_up_may_take_the_earlier_ones_place(monkeypatch):
    """A wrong first effect stood for part of the second; with the second there, the right one explains more."""
    n, change, values, seen = campaign()
    late = np.where((np.arange(COUNT) >= 100) & FIT, 4.0, 0.0)
    half = np.where(np.arange(COUNT) < 25, 4.0, 0.0)
    values, seen = values + late, seen + late
    two = MODEL.with_effect(effect("dead_time", tau_us=0.5)).with_effect(effect("crosstalk", kick=1e-3))
    right = MODEL.with_effect(effect("comparator_delay", delay_us=0.5)).with_effect(effect("crosstalk", kick=1e-3))
    made = {
        two: a_fit(n, "crosstalk", half + late, seen).prediction,
        right: a_fit(n, "comparator_delay", change + late, seen).prediction,
        two.without("dead_time"): a_fit(n, "crosstalk", late, seen).prediction,
    }

    def confirm(problem, found):
        rho, left = problem.residual_and_misfit(made[found.model])
        return replace(found, prediction=made[found.model], rho=rho, misfit=left)

    monkeypatch.setattr(neighbours, "confirmed", confirm)
    monkeypatch.setattr(neighbours, "resettled", lambda problem, found, model: replace(found, model=model))
    monkeypatch.setattr(neighbours, "fit", lambda problem, name, start: replace(best, name=name, model=right))
    best = replace(a_fit(n, "crosstalk", half + late, seen), model=two)
    first, other = (replace(best, name=name) for name in ("dead_time", "comparator_delay"))
    turn = Round(
        MODEL, unit(), n.prediction, values, 500.0, (replace(first, misfit=300.0), replace(other, misfit=340.0))
    )
    now, then = try_in_place_of_earlier(Problem(recorded(), MODEL, n, seen, values), best, turn)
    assert now.name == "crosstalk" and now.model == right
    assert [f.name for f in then.fits] == ["comparator_delay", "dead_time"] and then.rivals == ()
    far = replace(turn, fits=(replace(first, misfit=300.0), replace(other, misfit=480.0)))
    assert try_in_place_of_earlier(Problem(recorded(), MODEL, n, seen, values), best, far) == (best, far), (
        "it explained too little"
    )


def of_two(n, name: str, change, seen) -> Fit:
    """A fit beside a dead time found before, confirmed by two twins."""
    made = a_fit(n, name, change, seen)
    beside = MODEL.with_effect(effect("dead_time", tau_us=0.5)).with_effect(effect(name))
    return replace(made, model=beside, prediction=replace(made.prediction, draws=n.draws[:2]))


def test_what_leaves_something_is_put_against_its_runner_up_when_all_is_polished(monkeypatch):
    """The earlier effect had taken some of the true one for its own, so that the wrong one looked better at first."""
    n, change, values, seen = campaign()
    values, seen, change = values + 9 * change, seen + 9 * change, 10 * change
    wrong, true = of_two(n, "light_flicker", 0.5 * change, seen), of_two(n, "supply_ripple", 0.4 * change, seen)
    left = 10_000.0
    first = Round(MODEL, unit(), n.prediction, seen, left, (a_fit(n, "dead_time", change, seen),))
    second = Round(MODEL, unit(), n.prediction, seen, left, (wrong, true), rivals=("supply_ripple",))
    polished = {"light_flicker": 0.5 * change, "supply_ripple": change}
    asked = []

    def polish(problem, found, names):
        asked.append(tuple(names))
        return of_two(n, found.name, polished[found.name], seen), {found.name: {"x": 0.1}}, False

    only_polish(polish, monkeypatch)
    *_, last = joined(Problem(recorded(), MODEL, n, seen, values), [first, second], 0.0)
    assert asked == [("dead_time", "light_flicker"), ("dead_time", "supply_ripple")]
    assert [f.name for f in last.fits] == ["supply_ripple", "light_flicker"] and last.rivals == ()
    polished["light_flicker"] = change
    asked.clear()
    *_, last = joined(Problem(recorded(), MODEL, n, seen, values), [first, second], 0.0)
    assert len(asked) == 1 and last.fits[0].name == "light_flicker", "it leaves nothing"


def test_a_runner_up_that_explained_little_or_was_not_confirmed_is_not_tried_again():
    n, change, _, seen = campaign()
    best, near, far = (of_two(n, name, change, seen) for name in ("light_flicker", "supply_ripple", "crosstalk"))
    best, near, far = (replace(f, misfit=m) for f, m in ((best, 300.0), (near, 390.0), (far, 410.0)))
    turn = Round(MODEL, unit(), n.prediction, seen, 800.0, (best, far, near))
    names = ["dead_time", "light_flicker"]
    assert [f.name for f in runner_up(turn, names, 0.8)] == ["supply_ripple"]
    guess = replace(near, prediction=replace(near.prediction, draws=()))
    assert runner_up(replace(turn, fits=(best, far, guess)), names, 0.8) == []
    assert runner_up(turn, ["lamp_drift", "light_flicker"], 0.8) == [], "the earlier effect is another one now"


def test_a_stand_in_that_makes_recordings_held_out_worse_is_not_kept():
    """It takes the effect up where it was fitted; on held-out recordings it does nothing, or the opposite."""
    n, change, values, seen = campaign()
    case = SimpleNamespace(held_out=lambda keys: ~FIT, conditions=())
    start = Round(MODEL, unit(), n.prediction, change, 800.0)
    patched = MODEL.with_effect(effect("optical_blur", sigma_pixels=0.1))
    for held_out, kept in ((0.5, True), (-1.0, False)):
        found = a_fit(n, "optical_blur", np.where(FIT, 0.9 * change, held_out * change), seen)
        end = Round(patched, unit(), found.prediction, found.rho, found.misfit)
        after = with_stand_ins(case, n, values, [replace(start, fits=(found,)), end])
        assert (after[-1].model is patched) == kept and len(after) == 2 and after[-1].fits == ()


@pytest.mark.parametrize("spoils", [True, False])
def test_rounds_end_with_the_last_that_explains(spoils: bool):
    """A second effect that takes the rest is kept; one that moves statistics that agreed is not."""
    n, change, values, seen = campaign()
    case = SimpleNamespace(held_out=lambda keys: ~FIT, conditions=())
    one, two = MODEL.with_effect(DEAD_TIME), MODEL.with_effect(DEAD_TIME).with_effect(effect("optical_blur"))
    first = a_fit(n, "dead_time", values - n.mean, seen)
    second = a_fit(n, "optical_blur", values - n.mean + spoils * 500.0, seen)
    start = Round(MODEL, unit(), n.prediction, change, 800.0, (first,))
    middle = Round(one, unit(), first.prediction, first.rho, first.misfit, (second,))
    end = Round(two, unit(), second.prediction, second.rho, second.misfit)
    after = with_stand_ins(case, n, values, [start, middle, end])
    assert len(after) == 3 and after[-1].model is (one if spoils else two)


@pytest.mark.parametrize(("takes", "named"), [(0.1, False), (0.2, False), (0.4, True), (1.0, True)])
def test_beside_a_remainder_an_effect_is_named_that_takes_most_of_it(takes: float, named: bool):
    """A law that differs in details leaves much in few statistics, of which other effects take a share.
    Half of a sum of squares is 0.29 of each deviation."""
    n, change, values, seen = campaign()
    values, details = values + 15.0 * change, np.where(np.arange(COUNT) < 3, 0.6, 0.0)
    seen = np.where(FIT, values, np.nan)
    case = SimpleNamespace(held_out=lambda keys: ~FIT, conditions=())
    one, two = MODEL.with_effect(DEAD_TIME), MODEL.with_effect(DEAD_TIME).with_effect(effect("optical_blur"))
    first, second = (
        a_fit(n, name, (1.0 - left * details) * (values - n.mean), seen)
        for name, left in (("dead_time", 1.0), ("optical_blur", 1.0 - takes))
    )
    assert explains(n, values, first.prediction) and squares_left(n, values, first.prediction) > 0.0
    start = Round(MODEL, unit(), n.prediction, change, 800.0, (first,))
    middle = Round(one, unit(), first.prediction, first.rho, first.misfit, (second,))
    end = Round(two, unit(), second.prediction, second.rho, second.misfit)
    after = with_stand_ins(case, n, values, [start, middle, end])
    assert after[-1].model is (two if named else one)


@pytest.mark.parametrize(("left", "off"), [(0.0, False), (0.6, True), (1.0, True)])
def test_beside_an_effect_a_parameter_is_off_only_if_the_given_one_leaves_more(left: float, off: bool, monkeypatch):
    """left: the share that the effect leaves of three statistics with the nominal parameters.  With the unit's own it
    leaves nothing."""
    n, change, values, seen = campaign()
    values = values + 15.0 * change
    noisy = exact_refit(MODEL.with_effect(effect("reset_noise", sigma_mV=25.0)).draw_unit((128, 128), 5))
    problem = replace(Problem.of(recorded(), MODEL, n, values), seen=np.where(FIT, values, np.nan))
    own, given = (
        a_fit(n, "dead_time", (1.0 - x * (np.arange(COUNT) < 3)) * (values - n.mean), seen) for x in (0.0, left)
    )
    monkeypatch.setattr(verdict, "confirmed", lambda problem, found, count: replace(found, prediction=given.prediction))
    end = Round(MODEL.with_effect(DEAD_TIME), noisy, own.prediction, own.rho, own.misfit)
    after = verdict.with_given_parameters(problem, MODEL, [end])
    assert (after[-1].base.white == noisy.white) == off
    assert verdict.with_given_parameters(problem, MODEL, [replace(end, model=MODEL)])[-1].base is noisy, "no effect"


@pytest.mark.parametrize("keeps", [True, False])
def test_what_explains_nothing_any_more_once_polished_is_not_added(keeps: bool, monkeypatch):
    n, effect, values, _ = campaign()
    found = replace(a_fit(n, "dead_time", effect, values), model=MODEL.with_effect(DEAD_TIME))
    faded = replace(found, prediction=n.prediction, misfit=residual_and_misfit(n, values, n.prediction)[1])

    def polished(*given):
        *before, last = given[1]
        return [*before, replace(last, fits=(found if keeps else faded, *last.fits[1:]))]

    monkeypatch.setattr(search, "with_candidates", lambda *given: replace(given[-1], fits=(found,)))
    rounds = selected(OfAll(), n, values, monkeypatch, joined=polished)
    assert rounds[-1].model is (found.model if keeps else MODEL)


@pytest.mark.parametrize("spent, begun", [(43, True), (44, False)])
def test_a_second_effect_is_begun_where_enough_effort_is_left_for_it(spent: int, begun: bool, monkeypatch):
    """Of sixty recordings, and three tenths more, it takes two campaigns of BESIDE."""
    n, effect, values, _ = campaign()
    found = replace(a_fit(n, "dead_time", effect, values), model=MODEL.with_effect(DEAD_TIME))
    case = OfAll(budget=Budget(60), conditions=(None, None))
    asked = []

    def compared(*given):
        asked.append(given[-1])
        case.budget.spent.append(spent)
        return replace(given[-1], fits=(found,) if len(asked) == 1 else ())

    monkeypatch.setattr(search, "with_candidates", compared)
    monkeypatch.setattr(search, "is_significant", lambda *_: True)
    monkeypatch.setattr(search, "is_small_share", lambda *_: False)
    n = replace(n, settings=DiagnosisSettings(searching=Searching(campaigns_per_effect=17)))
    selected(case, n, values, monkeypatch)
    assert len(asked) == 1 + begun and case.budget.left_out == ([] if begun else ["a second effect"])


@pytest.mark.parametrize("share, opened", [(0.5, True), (0.8, True), (0.95, False)])
def test_dark_levels_are_open_beside_the_noise_of_an_effect(share: float, opened: bool, monkeypatch):
    """share: of the refit's s^2 that is the unit's own.  Slow pixels lock to a ripple, whatever the severity."""
    n, change, values, _ = campaign()
    found = replace(a_fit(n, "dead_time", change, values), model=MODEL.with_effect(DEAD_TIME))
    found = replace(found, base=replace(unit(), white=share * unit().white))
    asked = []
    monkeypatch.setattr(search, "with_candidates", lambda *given: replace(given[-1], fits=(found,)))
    monkeypatch.setattr(search, "with_dark_levels_open", lambda *given: asked.append(given) or given[-1])
    selected(OfAll(), n, values, monkeypatch)
    assert bool(asked) == opened


@pytest.mark.parametrize("strength, added", [(0.2, True), (0.0, False)])
def test_an_effect_that_fades_to_nothing_is_not_added(strength: float, added: bool, monkeypatch):
    n, change, values, _ = campaign()
    model = MODEL.with_effect(effect("dead_time", tau_us=strength))
    found = replace(a_fit(n, "dead_time", change, values), model=model)
    monkeypatch.setattr(search, "with_candidates", lambda *given: replace(given[-1], fits=(found,)))
    rounds = selected(OfAll(), n, values, monkeypatch)
    assert (rounds[-1].model is model) == added


def test_a_second_effect_is_looked_for_beside_one_that_takes_little(monkeypatch):
    """The first removes a twentieth of the misfit beyond chance."""
    n, change, values, _ = campaign()
    asked = []

    def compared(*given):
        turn = given[-1]
        asked.append(turn.misfit)
        found = replace(a_fit(n, "dead_time", change, values), misfit=turn.misfit - 0.05 * (turn.misfit - COUNT))
        return replace(turn, fits=(found,) if len(asked) == 1 else ())

    monkeypatch.setattr(search, "with_candidates", compared)
    monkeypatch.setattr(search, "has_candidate", lambda *_: True)
    monkeypatch.setattr(search, "is_improvement", lambda *_: True)
    monkeypatch.setattr(search, "is_significant", lambda *_: True)
    selected(OfAll(), n, values, monkeypatch)
    assert len(asked) == 2


@pytest.mark.parametrize("removed, tried", [(0.4, False), (0.6, True)])
def test_a_runner_up_of_an_earlier_round_has_to_have_removed_half_of_what_its_effect_did(removed: float, tried: bool):
    n, change, values, seen = campaign()
    best = of_two(n, "crosstalk", change, seen)
    first, other = (replace(best, name=name) for name in ("dead_time", "comparator_delay"))
    fits = (replace(first, misfit=300.0), replace(other, misfit=500.0 - 200.0 * removed))
    turn = Round(MODEL, unit(), n.prediction, values, 500.0, fits)
    case = SimpleNamespace(budget=Budget(0))
    try_in_place_of_earlier(Problem(case, MODEL, n, seen, values), best, turn)
    assert bool(case.budget.left_out) is tried


def test_four_runners_up_are_tried_in_place_of_an_earlier_effect_at_most(monkeypatch):
    n, change, values, seen = campaign()
    best = of_two(n, "crosstalk", change, seen)
    names = ("dead_time", "comparator_delay", "ir_drop", "readout_skew", "optical_blur", "missed_spikes")
    turn = Round(MODEL, unit(), n.prediction, values, 500.0, tuple(replace(best, name=m, misfit=300.0) for m in names))
    asked = []
    monkeypatch.setattr(neighbours, "confirmed", lambda problem, found: found)
    monkeypatch.setattr(neighbours, "resettled", lambda problem, found, model: replace(found, model=model))
    monkeypatch.setattr(
        neighbours, "fit", lambda problem, name, start: asked.append(name) or replace(best, name=name, misfit=1e4)
    )
    try_in_place_of_earlier(Problem(recorded(), MODEL, n, seen, values), best, turn)
    assert len(asked) == 4


def test_three_effects_are_looked_for_at_most(monkeypatch):
    n, change, values, _ = campaign()
    names = iter(("dead_time", "crosstalk", "readout_skew", "optical_blur"))
    rounds = []

    def candidates(*given):
        turn = given[-1]
        found = a_fit(n, next(names), change, values)
        rounds.append(replace(turn, fits=(replace(found, misfit=turn.misfit - 100.0, model=turn.model),)))
        return rounds[-1]

    monkeypatch.setattr(search, "with_candidates", candidates)
    monkeypatch.setattr(search, "has_candidate", lambda *_: True)
    monkeypatch.setattr(search, "is_improvement", lambda *_: True)
    monkeypatch.setattr(search, "is_significant", lambda *_: True)
    monkeypatch.setattr(search, "is_small_share", lambda *_: False)
    assert len(selected(OfAll(), n, values, monkeypatch)) == 3 + 1
