"""A joint refit of all parameters of the effects, with their errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from spikecam_env.gap.candidates.table import Candidates, candidate
from spikecam_env.gap.compare.distance import APART
from spikecam_env.gap.compare.prediction import TOLERANCE
from spikecam_env.gap.fit.confirm import confirmed
from spikecam_env.gap.fit.coordinates import is_apart
from spikecam_env.gap.fit.gauss_newton import SMALL_STEP, WHITE, Descent, Probe, descend, probe_of, spreads_of
from spikecam_env.gap.fit.hypothesis import Fit, Hypothesis
from spikecam_env.gap.fit.last_step import Errors, last_step, slopes_at
from spikecam_env.gap.fit.problem import Problem, twins_of, with_held_out
from spikecam_env.gap.fit.slopes import UNIT, Free, Slopes, are_alike, values_in
from spikecam_env.gap.unit.indirect_inference import has_converged
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.types import Floats

SAME_NOISE = 0.2 * TOLERANCE
"""Relative change of a unit's s^2 within which twins of one serve for the other: a fifth of the error of laws."""

OWN_SHARE = 0.9
"""Of the refit's s^2: a unit with a smaller share of its own is fitted with the effects."""


def refined_together(problem: Problem, fitted: Fit, names: Sequence[str]) -> tuple[Fit, Errors, bool]:
    """Refine the parameters of a fit's effects together, and simulate it anew.

    All recordings are fitted where the fit to the recordings to fit suits the held-out ones only within its errors.

    Args:
        problem: before any effect was added.
        names: its effects.

    Returns:
        (the fit, errors of its parameters, whether all recordings were needed).
    """
    problem.begin(f"refining {', '.join(names)}")
    everywhere = problem.fitted_to_all
    refined, errors, own2 = _refined(problem, fitted, names)
    error = np.sqrt(refined.prediction.error**2 + own2 * np.isnan(problem.seen))
    uncertain = replace(refined, prediction=replace(refined.prediction, error=error))
    if everywhere.is_explained(refined.prediction) or not problem.is_explained(refined.prediction):
        return uncertain, errors, False
    if not problem.allows("parameters from held-out recordings"):
        return uncertain, errors, False
    whole, known, _ = _refined(everywhere, refined, names)
    suit = everywhere.is_explained(uncertain.prediction) or everywhere.is_explained(whole.prediction)
    if not (suit and agree(refined, whole, errors, APART)):
        return uncertain, errors, False
    return replace(whole, misfit=problem.misfit(whole.prediction)), known, True


def _refined(problem: Problem, fitted: Fit, names: Sequence[str]) -> tuple[Fit, Errors, Floats]:
    """(the fit, errors, (S,) variance of the statistics by them), as `last_step` returns them.

    If parameters are not refined (`to_refine`), the derivatives of all are taken anew for the last step.  A descent
    that stays where the fit is leaves it there, so that its twins serve again: the last step goes the rest of the way.
    """
    settings, probe = problem.settings, _probe(problem, fitted, names)
    free = to_refine(problem, fitted, names)
    held = [parameter for parameter in fitted_of(problem, names) if parameter not in free]
    free += of_unit(problem, fitted)
    now, base, slopes = fitted.model, fitted.base, None
    if free:
        end = descend(problem, probe, now, base, free, known=fitted.slopes.near(now, free))
        slopes = Slopes.of_descent(end.model, free, end.columns, end.noise)
        if not stays(fitted, end, free):
            now, base = end.model, end.base
    best = confirmed(problem, replace(fitted, model=now, base=base), settings.twins.in_the_end)
    if best.misfit > problem.misfit(fitted.prediction) + settings.deviance.by_chance:
        best = fitted
    if held or slopes is None:
        slopes = slopes_at(problem, probe, best, free + held)
    return with_last_step(problem, replace(best, slopes=slopes), names, slopes)


def with_last_step(problem: Problem, fitted: Fit, names: Sequence[str], slopes: Slopes) -> tuple[Fit, Errors, Floats]:
    """`last_step`, and the parameters and errors of the fit's own effect brought up to date.

    These errors are no smaller than before where not all of its parameters are free.
    """
    best, errors, own2 = last_step(problem, fitted, names, slopes)
    errors[fitted.name] = no_smaller(errors[fitted.name], fitted.sd)
    own = best.parameters_of(fitted.name)
    return replace(best, parameters={k: own[k] for k in fitted.parameters}, sd=errors[fitted.name]), errors, own2


