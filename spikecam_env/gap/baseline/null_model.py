"""The null model: a model's prediction for a case, by twins of its unit, and by drawn units for the pattern."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from spikecam_env.gap.compare.prediction import Null, null_of, values_of
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.twins.case import Case, twins
from spikecam_env.gap.twins.rate_maps import MapCase
from spikecam_env.gap.unit.indirect_inference import inferred_unit
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats

LEAST_NOISE = 1e-3
"""Of its floor, the noise of a statistic that no fresh unit moves."""


def model_null(case: Case, model: SensorModel, count: int) -> Null:
    """The prediction of `count` twins, and of twice as many for recordings in motion.

    A statistic in motion is of one recording alone, so that no other one pools its variance (`pooled_variance`).

    Args:
        case: the measurement.
        model: its effects.
        count: number of twins.
    """
    base, units = unit_under(case, model), case.settings.twins.drawn_units
    drawn = case.drawn_banks(model, units)
    made = twins(case, model, base, range(count))
    banks = [{**t.bank, **d} for t, d in zip(made, drawn, strict=False)]
    null = null_of(banks, list(case.bank), [t.base for t in made if t.base], case.settings)
    own = [values_of(t.pattern, null.keys) for t in made]
    null = replace(null, draws=tuple(replace(d, pattern=p) for d, p in zip(null.draws, own, strict=False)))
    moving = [i for i, c in enumerate(case.conditions) if c.moves and c.use == "fit"]
    if moving:
        null = with_more_twins(null, [t.bank for t in twins(case, model, base, range(count, 2 * count), moving)])
    values = np.array([[d.get(k, np.nan) for k in null.keys] for d in drawn])
    of_pattern = np.array([k.group == "pattern" for k in null.keys])
    return replace(
        null,
        mean=np.where(of_pattern, values.mean(axis=0), null.mean),
        sd=np.where(of_pattern, values.std(axis=0, ddof=1), null.sd),
        freedom=np.where(of_pattern, units - 1, null.freedom),
        twins=np.where(of_pattern, units, null.twins),
        weight=np.where(of_pattern, 1.0 / recordings_per_statistic(null.keys, case.conditions), 1.0),
    )


def maps_null(case: MapCase, model: SensorModel) -> Null:
    """The prediction of maps of rates, by fresh units."""
    banks = case.drawn_banks(model, case.settings.twins.drawn_units)
    null = null_of(banks, list(case.bank), [None] * len(banks), case.settings)
    return replace(null, sd=np.maximum(null.sd, LEAST_NOISE * null.floor))


def unit_under(case: Case, model: SensorModel) -> BaseFit:
    """The unit of a case under a model: the constrained refit; of scenes alone, which are too short for the closed law
    of jitter, by indirect inference."""
    base = constrained_refit(model, case.base)
    if case.scenes_only:
        simulated = [t.base for t in twins(case, model, base, range(50, 54)) if t.base]
        base = inferred_unit(model, base, case.base, simulated)
    return base


def with_more_twins(null: Null, more: Sequence[Mapping[StatisticKey, float]]) -> Null:
    """The null with further twins of some recordings, for the statistics of these."""
    values = np.array([*(d.values for d in null.draws), *(values_of(bank, null.keys) for bank in more)])
    known = np.isfinite(values).all(axis=0)
    return replace(
        null,
        mean=np.where(known, values.mean(axis=0), null.mean),
        sd=np.where(known, values.std(axis=0, ddof=1), null.sd),
        twins=np.where(known, len(values), null.twins),
        freedom=np.where(known, len(values) - 1, null.freedom),
    )


def recordings_per_statistic(keys: Sequence[StatisticKey], conditions: Sequence[Condition]) -> Floats:
    """(S,) recordings of use fit with the same statistic of the one fixed pattern, dark or lit, counted; 1 at least."""
    lit = {c.name: c.kind != "dark" for c in conditions}
    fit = {c.name for c in conditions if c.use == "fit"}
    kind = [(k.name, lit[k.recording]) for k in keys]
    counts = Counter(one for one, k in zip(kind, keys, strict=True) if k.recording in fit)
    return np.array([max(counts[one], 1) for one in kind], dtype=np.float64)
