"""The last step: a joint refit of all parameters of the effects found, with their errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from spikecam_env.gap.candidates.table import Candidates, candidate
from spikecam_env.gap.compare.distance import APART
from spikecam_env.gap.compare.prediction import Prediction
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.fit.confirm import confirmed
from spikecam_env.gap.fit.coordinates import is_apart
from spikecam_env.gap.fit.gauss_newton import WHITE, Probe, descend
from spikecam_env.gap.fit.last_step import Errors, Slopes, last_step
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.fit.recordings import twins_of, with_held_out
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats

OWN_SHARE = 0.9
"""Of the refit's s^2: a unit with a smaller share of its own is fitted with the effects."""


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
    if not (suit and agree(refined, whole, errors, APART)):
        return open_, errors, False
    return replace(whole, misfit=problem.misfit(whole.prediction)), known, True


def _refined(problem: Problem, found: Fit, names: Sequence[str]) -> tuple[Fit, Errors, Floats]:
    """The fit, its errors, and (S,) by what variance statistics are unknown for them (`last_step`).

    Of what is not refined (`to_refine`), as of the others, derivatives are then taken anew for the last step."""
    probe = _probe(problem, found, names)
    free = to_refine(problem, found, names)
    held = [parameter for parameter in fitted_of(names) if parameter not in free]
    free += [WHITE] if is_noisy(problem, found.base) else []
    now, base, slopes = found.model, found.base, None
    if free:
        end = descend(problem, probe, now, base, free)
        now, base, slopes = end.model, end.base, Slopes.of_descent(free, end.columns, end.noise)
    best = confirmed(problem, replace(found, model=now, base=base), problem.settings.twins.in_the_end)
    if best.misfit > problem.misfit(found.prediction) + problem.settings.deviance.by_chance:
        best = found
    if held or slopes is None:
        slopes = Slopes.at(problem, probe, best, free + held)
    return with_last_step(problem, best, names, slopes)


def with_last_step(problem: Problem, found: Fit, names: Sequence[str], slopes: Slopes) -> tuple[Fit, Errors, Floats]:
    """`last_step`, with the parameters and errors of the fit's own effect; these are no smaller than before where not
    all of them are free."""
    best, errors, own2 = last_step(problem, found, names, slopes)
    errors[found.name] = no_smaller(errors[found.name], found.sd)
    own = next(e for e in best.model.effects if e.name == found.name).parameters()
    return replace(best, parameters={k: own[k] for k in found.parameters}, sd=errors[found.name]), errors, own2


def stepped_once(problem: Problem, found: Fit, names: Sequence[str]) -> tuple[Fit, Errors]:
    """The fit after one step of the parameters of its effects `names`, with errors that say so.

    It takes the place of `refined_together` where the budget refuses that: derivatives at the fit, a twin each, are
    the least that errors can be known by.
    """
    free = fitted_of(names)
    free += [WHITE] if free and is_noisy(problem, found.base) else []
    slopes = Slopes.at(problem, _probe(problem, found, names), found, free)
    best, errors, own2 = with_last_step(problem, found, names, slopes)
    error = np.sqrt(best.prediction.error**2 + own2 * np.isnan(problem.seen))
    return replace(best, prediction=replace(best.prediction, error=error)), errors


def fitted_of(names: Sequence[str]) -> list[tuple[str, str]]:
    """All that is fitted of those effects whose course is not random, by effect and name: one twin has no direction of
    the others."""
    return [(name, key) for name in names if not candidate(name).random_course for key in candidate(name).fitted]


def is_noisy(problem: Problem, base: BaseFit) -> bool:
    """Whether effects take so much of the refit's s^2 that the unit `base` has less than `OWN_SHARE` of it."""
    return 0 < base.white < OWN_SHARE * problem.case.base.white


def to_refine(problem: Problem, found: Fit, names: Sequence[str]) -> list[tuple[str, str]]:
    """Parameters to descend by, by effect and name: all of `fitted_of`.  Where a descent by every shape would take more
    than may be simulated, of several effects, and of one that leaves something, the strengths alone: what effects take
    from each other is in these."""
    free = fitted_of(names)
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
    return only, max(twins_of(name) for name in names)


def no_smaller(known: Mapping[str, float], before: Mapping[str, float]) -> dict[str, float]:
    """Errors of an effect's parameters, no smaller than those before where not all of them were refined."""
    if set(known) >= set(before):
        return dict(known)
    return {key: max(known.get(key, 0.0), sd) for key, sd in before.items()}


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
