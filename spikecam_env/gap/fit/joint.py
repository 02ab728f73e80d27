"""The last step: a joint refit of all parameters of the effects found, with their errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.candidates.table import Candidates, candidate
from spikecam_env.gap.compare.prediction import Prediction
from spikecam_env.gap.compare.step import step_of
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.fit.confirm import confirmed
from spikecam_env.gap.fit.coordinates import error_of, is_apart
from spikecam_env.gap.fit.gauss_newton import WHITE, Free, Probe, descend, longest_of, moved, prior_sd
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.fit.recordings import twins_of, with_held_out
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]

Errors = dict[str, dict[str, float]]
"""Standard deviation of each parameter, by effect and name."""


def refined_together(problem: Problem, found: Fit, names: Sequence[str]) -> tuple[Fit, Errors, bool]:
    """`found.model` with the parameters of its effects `names` refined, simulated anew; their errors; whether all
    recordings were needed.

    Where the parameters that the recordings to fit give suit the held-out ones within their errors only, or others
    within these do, all recordings give them.  problem: before any was added.
    """
    everywhere = problem.fitted_to_all
    refined, errors, own2 = _refined(problem, found, names)
    error = np.sqrt(refined.prediction.error**2 + own2 * np.isnan(problem.seen))
    open_ = replace(refined, prediction=replace(refined.prediction, error=error))
    if everywhere.is_explained(refined.prediction) or not problem.is_explained(refined.prediction):
        return open_, errors, False
    if not problem.allows("parameters from held-out recordings"):
        return open_, errors, False
    whole, known, _ = _refined(everywhere, refined, names)
    suit = everywhere.is_explained(open_.prediction) or everywhere.is_explained(whole.prediction)
    if not (suit and agree(refined, whole, errors, problem.settings.judging.apart)):
        return open_, errors, False
    return replace(whole, misfit=problem.misfit(whole.prediction)), known, True


def _refined(problem: Problem, found: Fit, names: Sequence[str]) -> tuple[Fit, Errors, Array]:
    """The fit, its errors, and (S,) by what variance statistics are unknown for them: where derivatives are noisy, two
    parameters may be open that make up for each other, but not what both do.

    What is not refined (`to_refine`) is left as it was fitted, and then no error is smaller than its fit's.
    """
    null, seen = problem.null, problem.seen
    free = to_refine(problem, found, names)
    free += [WHITE] if is_noisy(problem, found.base) else []
    now, base = found.model, found.base
    columns, covariance, exact = np.zeros((len(seen), 0)), np.zeros((0, 0)), np.zeros((0, 0))
    if free:
        end = descend(problem, _probe(problem, found, names), now, base, free)
        now, base, columns = end.model, end.base, end.columns
    best = confirmed(problem, replace(found, model=now, base=base), problem.settings.twins.in_the_end)
    if best.misfit > problem.misfit(found.prediction) + problem.settings.deviance.by_chance:
        best = found
    if free:
        covariance = step_of(null, seen, best.prediction, columns, end.noise, prior_sd(free))[1]
        step, exact = step_of(null, seen, best.prediction, columns, before=prior_sd(free))
        best = _stepped(problem, best, free, columns, step)
    values = {e.name: e.parameters() for e in best.model.effects}
    errors: Errors = {name: {} for name in names}
    for (name, key), e in zip(free, np.sqrt(np.diag(covariance)), strict=True):
        if (name, key) != WHITE:
            errors[name][key] = error_of(name, key, values[name][key], float(e))
    errors[found.name] = no_smaller(errors[found.name], found.sd)
    own: Mapping[str, float] = values[found.name]
    best = replace(best, parameters={k: own[k] for k in found.parameters}, sd=errors[found.name])
    return best, errors, np.einsum("sn,nm,sm->s", columns, exact, columns)


def is_noisy(problem: Problem, base: BaseFit) -> bool:
    """Whether effects take so much of the refit's s^2 that the unit `base` has less than `own_share` of it."""
    return 0 < base.white < problem.settings.unit.own_share * problem.case.base.white


def to_refine(problem: Problem, found: Fit, names: Sequence[str]) -> list[tuple[str, str]]:
    """Parameters, by effect and name: all that are fitted of those effects whose course is not random, since one twin
    has no direction of these.  Where derivatives by every shape would take more than may be simulated, of several
    effects, and of one that leaves something, the strengths alone: what effects take from each other is in these."""
    free = [(name, key) for name in names if not candidate(name).random_course for key in candidate(name).fitted]
    strengths = [(name, key) for name, key in free if key == candidate(name).strength]
    last = len(names) == 1 and problem.is_explained(found.prediction)
    if last or len(strengths) == len(free):
        return free
    only, count = simulated_for(problem, found, names)
    cost = len(only) * count * (1 + len(free))
    return free if problem.allows("finer shapes of the effects found", cost) else strengths


def simulated_for(problem: Problem, found: Fit, names: Sequence[str]) -> tuple[list[int], int]:
    """(recordings, by index; twins) that say what the effects of a fit do; none of those that change the pattern alone,
    for which units are drawn."""
    if Candidates(tuple(names)).all_pattern:
        return [], 1
    only = with_held_out(problem.case, problem.affected(names, found.prediction.mean - problem.null.mean))
    return only, max(twins_of(name, problem.settings.twins) for name in names)


def no_smaller(known: Mapping[str, float], before: Mapping[str, float]) -> dict[str, float]:
    """Errors of an effect's parameters, no smaller than those before where not all of them were refined."""
    if set(known) >= set(before):
        return dict(known)
    return {key: max(known.get(key, 0.0), sd) for key, sd in before.items()}


def _stepped(problem: Problem, best: Fit, free: Free, columns: Array, step: Array) -> Fit:
    """The fit moved by a last step (n,) of its own twins, which are more than the descent's: what one happened to
    scatter is in the parameters that it led to."""
    predicted = replace(best.prediction, mean=best.prediction.mean + columns @ step)
    rho, left = problem.residual_and_misfit(predicted)
    if np.any(np.abs(step) > longest_of(free, problem.settings.fitting.longest_step)) or left > best.misfit:
        return best
    model, base = moved(best.model, best.base, free, step)
    return replace(best, model=model, base=base, prediction=predicted, rho=rho, misfit=left)


def agree(before: Fit, after: Fit, errors: Errors, apart: float) -> bool:
    """Whether parameters moved by less than `apart` of their errors."""
    then = {e.name: e.parameters() for e in after.model.effects}
    here = {e.name: e.parameters() for e in before.model.effects}
    known = [(n, k, sd) for n, by in errors.items() for k, sd in by.items() if sd > 0]
    return not any(is_apart(n, k, then[n][k], here[n][k], apart * sd) for n, k, sd in known)


def _probe(problem: Problem, found: Fit, names: Sequence[str]) -> Probe:
    """Twins, and drawn units where an effect changes the pattern."""
    only, count = simulated_for(problem, found, names)

    def statistics(model: SensorModel, base: BaseFit) -> Prediction:
        made = problem.null.prediction
        if only:
            made = problem.predict(model, constrained_refit(model, base), count, only)
        return problem.with_pattern(model, made) if Candidates(tuple(names)).any_pattern else made

    return statistics
