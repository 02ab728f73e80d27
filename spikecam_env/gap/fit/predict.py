"""Predictions of a model with effects: twins of the null's draws, drawn units for the pattern, its unit settled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from spikecam_env.gap.compare.prediction import Draw, Null, Prediction, paired, values_of, with_pattern_moved
from spikecam_env.gap.twins.case import Case, twins
from spikecam_env.gap.unit.false_spikes import false_spikes_of
from spikecam_env.gap.unit.indirect_inference import inferred_unit
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.gap.unit.traps import traps_of
from spikecam_env.sensor import SensorModel


def predict_by_twins(
    case: Case, model: SensorModel, base: BaseFit, null: Null, count: int, only: Sequence[int] | None = None
) -> Prediction:
    """Predict a model with effects by twins of the null's last `count` draws.

    Recordings that are not in `only` (by index) are as in `null`.  Twins of maps of rates are fresh units.
    """
    if case.rates_only:
        return with_drawn_pattern(case, model, null, null.prediction)
    numbers = [d.number for d in null.draws[-count:]]
    made = twins(case, model, base, numbers, only, {d.number: d.refit for d in null.draws})
    draws = [
        Draw(n, values_of(t.bank, null.keys), t.base, values_of(t.pattern, null.keys))
        for n, t in zip(numbers, made, strict=True)
    ]
    predicted = paired(null, [with_pattern_moved(null, d) for d in draws])
    changes_pattern = traps_of(model) or false_spikes_of(model)
    return with_drawn_pattern(case, model, null, predicted) if changes_pattern else predicted


def with_drawn_pattern(
    case: Case, model: SensorModel, null: Null, predicted: Prediction, count: int | None = None
) -> Prediction:
    """Replace the pattern statistics of a prediction by those of `count` units; None: as many as the null has."""
    count = null.settings.twins.drawn_units if count is None else count
    values = np.array([values_of(b, null.keys) for b in case.drawn_banks(model, count)])
    known = np.isfinite(values).all(axis=0)
    values = np.where(known, values, 0.0)
    mean = np.where(known, values.mean(axis=0), predicted.mean)
    spread = np.where(known, np.maximum(values.std(axis=0, ddof=1), null.sd), predicted.spread)
    error = np.where(known, spread / np.sqrt(count), predicted.error)
    return replace(predicted, mean=mean, error=error, spread=spread, units=np.where(known, values, np.nan))


def settled_unit(model: SensorModel, base: BaseFit, null: Null, predicted: Prediction) -> BaseFit:
    """Indirect inference: adjust the unit until its twin with the effect refits to the null twin's refit without it."""
    [without] = [d.refit for d in null.draws if d.number == predicted.draws[-1].number]
    refit = predicted.draws[-1].refit
    if not (without and refit):
        return base
    return inferred_unit(model, base, without, [refit])
