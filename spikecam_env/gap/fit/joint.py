"""The last touch: all parameters of the effects found, refined together, and how surely each is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.candidates.table import candidate, is_pattern
from spikecam_env.gap.compare.distance import alarmed, judged, residual
from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.compare.step import step_of
from spikecam_env.gap.fit.candidate import Fit, concerned, predict, twins_of, with_held_out, with_pattern
from spikecam_env.gap.fit.confirm import FINAL, confirmed
from spikecam_env.gap.fit.gauss_newton import WHITE, WORSE, Free, Probe, descend, longest_of, moved, spans
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]

AGREE = 3.0
"""Errors by which a parameter may move when held-out recordings are fitted as well, for them to agree."""

SHARED = 0.9
"""Share of a refit's s^2 that is the unit's own, below which it is fitted together with the noise of the effects."""

Errors = dict[str, dict[str, float]]
"""Standard deviation of each parameter, by effect and name."""


def polished(
    case: Case, model: SensorModel, null: Null, seen: Array, values: Array, found: Fit, names: Sequence[str]
) -> tuple[Fit, Errors, bool]:
    """`found.model` with the parameters of its effects `names` refined, simulated anew; their errors; whether all
    recordings were needed.

    seen, values: (S,) of the recordings to fit (NaN elsewhere), and of all.  Where the parameters that the former tell
    suit the held-out ones within their errors only, or others within these do, those tell them too.
    model, null: before any was added.
    """
    sharp, errors, own2 = _refined(case, model, null, seen, found, names)
    error = np.sqrt(sharp.prediction.error**2 + own2 * np.isnan(seen))
    sure = replace(sharp, prediction=replace(sharp.prediction, error=error))
    if leaves_nothing(null, values, sharp.prediction) or not leaves_nothing(null, seen, sharp.prediction):
        return sure, errors, False
    if not case.effort.allows("parameters that the recordings held out tell"):
        return sure, errors, False
    whole, known, _ = _refined(case, model, null, values, sharp, names)
    suit = leaves_nothing(null, values, sure.prediction) or leaves_nothing(null, values, whole.prediction)
    if not (suit and agree(sharp, whole, errors)):
        return sure, errors, False
    return replace(whole, misfit=judged(null, seen, whole.prediction)[1]), known, True


def _refined(
    case: Case, model: SensorModel, null: Null, measured: Array, found: Fit, names: Sequence[str]
) -> tuple[Fit, Errors, Array]:
    """The fit, its errors, and (S,) by what variance statistics are unknown for them: where derivatives are in doubt,
    two parameters may be open that make up for each other, but not what both do.

    What is not refined (`to_refine`) is left as it was fitted, and then no error is smaller than its fit's.
    """
    free = to_refine(case, null, measured, found, names)
    free += [WHITE] if 0 < found.base.white < SHARED * case.base.white else []
    now, base = found.model, found.base
    columns, covariance, told = np.zeros((len(measured), 0)), np.zeros((0, 0)), np.zeros((0, 0))
    if free:
        end = descend(_probe(case, null, measured, found, names), null, measured, now, base, free, case.jobs)
        now, base, columns = end.model, end.base, end.columns
    best = confirmed(case, model, null, measured, replace(found, model=now, base=base), FINAL)
    if best.misfit > judged(null, measured, found.prediction)[1] + WORSE:
        best = found
    if free:
        covariance = step_of(null, measured, best.prediction, columns, end.doubt, spans(free))[1]
        step, told = step_of(null, measured, best.prediction, columns, before=spans(free))
        best = _stepped(null, measured, best, free, columns, step)
    values = {e.name: e.parameters() for e in best.model.effects}
    errors: Errors = {name: {} for name in names}
    for (name, key), e in zip(free, np.sqrt(np.diag(covariance)), strict=True):
        if (name, key) != WHITE:
            errors[name][key] = float(abs(values[name][key]) * e)
    errors[found.name] = no_surer(errors[found.name], found.sd)
    own: Mapping[str, float] = values[found.name]
    best = replace(best, parameters={k: own[k] for k in found.parameters}, sd=errors[found.name])
    return best, errors, np.einsum("sn,nm,sm->s", columns, told, columns)


def to_refine(case: Case, null: Null, measured: Array, found: Fit, names: Sequence[str]) -> list[tuple[str, str]]:
    """Parameters, by effect and name: all that are fitted of those effects that do not wander, since one twin has no
    direction of these.  Where derivatives by every shape would take more than may be simulated, of several effects, and
    of one that leaves something, the strengths alone: what effects take from each other is in these."""
    free = [(name, key) for name in names if not candidate(name).wanders for key in candidate(name).fitted]
    strengths = [(name, key) for name, key in free if key == candidate(name).fitted[0]]
    last = len(names) == 1 and leaves_nothing(null, measured, found.prediction)
    if last or len(strengths) == len(free):
        return free
    only, count = simulated_for(case, null, measured, found, names)
    price = len(only) * count * (1 + len(free))
    return free if case.effort.allows("finer shapes of what was found", price) else strengths


def simulated_for(case: Case, null: Null, measured: Array, found: Fit, names: Sequence[str]) -> tuple[list[int], int]:
    """(recordings, by index; twins) that say what the effects of a fit do; none of those that change the pattern alone,
    for which units are drawn."""
    if all(is_pattern(name) for name in names):
        return [], 1
    only = with_held_out(case, concerned(case, names, null, measured, found.prediction.mean - null.mean))
    return only, max(twins_of(name) for name in names)


def no_surer(known: Mapping[str, float], before: Mapping[str, float]) -> dict[str, float]:
    """Errors of an effect's parameters, no smaller than those before where not all of them were refined."""
    if set(known) >= set(before):
        return dict(known)
    return {key: max(known.get(key, 0.0), sd) for key, sd in before.items()}


def _stepped(null: Null, measured: Array, best: Fit, free: Free, columns: Array, step: Array) -> Fit:
    """The fit moved by a last step (n,), told by its own twins, which are more than the descent's: what one happened to
    scatter is in the parameters that it led to."""
    predicted = replace(best.prediction, mean=best.prediction.mean + columns @ step)
    rho, left = judged(null, measured, predicted)
    if np.any(np.abs(step) > longest_of(free)) or left > best.misfit:
        return best
    model, base = moved(best.model, best.base, free, step)
    return replace(best, model=model, base=base, prediction=predicted, rho=rho, misfit=left)


def leaves_nothing(null: Null, values: Array, predicted: Prediction) -> bool:
    """Whether a prediction explains what was measured, but for chance."""
    return not alarmed(null, residual(null, values, predicted), predicted)


def agree(before: Fit, after: Fit, errors: Errors) -> bool:
    """Whether the logarithms of parameters moved by no more than their errors allow."""
    then = {e.name: e.parameters() for e in after.model.effects}
    here = {e.name: e.parameters() for e in before.model.effects}
    known = [(here[n][k], then[n][k], sd) for n, by in errors.items() for k, sd in by.items() if sd > 0]
    return all(a * b > 0 and abs(np.log(b / a)) < AGREE * sd / abs(a) for a, b, sd in known)


def _probe(case: Case, null: Null, measured: Array, found: Fit, names: Sequence[str]) -> Probe:
    """Twins, and drawn units where an effect changes the pattern."""
    only, count = simulated_for(case, null, measured, found, names)

    def statistics(model: SensorModel, base: BaseFit) -> Prediction:
        made = null.prediction
        if only:
            made = predict(case, model, constrained_refit(model, base), null, count, only)
        return with_pattern(case, model, null, made) if any(is_pattern(name) for name in names) else made

    return statistics
