"""Confirmation: a fit from one twin is repeated with more twins, on held-out recordings too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from spikecam_env.gap.candidates.strength import MOST_EXTRAPOLATED, amplified, with_effect
from spikecam_env.gap.candidates.table import Candidates, candidate
from spikecam_env.gap.compare.distance import effect_size
from spikecam_env.gap.compare.prediction import Null, Prediction, with_change_scaled
from spikecam_env.gap.fit.hypothesis import Fit
from spikecam_env.gap.fit.problem import OF_RANDOM_COURSE, Problem, twins_of, with_held_out
from spikecam_env.gap.fit.slopes import Slopes, is_in_proportion
from spikecam_env.gap.twins.case import refit_recordings
from spikecam_env.gap.twins.fresh_units import drawn_response
from spikecam_env.gap.unit.conversion import LINES
from spikecam_env.gap.unit.indirect_inference import IDENTIFIABLE, extrapolated_unit
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import SensorModel


def confirmed(problem: Problem, fitted: Fit, count: int | None = None) -> Fit:
    """The fit simulated with more draws, on the recordings held out as well.

    Args:
        count: number of twins, more where its effects need more; default: as many as confirm a candidate.
    """
    twins = problem.settings.twins
    count = twins.to_confirm if count is None else count
    case, model, null = problem.case, problem.model, problem.null
    added = [e.name for e in fitted.model.effects if e not in model.effects]
    problem.begin(f"confirming {', '.join(added or [fitted.name])}")
    effects = Candidates(tuple(added))
    predicted = null.prediction
    if not (added and effects.all_pattern and not set(added) & set(LINES)):
        only = problem.affected(added or [fitted.name], fitted.prediction.mean - null.mean)
        needed = (OF_RANDOM_COURSE if c.random_course else twins_of(c.name) for c in effects.each)
        count = max(count, *needed, 1)
        recordings = with_held_out(case, only)
        stronger, times = fitted, 1.0
        severe = fitted.base.white < IDENTIFIABLE * case.base.white
        if len(added) == 1 and not severe and not candidate(added[0]).is_pattern:
            stronger, times = amplified_fit(problem, fitted, added[0])
        predicted = problem.predict(stronger.model, constrained_refit(stronger.model, stronger.base), count, recordings)
        predicted = attenuated(null, predicted, times) if times > 1.0 else predicted
        if severe:
            bare = problem.predict(model, constrained_refit(model, fitted.base), 1, recordings)
            predicted = replace(predicted, own=predicted.mean - bare.mean)
    if effects.any_pattern:
        predicted = problem.with_pattern(fitted.model, predicted)
    if len(added) == 1 and is_in_proportion(added[0]) and predicted.own is None:
        slopes = Slopes.by_proportion(null, problem.seen, added[0], fitted.model, predicted)
        fitted = replace(fitted, slopes=slopes)
    return with_prediction(problem, fitted, predicted)


def with_prediction(problem: Problem, fitted: Fit, predicted: Prediction) -> Fit:
    """The fit by another prediction of it."""
    rho, left = problem.residual_and_misfit(predicted)
    return replace(fitted, prediction=predicted, rho=rho, misfit=left)


def amplified_fit(problem: Problem, fitted: Fit, name: str) -> tuple[Fit, float]:
    """(fit, factor): its effect made stronger (`strength.amplified`), and its unit extrapolated."""
    [effect] = [e for e in fitted.model.effects if e.name == name]
    size = effect_size(problem.null, problem.seen, fitted.prediction.mean - problem.null.mean)
    bare = constrained_refit(problem.model, problem.case.base)
    parameters, times = amplified(name, effect.parameters(), size)
    base = extrapolated_unit(bare, fitted.base, times, MOST_EXTRAPOLATED)
    return replace(fitted, model=with_effect(fitted.model, name, parameters), base=base), times


def attenuated(null: Null, stronger: Prediction, times: float) -> Prediction:
    """Scale the prediction of an effect that was simulated `times` as strong down to its strength, with its draws."""
    without = {d.number: d for d in null.draws}
    draws = tuple(
        replace(
            d,
            values=w.values + (d.values - w.values) / times,
            refit=extrapolated_unit(w.refit, d.refit, 1 / times, MOST_EXTRAPOLATED) if w.refit and d.refit else d.refit,
        )
        for d, w in ((d, without[d.number]) for d in stronger.draws)
    )
    return replace(with_change_scaled(null, stronger, 1 / times), draws=draws)


def with_dark_levels_open(problem: Problem, model: SensorModel, base: BaseFit, predicted: Prediction) -> Prediction:
    """Add the error of unknown dark levels, those of a fresh unit of the model, to a prediction.

    Slow pixels lock to a severe noise, and a refit then does not show how they differ.
    """
    _, dark = drawn_response(model, base, problem.case.shape, problem.case.seed)
    other = problem.predict(model, constrained_refit(model, replace(base, dark=dark)), 1)
    here = next(d for d in predicted.draws if d.number == other.draws[-1].number)
    change = np.nan_to_num(other.draws[-1].values - here.values)
    return replace(predicted, error=np.hypot(predicted.error, change))


def resettled(problem: Problem, fitted: Fit, model: SensorModel) -> Fit:
    """The fit with another model, and its unit settled under it, by the recordings that a refit rests on."""
    base = constrained_refit(model, fitted.base)
    made = problem.predict(model, base, 1, sorted(refit_recordings(problem.case)))
    return replace(fitted, model=model, base=problem.settled_unit(model, base, made))


def no_more_certain(problem: Problem, fitted: Fit, known: Prediction) -> Fit:
    """The fit with errors and scatter no smaller than those of a prediction of the same effects."""
    here = fitted.prediction
    spread, error = np.maximum(here.spread, known.spread), np.maximum(here.error, known.error)
    return with_prediction(problem, fitted, replace(here, spread=spread, error=error))
