"""More twins of a fit, stronger ones of a weak effect, and the errors under severe noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small import MODEL, TWINS, effect, null, problem_of, recorded

from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.candidates.strength import MOST_EXTRAPOLATED, with_effect
from spikecam_env.gap.compare.distance import effect_size, is_significant, residual
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.fit.candidate import fit
from spikecam_env.gap.fit.confirm import amplified_fit, attenuated, confirmed, with_dark_levels_open
from spikecam_env.gap.fit.predict import predict_by_twins, with_drawn_pattern
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.search.neighbours import try_more_draws
from spikecam_env.gap.unit.refit import constrained_refit


@pytest.mark.slow
def test_a_weak_effect_is_told_by_louder_twins_as_well_as_by_many():
    """A dead time that shows by some noises: two twins of it some times as strong, or all twelve of it as it is."""
    case = recorded(effect("dead_time", tau_us=0.02))
    without = model_null(case, MODEL, TWINS)
    measured = values_of(case.bank, without.keys)
    problem = problem_of(case, without)
    found = fit(problem, "dead_time", {"tau_us": 0.02})
    size = effect_size(without, measured, found.prediction.mean - without.mean)
    loud, times = amplified_fit(problem, found, "dead_time")
    assert 1 < times <= MOST_EXTRAPOLATED and loud.parameters == found.parameters
    which = [i for i, c in enumerate(case.conditions) if c.use == "fit"]
    many = predict_by_twins(case, found.model, found.base, without, TWINS, which)
    few = predict_by_twins(case, found.model, found.base, without, 2, which)
    louder = attenuated(without, predict_by_twins(case, loud.model, loud.base, without, 2, which), times)
    off = [float(np.sqrt(np.mean(((p.mean - many.mean) / without.noise) ** 2))) for p in (few, louder)]
    print(f"shows by {size:.1f}; two twins are {off[0]:.2f} noises off, {times:.2f} times as loud {off[1]:.2f}")
    assert off[1] < 0.7 * off[0]
    draws = np.mean([d.values for d in louder.draws], axis=0) - np.mean([d.values for d in without.draws[-2:]], axis=0)
    np.testing.assert_allclose(louder.mean - without.mean, np.nan_to_num(draws), atol=1e-9)


@pytest.mark.slow
def test_what_slow_pixels_do_under_a_severe_noise_is_open_where_they_are_not_known():
    """Dark levels all alike, as of pixels that have locked to the noise, against those of a fresh unit; bright light
    does not depend on them."""
    case, without = recorded(), null()
    loud = with_effect(MODEL, "common_threshold_noise", {"sigma_mV": 20.0})
    alike = constrained_refit(loud, replace(case.base, dark=np.full_like(case.base.dark, np.median(case.base.dark))))
    made = predict_by_twins(case, loud, alike, without, 2)
    wider = with_dark_levels_open(Problem(case, MODEL, without, without.mean, without.mean), loud, alike, made)
    more = dict(zip(without.keys, np.sqrt(wider.error**2 - made.error**2) / without.noise, strict=True))
    slopes = {k.recording: more[k] for k in without.keys if k.name == "slope"}
    print(slopes)
    np.testing.assert_array_equal(wider.mean, made.mean)
    assert slopes["flat-0.03"] > 3 and slopes["flat-0.65"] < 3


def test_more_twins_say_whether_something_is_left_where_two_cannot():
    """Statistics 50 noises off: by two twins that happened to scatter by four this is chance, by all twelve it is not.
    A good fit needs no more twins."""
    case, without = recorded(effect("dead_time", tau_us=0.5)), null()
    found = fit(problem_of(case, without), "dead_time", {"tau_us": 0.5})
    two = predict_by_twins(case, found.model, found.base, without, 2)
    found = replace(found, prediction=replace(two, spread=4.0 * without.sd))
    suits = found.prediction.mean
    assert try_more_draws(Problem(case, MODEL, without, suits, suits), found) is found
    off = suits + np.where([k.group == "timing" for k in without.keys], 50.0 * without.sd, 0.0)
    sure = try_more_draws(Problem(case, MODEL, without, off, off), found)
    left = [is_significant(without, residual(without, off, f.prediction), f.prediction) for f in (found, sure)]
    print(left, len(sure.prediction.draws))
    assert left == [False, True]
    assert len(sure.prediction.draws) == TWINS and sure.model == found.model
    assert np.all(sure.prediction.error >= found.prediction.error)


@pytest.mark.slow
def test_a_column_that_few_units_have_is_no_surprise_to_many():
    """Columns of 100 mV, one of them 3 deviations off: none of the first two dozen units has pixels that far out; of
    240 some have.  A larger deviation is still left."""
    case, without = recorded(effect("column_fixed_pattern", sigma_mV=100.0)), null()
    model = with_effect(MODEL, "column_fixed_pattern", {"sigma_mV": 100.0})
    problem = Problem.of(case, MODEL, without, values_of(case.bank, without.keys))
    base = constrained_refit(model, case.base)
    found = confirmed(problem, problem.fit_of("column_fixed_pattern", {}, model, base, without.prediction))
    few, many = found.prediction, with_drawn_pattern(case, model, without, without.prediction, 240)
    at = next(i for i, k in enumerate(without.keys) if k.name == "over 5" and k.recording == "flat-0.2")
    tops = [float(np.max(p.units[:, at])) for p in (few, many)]
    values = np.where(np.arange(len(without.keys)) == at, np.nextafter(tops[1], 0.0), few.mean)
    sure = try_more_draws(Problem(case, MODEL, without, values, values), found)
    print(f"of {len(few.units)} units {tops[0]:.1f}, of {len(sure.prediction.units)} {tops[1]:.1f}")
    assert tops[1] > tops[0]
    left = [is_significant(without, residual(without, values, f.prediction), f.prediction) for f in (found, sure)]
    assert left == [True, False]
    off = np.where(np.arange(len(values)) == at, 10 * tops[1], sure.prediction.mean)
    assert is_significant(without, residual(without, off, sure.prediction), sure.prediction)
