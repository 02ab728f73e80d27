"""What a model predicts for a case: twins of its unit, and drawn units for the pattern."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.compare.prediction import Null, null_of, values_of
from spikecam_env.gap.observe.conditions import Shown
from spikecam_env.gap.statistics import Key
from spikecam_env.gap.twins.case import Case, twins
from spikecam_env.gap.twins.fresh_units import DRAWN_UNITS, drawn_banks
from spikecam_env.gap.unit.indirect_inference import settled
from spikecam_env.gap.unit.refit import BaseFit, within
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]


def model_null(case: Case, model: SensorModel, count: int) -> Null:
    """The prediction of `count` twins, and of recordings in motion as many again: of their statistics there is one of
    a kind, and no other recording tells how much it varies (`pooled_variance`)."""
    base = unit_under(case, model)
    drawn = drawn_banks(model, case.base, case.conditions, case.shape, DRAWN_UNITS, case.seed)
    made = twins(case, model, base, range(count))
    banks = [{**t.bank, **d} for t, d in zip(made, drawn, strict=False)]
    null = null_of(banks, list(case.bank), [t.base for t in made if t.base])
    moving = [i for i, c in enumerate(case.conditions) if c.moves and c.use == "fit"]
    if moving:
        null = surer(null, [t.bank for t in twins(case, model, base, range(count, 2 * count), moving)])
    values = np.array([[d.get(k, np.nan) for k in null.keys] for d in drawn])
    of_pattern = np.array([k.group == "pattern" for k in null.keys])
    return replace(
        null,
        mean=np.where(of_pattern, values.mean(axis=0), null.mean),
        sd=np.where(of_pattern, values.std(axis=0, ddof=1), null.sd),
        freedom=np.where(of_pattern, DRAWN_UNITS - 1, null.freedom),
        twins=np.where(of_pattern, DRAWN_UNITS, null.twins),
        weight=np.where(of_pattern, 1.0 / told(null.keys, case.conditions), 1.0),
    )


def unit_under(case: Case, model: SensorModel) -> BaseFit:
    """The unit of a case within a model; of scenes alone, which are too short for the closed law of jitter, settled."""
    base = within(model, case.base)
    if case.scenes_only:
        base = settled(model, base, case.base, [t.base for t in twins(case, model, base, range(50, 54)) if t.base])
    return base


def surer(null: Null, more: Sequence[Mapping[Key, float]]) -> Null:
    """The null with campaigns of some recordings more, where they have a statistic."""
    values = np.array([*(d.values for d in null.draws), *(values_of(bank, null.keys) for bank in more)])
    known = np.isfinite(values).all(axis=0)
    return replace(
        null,
        mean=np.where(known, values.mean(axis=0), null.mean),
        sd=np.where(known, values.std(axis=0, ddof=1), null.sd),
        twins=np.where(known, len(values), null.twins),
        freedom=np.where(known, len(values) - 1, null.freedom),
    )


def told(keys: Sequence[Key], conditions: Sequence[Shown]) -> Array:
    """(S,) how many recordings of use fit tell the same statistic of the pattern: those in the dark, or in light."""
    lit = {c.name: c.kind != "dark" for c in conditions}
    fit = {c.name for c in conditions if c.use == "fit"}
    kind = [(k.name, lit[k.recording]) for k in keys]
    counts = Counter(one for one, k in zip(kind, keys, strict=True) if k.recording in fit)
    return np.array([max(counts[one], 1) for one in kind], dtype=np.float64)
