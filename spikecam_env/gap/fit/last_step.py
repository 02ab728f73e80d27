"""The last step of a fit, by its own twins, with the errors of its parameters.  A fit has more twins than a descent.

    s' = s + step        s: logarithms of parameters        step, covariance: of `compare.step.step_of`

Where parameters were not descended, to save effort, derivatives are taken here, once, at the fit.  Errors contain the
part of the step that was not taken, and, without a descent, the curvature that one step leaves,

    f(s) ~ exp(k s)        error of one step d = k d^2 / 2        k: power of the strength, 1 of other parameters
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.step import step_of
from spikecam_env.gap.fit.coordinates import error_of
from spikecam_env.gap.fit.gauss_newton import (
    Probe,
    at_settled_unit,
    derivatives,
    longest_of,
    moved,
    prior_sd,
)
from spikecam_env.gap.fit.hypothesis import Fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.fit.slopes import UNIT, Free, Slopes
from spikecam_env.types import Floats

MOST_LINEAR_STEPS = 20
"""Steps to a linear minimum at most; they cost no twin."""

LEAST_LINEAR_STEP = 1e-3
"""Step of a logarithm that needs no other; a thirtieth of the error of a parameter known to 3 %."""

Errors = dict[str, dict[str, float]]
"""Standard deviation of each parameter, by effect and name."""


def slopes_at(problem: Problem, probe: Probe, fitted: Fit, free: Free) -> Slopes:
    """Derivatives at a fit: those that it knows, others by a twin a parameter and one of the fit."""
    known = fitted.slopes.near(fitted.model, free)
    if len(known.free) < len(free):
        here, base = at_settled_unit(probe, problem.null, fitted.model, fitted.base, free)
        columns, noise = derivatives(problem, probe, fitted.model, base, here, free, known)
        known = Slopes.of_descent(fitted.model, free, columns, noise)
    return replace(known, once=True)


def last_step(problem: Problem, fitted: Fit, names: Sequence[str], slopes: Slopes) -> tuple[Fit, Errors, Floats]:
    """Move a fit by the step that its own twins give.

    Args:
        problem: before any effect was added.
        fitted: the fit, simulated.
        names: of its effects, whose errors are returned.
        slopes: derivatives at the fit.

    Returns:
        (the fit, moved where that leaves no more misfit; standard deviations by effect and parameter;
        (S,) variance of the statistics by the errors of the parameters).  The variance is without the noise of the
        derivatives: it leaves open two parameters that cancel, but not the sum of their effects.
    """
    errors: Errors = {name: {} for name in names}
    free = slopes.free
    if not free:
        return fitted, errors, np.zeros(len(problem.seen))
    before = prior_sd(free)
    _, covariance = step_of(problem.null, problem.seen, fitted.prediction, slopes.columns, slopes.noise, before)
    step, exact = step_of(problem.null, problem.seen, fitted.prediction, slopes.columns, before=before)
    if slopes.once:
        step = linear_minimum(problem, fitted, slopes, before)
    best, taken = _stepped(problem, fitted, slopes, step)
    skipped = np.hypot(step - taken, curvature_of_step(free, taken) if slopes.once else 0.0)
    values = {e.name: e.parameters() for e in best.model.effects}
    for (name, key), e in zip(free, np.sqrt(np.diag(covariance) + skipped**2), strict=True):
        if name != UNIT:
            errors[name][key] = error_of(name, key, values[name][key], float(e))
    spread = exact + np.diag(skipped**2)
    return best, errors, np.einsum("sn,nm,sm->s", slopes.columns, spread, slopes.columns)


def linear_minimum(problem: Problem, fitted: Fit, slopes: Slopes, before: Floats) -> Floats:
    """Step to the minimum of the misfit, if the statistics were linear.

    A single step of `step_of` is shorter by its damping and its robust weights, which are no error of the parameters.

    Args:
        slopes: derivatives at the fit.
        before: (n,) standard deviations of the logarithms, as `step_of` takes them.

    Returns:
        (n,) step of the logarithms.
    """
    total = np.zeros(len(slopes.free))
    for _ in range(MOST_LINEAR_STEPS):
        predicted = replace(fitted.prediction, mean=fitted.prediction.mean + slopes.columns @ total)
        step, _ = step_of(problem.null, problem.seen, predicted, slopes.columns, before=before)
        total = total + step
        if np.all(np.abs(step) < LEAST_LINEAR_STEP):
            break
    return total


def curvature_of_step(free: Free, taken: Floats) -> Floats:
    """(n,) error of logarithms by the curvature of the laws, after one linear step `taken` (n,)."""
    powers = [1.0 if f[0] == UNIT or f[1] != candidate(f[0]).strength else candidate(f[0]).power for f in free]
    return np.array(powers) * taken**2 / 2


def _stepped(problem: Problem, best: Fit, slopes: Slopes, step: Floats) -> tuple[Fit, Floats]:
    """(the fit moved, (n,) the step taken): no step that leaves more misfit.

    After a descent, a step longer than one of a descent is not taken.  Without one, it is cut to that length.
    """
    longest = longest_of(slopes.free)
    step = np.clip(step, -longest, longest) if slopes.once else step
    predicted = replace(best.prediction, mean=best.prediction.mean + slopes.columns @ step)
    rho, left = problem.residual_and_misfit(predicted)
    if np.any(np.abs(step) > longest) or left > best.misfit:
        return best, np.zeros(len(step))
    model, base = moved(best.model, best.base, slopes.free, step)
    return replace(best, model=model, base=base, prediction=predicted, rho=rho, misfit=left), step
