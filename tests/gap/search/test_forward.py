"""Which candidate is chosen: by the recordings to fit, and between rivals by those held out."""

from __future__ import annotations

import numpy as np
import pytest
from small import MODEL, TWINS, made_up_null, recorded, unit

from spikecam_env.gap.compare.distance import residual_and_misfit
from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.fit.hypothesis import Fit, Hypothesis
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.search.choice import chosen_of, is_rival, lead
from spikecam_env.gap.settings import Deviance

DEVIANCE = Deviance()

COUNT = 200
FIT = np.arange(COUNT) < 150
"""Statistics of the recordings to fit; the others are held out."""


def a_fit(n: Null, name: str, change, seen) -> Fit:
    prediction = Prediction(n.mean + change, n.sd / np.sqrt(TWINS), n.sd)
    rho, left = residual_and_misfit(n, seen, prediction)
    at = Hypothesis(model=MODEL, base=unit(), prediction=prediction, rho=rho, misfit=left)
    return Fit(**vars(at), name=name, parameters={}, sd={})


def campaign():
    """An effect of 4 noises on 50 statistics to fit and on all that are held out."""
    n = made_up_null(COUNT)
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


def test_recordings_held_out_have_no_say_where_the_others_tell():
    """The wrong one is perfect where it is not asked, and has nothing to offer where it is."""
    n, effect, values, seen = campaign()
    wrong = a_fit(n, "crosstalk", np.where(FIT, np.roll(effect * FIT, 60), values - n.mean), seen)
    fits, rivals = chosen_of(
        Problem(recorded(), MODEL, n, seen, values), n.draws, [a_fit(n, "dead_time", effect, seen), wrong]
    )
    assert fits[0].name == "dead_time" and rivals == ()
    assert chosen_of(Problem(recorded(), MODEL, n, seen, values), n.draws, []) == ([], ())
