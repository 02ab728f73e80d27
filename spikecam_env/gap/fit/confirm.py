"""A fit rests on one twin; more confirm it, on the recordings held out as well, and beside what was found before."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.candidates.strength import as_loud, with_effect
from spikecam_env.gap.candidates.table import candidate, is_pattern
from spikecam_env.gap.compare.distance import alarmed, judged, residual, size_of
from spikecam_env.gap.compare.prediction import Null, Prediction, scaled
from spikecam_env.gap.fit.candidate import (
    MANY,
    WANDER,
    Fit,
    as_seen,
    concerned,
    predict,
    twins_of,
    with_held_out,
    with_pattern,
)
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.twins.fresh_units import drawn
from spikecam_env.gap.unit.conversion import LINES
from spikecam_env.gap.unit.indirect_inference import IDENTIFIABLE, extrapolated_unit
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]

NEEDED = 15.0
"""Misfit by which an effect found earlier has to be missed, once another has been added, to be kept."""

PLAINLY = 10 * NEEDED
"""Misfit by which it is missed beyond what a unit refitted without it could make up for."""

AGAIN, FINAL = 2, 4
"""Twins by which a candidate is confirmed, and what was chosen of them in the end."""


def confirmed(case: Case, model: SensorModel, null: Null, measured: Array, found: Fit, count: int = AGAIN) -> Fit:
    """The fit simulated with more draws, on the recordings held out as well."""
    added = [e.name for e in found.model.effects if e not in model.effects]
    predicted = null.prediction
    if not (added and all(is_pattern(name) and name not in LINES for name in added)):
        only = concerned(case, added or [found.name], null, measured, found.prediction.mean - null.mean)
        count = max(count, *(WANDER if candidate(name).wanders else twins_of(name) for name in added), 1)
        there = with_held_out(case, only)
        loud, times = found, 1.0
        severe = found.base.white < IDENTIFIABLE * case.base.white
        if len(added) == 1 and not severe and not is_pattern(added[0]):
            loud, times = made_loud(case, model, null, measured, found, added[0])
        predicted = predict(case, loud.model, constrained_refit(loud.model, loud.base), null, count, there)
        predicted = quietened(null, predicted, times) if times > 1.0 else predicted
        if severe:
            bare = predict(case, model, constrained_refit(model, found.base), null, 1, there)
            predicted = replace(predicted, own=predicted.mean - bare.mean)
    if any(is_pattern(name) for name in added):
        predicted = with_pattern(case, found.model, null, predicted)
    return rejudged(null, measured, found, predicted)


def made_sure(case: Case, model: SensorModel, null: Null, seen: Array, values: Array, found: Fit) -> Fit:
    """The fit, by as many draws as the null has where those it stands on are too few to say whether it leaves anything,
    and by MANY units where what it leaves is of the pattern.

    seen, values: (S,) of the recordings to fit (NaN elsewhere), and of all.
    """
    pattern = found.prediction.units is not None and alarmed(null, of_pattern(null, values, found), found.prediction)
    if pattern:
        found = rejudged(null, seen, found, with_pattern(case, found.model, null, found.prediction, MANY))
    left = [residual(null, measured, found.prediction) for measured in (seen, values)]
    if not any(alarmed(null, rho) and not alarmed(null, rho, found.prediction) for rho in left):
        return found
    sure = confirmed(case, model, null, seen, found, len(null.draws)).prediction
    sure = with_pattern(case, found.model, null, sure, MANY) if pattern else sure
    return rejudged(null, seen, found, replace(sure, error=np.maximum(sure.error, found.prediction.error)))


def rejudged(null: Null, seen: Array, found: Fit, predicted: Prediction) -> Fit:
    """The fit by another prediction of it."""
    rho, left = judged(null, seen, predicted)
    return replace(found, prediction=predicted, rho=rho, misfit=left)


def of_pattern(null: Null, values: Array, found: Fit) -> Array:
    """(S,) what a fit leaves of the pattern, in noise; 0 elsewhere."""
    there = np.array([k.group == "pattern" for k in null.keys])
    return np.where(there, residual(null, values, found.prediction), 0.0)


def made_loud(case: Case, model: SensorModel, null: Null, measured: Array, found: Fit, name: str) -> tuple[Fit, float]:
    """(fit, times as strong) with the effect that it adds to `model`, and its unit, as `as_loud`."""
    [effect] = [e for e in found.model.effects if e.name == name]
    size = size_of(null, measured, found.prediction.mean - null.mean)
    parameters, times = as_loud(name, effect.parameters(), size)
    base = extrapolated_unit(constrained_refit(model, case.base), found.base, times)
    return replace(found, model=with_effect(found.model, name, parameters), base=base), times


def quietened(null: Null, loud: Prediction, times: float) -> Prediction:
    """A prediction of an effect simulated `times` as strong, and its draws, brought down to its strength."""
    without = {d.number: d for d in null.draws}
    draws = tuple(
        replace(
            d,
            values=w.values + (d.values - w.values) / times,
            refit=extrapolated_unit(w.refit, d.refit, 1 / times) if w.refit and d.refit else d.refit,
        )
        for d, w in ((d, without[d.number]) for d in loud.draws)
    )
    return replace(scaled(null, loud, 1 / times), draws=draws)


def of_any_dark(case: Case, model: SensorModel, base: BaseFit, null: Null, predicted: Prediction) -> Prediction:
    """A prediction known no better than the dark levels of a fresh unit of the model would change it.

    Slow pixels lock to a severe noise, or drown in it: a refit then does not show how they differ.
    """
    _, dark = drawn(model, base, case.shape, case.seed)
    other = predict(case, model, constrained_refit(model, replace(base, dark=dark)), null, 1)
    here = next(d for d in predicted.draws if d.number == other.draws[-1].number)
    change = np.nan_to_num(other.draws[-1].values - here.values)
    return replace(predicted, error=np.hypot(predicted.error, change))


def resettled(case: Case, null: Null, found: Fit, model: SensorModel) -> Fit:
    """The fit with another model, and its unit settled under it."""
    base = constrained_refit(model, found.base)
    return replace(found, model=model, base=as_seen(model, base, null, predict(case, model, base, null, 1)))


def rejoined(
    case: Case, model: SensorModel, null: Null, measured: Array, found: Fit, earlier: Mapping[str, Array]
) -> Fit:
    """All effects found so far together; one that is no longer needed is left out again.

    model, null: as given, before any was added.  earlier: (S,) what each effect changed when it was added, by name; one
    whose change is plainly missed is not simulated without.  Two twins may scatter little where the many that `found`
    stands on have shown that campaigns do not.
    """
    both = confirmed(case, model, null, measured, resettled(case, null, found, found.model))
    both = as_wide(null, measured, both, found.prediction)
    for name, change in earlier.items():
        if name not in {e.name for e in both.model.effects} or is_missed(null, measured, both, change):
            continue
        fewer = confirmed(case, model, null, measured, resettled(case, null, both, both.model.without(name)))
        if fewer.misfit < both.misfit + NEEDED:
            both = fewer
    return both


def is_missed(null: Null, measured: Array, found: Fit, change: Array) -> bool:
    """Whether a prediction less a change of its statistics leaves PLAINLY more: twins without it would say the same."""
    without = replace(found.prediction, mean=found.prediction.mean - change)
    return judged(null, measured, without)[1] > found.misfit + PLAINLY


def as_wide(null: Null, measured: Array, found: Fit, known: Prediction) -> Fit:
    """The fit known no better, and its campaigns scattering no less, than a prediction of the same effects."""
    here = found.prediction
    spread, error = np.maximum(here.spread, known.spread), np.maximum(here.error, known.error)
    return rejudged(null, measured, found, replace(here, spread=spread, error=error))
