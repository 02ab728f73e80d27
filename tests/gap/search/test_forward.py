"""Which candidate is chosen: by the recordings to fit, and between rivals by those held out."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small import MODEL, effect, recorded, unit

from spikecam_env.gap.compare.distance import residual_and_misfit
from spikecam_env.gap.compare.prediction import Draw, Null, Prediction
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.search.choice import PER_PARAMETER, chosen_of
from spikecam_env.gap.search.rivals import is_rival, lead
from spikecam_env.gap.search.round import Round, is_visible
from spikecam_env.gap.settings import Deviance
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.verdict.remainder import explains, squares_left
from spikecam_env.gap.verdict.verdict import with_stand_ins

DEVIANCE = Deviance()

COUNT, TWINS = 200, 12
DEAD_TIME = effect("dead_time", tau_us=0.2)
FIT = np.arange(COUNT) < 150
"""Statistics of the recordings to fit; the others are held out."""


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