def stepped_once(problem: Problem, fitted: Fit, names: Sequence[str]) -> tuple[Fit, Errors]:
    """The fit after one step of the parameters of its effects `names`, with errors that say so.

    It replaces `refined_together` where the budget refuses that: errors need at least derivatives at the fit, a twin
    each.
    """
    free = fitted_of(problem, names)
    free += of_unit(problem, fitted) if free else []
    slopes = slopes_at(problem, _probe(problem, fitted, names), fitted, free)
    best, errors, own2 = with_last_step(problem, fitted, names, slopes)
    error = np.sqrt(best.prediction.error**2 + own2 * np.isnan(problem.seen))
    return replace(best, prediction=replace(best.prediction, error=error)), errors


def fitted_of(problem: Problem, names: Sequence[str]) -> list[tuple[str, str]]:
    """Fitted parameters of effects, by effect and name, but of random courses: one twin shows no direction of those."""
    return [(n, key) for n in names if not candidate(n).random_course for key in problem.fitted_parameters(n)]


def of_unit(problem: Problem, at: Hypothesis) -> list[tuple[str, str]]:
    """Parameters of the unit that are fitted with effects: spreads in maps of rates, else s^2 where they hide it."""
    return [*spreads_of(problem, at.model), *([WHITE] if is_noisy(problem, at.base) else [])]


def with_unit_fitted(problem: Problem) -> Hypothesis:
    """The model as given under its unit; in maps of rates, with the unit's spreads at their best."""
    model, unmoved = problem.model, problem.null.prediction
    at = problem.hypothesis(model, constrained_refit(model, problem.case.base), unmoved)
    free = spreads_of(problem, model)
    if not free:
        return at
    end = descend(problem, probe_of(problem, [], [], 1), model, at.base, free)
    return problem.hypothesis(end.model, end.base, problem.with_pattern(end.model, unmoved))


def is_noisy(problem: Problem, base: BaseFit) -> bool:
    """Whether effects take so much of the refit's s^2 that the unit `base` has less than `OWN_SHARE` of it."""
    return 0 < base.white < OWN_SHARE * problem.case.base.white


def to_refine(problem: Problem, fitted: Fit, names: Sequence[str]) -> list[tuple[str, str]]:
    """Parameters to descend by, by effect and name: all of `fitted_of`, or the strengths alone.

    The strengths alone where the budget refuses a descent by every shape.  Effects borrow from each other by their
    strengths.  One effect that explains all is descended in full.
    """
    free = fitted_of(problem, names)
    strengths = [(name, key) for name, key in free if key == candidate(name).strength]
    last = len(names) == 1 and problem.is_explained(fitted.prediction)
    if last or len(strengths) == len(free):
        return free
    only, count = simulated_for(problem, fitted, names)
    cost = len(only) * count * (1 + len(free))
    return free if problem.allows("finer shapes of the effects found", cost) else strengths


def simulated_for(problem: Problem, fitted: Fit, names: Sequence[str]) -> tuple[list[int], int]:
    """(recordings to simulate, by index; number of twins) for the effects of a fit.

    No recordings where all effects change the pattern alone: units are drawn for those.
    """
    if Candidates(tuple(names)).all_pattern:
        return [], 1
    only = with_held_out(problem.case, problem.affected(names, fitted.prediction.mean - problem.null.mean))
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


def _probe(problem: Problem, fitted: Fit, names: Sequence[str]) -> Probe:
    """The probe of a fit's effects, on recordings held out as well."""
    return probe_of(problem, names, *simulated_for(problem, fitted, names))


def stays(fitted: Fit, end: Descent, free: Free) -> bool:
    """Whether a descent has ended where the fit is, so that the fit's twins serve for it."""
    values = zip(free, values_in(fitted.model, free), values_in(end.model, free), strict=True)
    near = all(are_alike(parameter, one, other, SMALL_STEP) for parameter, one, other in values if parameter[0] != UNIT)
    white, settled = fitted.base.white, end.base.white
    return near and has_converged(fitted.base, end.base) and abs(settled - white) <= SAME_NOISE * white
