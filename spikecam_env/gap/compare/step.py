"""From the residuals of a prediction to a step of parameters, with its covariance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spikecam_env.gap.compare.distance import APART, HEAVY, SHOWS, residual_and_misfit, robust_squares
from spikecam_env.gap.compare.prediction import (
    TOLERANCE,
    Null,
    Prediction,
    from_drawn_units,
    law_error,
    own_variance,
    total_variance,
    with_change_scaled,
)
from spikecam_env.types import Floats, Masks

ERROR_DAMPING = 5e-4
"""Damping of the normal matrix that errors follow from: a step may be held back, an error must not be.  Directions
that it holds back are open."""

AS_WELL = 0.5
"""Share of its size on the best statistic from which an effect counts that is clear on none; of one that shows clearly,
the square of this."""

MEDIAN_SQUARE = 0.455
"""Of the square of a normal deviate."""


def likeliest(null: Null, measured: Floats, one: Prediction) -> tuple[float, float]:
    """(factor, sd of its logarithm) that suits a prediction of scatter best: by the misfit with its spread term."""
    factors = np.geomspace(0.01, 100.0, 200)
    left = np.array([residual_and_misfit(null, measured, with_change_scaled(null, one, f))[1] for f in factors])
    near = np.log(factors[left < left.min() + 1.0])
    return float(factors[left.argmin()]), float(max(np.ptp(near), np.log(factors[1] / factors[0]))) / 2


def step_of(
    null: Null,
    measured: Floats,
    predicted: Prediction,
    jacobian: Floats,
    noise: Floats | float = 0.0,
    before: Floats | float = 1.0,
) -> tuple[Floats, Floats]:
    """A step of robust, slightly damped least squares.

    If most statistics are far off, residuals are scaled by their median; otherwise all would count as outliers.

    Statistics are not independent.  The covariance is that of the steps to which the null's own draws would lead; the
    effect's own draws count too, where there are `in_the_end` of them, as other pixels have its traps.  Floors, and the
    tolerance of the effect, all of one sign, are added.  The fixed pattern is of drawn units: all recordings show one.
    Where two parameters do nearly the same, noise of the jacobian would seem to separate them: the squares of it
    that are expected in the normal matrix are subtracted (errors in variables).

    Args:
        null: the null model.
        measured: (S,) statistics, NaN where they take no part.
        predicted: at the parameters.
        jacobian: (S, n).
        noise: (S, n) of the jacobian.
        before: (n,) prior standard deviation.

    Returns:
        (step (n,), covariance (n, n)).
    """
    noise2 = total_variance(null, predicted)
    gap = np.nan_to_num(measured - predicted.mean)
    concerned = np.isfinite(measured) & np.any(jacobian != 0, axis=1)
    usual = max(float(np.median((gap**2 / noise2)[concerned])) / MEDIAN_SQUARE, 1.0) if concerned.any() else 1.0
    w = np.isfinite(measured) * null.weight * (HEAVY + 1) / (HEAVY + gap**2 / noise2 / usual) / noise2
    normal = jacobian.T @ (w[:, None] * jacobian)
    scale = np.diag(normal) + 1e-12
    step = np.linalg.solve(normal + 0.02 * np.diag(scale), jacobian.T @ (w * gap))
    values, basis = principal_directions(normal - chance_of_normal_matrix(w, jacobian, noise), np.sqrt(scale))
    back = np.linalg.inv(basis)
    solve = (back / values) @ back.T @ (jacobian.T * w)
    drawn = [d.values - null.mean for d in null.draws]
    of_twins = solve * ~from_drawn_units(null, predicted)
    chance = step_covariance(of_twins, drawn) if len(drawn) > 1 else (of_twins * null.sd**2) @ of_twins.T
    off = solve @ law_error(null, predicted)
    total = (
        chance + own_step_covariance(null, predicted, solve) + (solve * null.floor**2) @ solve.T + np.outer(off, off)
    )
    prior = np.diag(np.square(before * np.ones(len(scale))))
    held = (back * (ERROR_DAMPING / values)) @ basis
    total = total + held @ prior @ held.T
    total = total - total @ np.linalg.solve(total + prior, total)
    return np.asarray(step, np.float64), np.atleast_2d(total)


def chance_of_normal_matrix(w: Floats, jacobian: Floats, noise: Floats | float) -> Floats:
    """(n, n) part of a normal matrix with weights (S,) that is made by the noise of its jacobian, (S, n) with the sign
    of the step: each column is a twin less one that they share."""
    own = noise * (jacobian != 0)
    shared = own.T @ (w[:, None] * own) / 2
    return np.asarray(shared + np.diag(np.diag(shared)))


def principal_directions(normal: Floats, scale: Floats) -> tuple[Floats, Floats]:
    """((n,) weights, ERROR_DAMPING at least, (n, n) their directions in units of 1 / `scale` (n,), one a row)."""
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    return np.maximum(values, 0.0) + ERROR_DAMPING, vectors.T * scale


def step_covariance(solve: Floats, draws: Sequence[Floats] | Floats) -> Floats:
    """(n, n) covariance of the steps (n,) = solve @ values of single campaigns (S,) such as these."""
    return np.atleast_2d(np.cov((np.nan_to_num(draws) @ solve.T).T)) * (1 + 1 / len(draws))


def own_step_covariance(null: Null, predicted: Prediction, solve: Floats) -> Floats:
    """(n, n) covariance of a step by the effect's own chance: of its draws where `in_the_end` of them move a statistic,
    of drawn units where they show it, elsewhere as of independent ones."""
    variances = np.maximum(predicted.spread**2 + predicted.error**2 - null.sd**2 * (1 + 1 / null.twins), 0.0)
    without = {d.number: d.values for d in null.draws}
    draws = predicted.draws if len(predicted.draws) >= null.settings.twins.in_the_end else ()
    change = np.array([d.values - without[d.number] for d in draws])
    shown = from_drawn_units(null, predicted)
    simulated = np.any(np.nan_to_num(change) != 0, axis=0) & ~shown
    total = np.asarray((solve * np.where(simulated | shown, 0.0, variances)) @ solve.T)
    total = total + step_covariance(solve * simulated, change) if simulated.any() else total
    return total + step_covariance(solve * shown, predicted.units) if predicted.units is not None else total


def slope_of(null: Null, measured: Floats, moved: Prediction, at: Prediction, step: float) -> Floats:
    """(S,) change of predictions over `step`, 0 where it is not clear of the twins' own noise: hundreds of statistics
    that do not move would drown those that do (regression dilution)."""
    change, _, clear = change_of(null, measured, moved, at)
    return np.where(clear, change, 0.0) / step


def change_of(null: Null, measured: Floats, moved: Prediction, at: Prediction) -> tuple[Floats, Floats, Masks]:
    """((S,) change from one prediction to another, (S,) its noise, (S,) whether it is clear of that).  Statistics that
    were not measured (NaN) may move more, and are judged apart."""
    change, known = moved.mean - at.mean, np.isfinite(measured)
    own2 = np.maximum(own_variance(null, moved), own_variance(null, at))
    if moved.units is not None and at.units is not None:
        apart = moved.units - at.units
        own2 = np.where(np.isfinite(apart).all(axis=0), apart.var(axis=0, ddof=1) / len(apart), own2)
    own2 = np.maximum(own2, 1e-300)
    here_known, elsewhere = np.where(known, change, 0.0), np.where(known, 0.0, change)
    clear = is_clear(here_known, own2) | is_clear(elsewhere, own2)
    return change, np.sqrt(own2), clear


def scale_of(
    gap: Floats, effect: Floats, of_gap: Floats, of_effect: Floats, tolerance: float = TOLERANCE
) -> tuple[float, float]:
    """The factor by which an effect's change of the statistics comes nearest to the measured one.

    Only statistics on which the simulated effect is clear of its own noise count: the noise of the others would drag
    the scale to 0 (regression dilution).  Under a heavy-tailed loss there are many minima: it is followed down from
    every ratio that many statistics agree on.

    Args:
        gap: (S,) measured change.
        effect: (S,) simulated change.
        of_gap: (S,) variance of the measured one.
        of_effect: (S,) variance of the simulated one.
        tolerance: error of the effect, relative.

    Returns:
        (factor, its standard deviation).
    """
    clear = is_clear(effect, of_gap + of_effect)
    if not clear.any():
        return 0.0, np.inf
    gap, effect, of_gap, of_effect = gap[clear], effect[clear], of_gap[clear], of_effect[clear]
    starts = np.unique(np.quantile(gap / effect, [0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95]))
    best = (np.inf, 0.0, np.inf)
    for start in starts:
        scale, total = float(start), 0.0
        for _ in range(8):
            noise2 = of_gap + scale**2 * of_effect + (tolerance * scale * effect) ** 2
            w = (HEAVY + 1.0) / (HEAVY + (gap - scale * effect) ** 2 / noise2) / noise2
            total = float(np.sum(w * effect**2))
            scale = float(np.sum(w * effect * gap)) / max(total, 1e-300)
        noise2 = of_gap + scale**2 * of_effect + (tolerance * scale * effect) ** 2
        left = robust_squares((gap - scale * effect) / np.sqrt(noise2))
        best = min(best, (left, scale, 1.0 / np.sqrt(max(total, 1e-300))))
    return best[1], best[2]


def scale_to(null: Null, measured: Floats, predicted: Prediction) -> tuple[float, float]:
    """(scale, sd) of a prediction's change from the null that comes nearest to the measured one."""
    known = np.isfinite(measured)
    gap, effect = (np.where(known, v - null.mean, 0.0) for v in (measured, predicted.mean))
    return scale_of(gap, effect, null.noise**2, own_variance(null, predicted))


def is_clear(effect: Floats, variance: Floats) -> Masks:
    """(S,) whether an effect stands clear of noise on a statistic, or, where it does on none, nearly as well as on its
    best: of 600 statistics a few are 4 noises off by chance."""
    size = np.abs(effect) / np.sqrt(variance)
    most = float(size.max())
    least = max(min(APART, AS_WELL * most), min(SHOWS, AS_WELL**2 * most))
    return np.asarray((size > least) & (effect != 0))
