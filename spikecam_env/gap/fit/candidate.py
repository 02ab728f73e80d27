"""Fitting one candidate: simulate the campaign with it, scale and shape it until its statistics are the measured ones.

Every twin is compared with the null's of the same draws, so their difference is the effect alone.  Statistics move in
proportion to the strength (or its square), so each twin says by how much to scale the next.  Other parameters cost a
twin each, and are fitted only where they can matter.  The unit is refitted along the way, so that the candidate cannot
borrow from it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from spikecam_env.gap.candidates.strength import MOST_EXTRAPOLATED, TARGET_SIZE, amplified, bounded, with_effect
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import effect_size, is_significant
from spikecam_env.gap.compare.prediction import Prediction, with_change_scaled
from spikecam_env.gap.compare.step import likeliest, scale_to, slope_of, step_of
from spikecam_env.gap.fit.coordinates import error_of
from spikecam_env.gap.fit.gauss_newton import (
    COMPARED,
    LONGEST_STEP,
    MOST_STEPS,
    SMALL_STEP,
    UNITS_OF_A_STEP,
    Descent,
    descend,
    probe_of,
    spreads_of,
)
from spikecam_env.gap.fit.hypothesis import Fit
from spikecam_env.gap.fit.problem import OF_EVENTS, OF_RANDOM_COURSE, Problem, twins_of
from spikecam_env.gap.fit.slopes import Free
from spikecam_env.gap.unit.indirect_inference import extrapolated_unit, has_converged
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.types import Floats

STARTS_OF_MAPS = (0.1, 1.0, 10.0)
"""Factors of a strength from which a pattern is fitted in maps of rates; a choice: one is within a factor of 3."""

WORTH = 0.5
"""Of what the best removes: less is not worth another fit, of a start, a shape, or a runner-up of an earlier effect."""

VISIBLE = 4.0
"""Least size of a simulated effect [noises] from which its strength is scaled."""

MOST_TRIES = MOST_STEPS + 1
"""Strengths that are tried for one strength: one more than the steps between them."""

ROUND_OFF = (math.exp(-LONGEST_STEP / 2), math.exp(LONGEST_STEP / 2))
"""Factors within which a strength is scaled without another twin."""

LARGEST_FACTOR = math.exp(LONGEST_STEP)
"""Factor by which starts are scaled to compare them, or one that mostly scatters without other twins."""

LEAST_FACTOR = 1e-3
"""Least factor by which a strength is multiplied at once; and that of a strength whose fit does not go on."""


def fit(
    problem: Problem, name: str, start: Mapping[str, float], expected: Floats | None = None, white: float = 1.0
) -> Fit:
    """Fit one candidate's strength, or all parameters of a pattern, beside the model.

    Args:
        problem: the campaign and the model.
        start: parameters near the best.
        expected: (S,) change of the statistics at `start`; recordings without a change are not simulated.
        white: s^2 of the unit at `start`, over the refit's.
    """
    problem.begin(f"fitting {name}")
    if problem.case.rates_only:
        return _fit_maps(problem, name, start)
    if candidate(name).is_pattern:
        return _fit_pattern(problem, name, start)
    if candidate(name).random_course:
        return _fit_random_course(problem, name, dict(start))
    return _fit_twins(problem, name, dict(start), expected, white)


@dataclass(frozen=True, eq=False)
class _Trial:
    """An effect at a strength, to be simulated."""

    parameters: dict[str, float]
    base: BaseFit
    """The unit under it."""
    only: list[int]
    """Recordings to simulate, by index."""


@dataclass(frozen=True, eq=False)
class _Rescaling:
    """The way from a simulated strength to a better one."""

    strength: float
    """The strength that was simulated."""
    predicted: Prediction
    scale: float
    """Factor of the effect's change that suits the measurement best."""
    sd: float
    """Standard deviation of `scale`."""
    factor: float
    """Factor of the strength."""
    slope: Floats | None
    """(S,) change of the statistics for one more of the strength's logarithm; None where two twins do not give it."""
    is_weak: bool = False
    """Whether the effect is too weak for another simulation to say more."""
    is_near: bool = True
    """Whether the strength is right to a third."""
    is_useless: bool = False
    """Whether the effect leaves as much misfit as the model without it."""


def _fit_twins(problem: Problem, name: str, parameters: dict[str, float], expected: Floats | None, white: float) -> Fit:
    """Simulate, raise the strength until it shows, then rescale until it changes by less than a third.

    The unit is refitted under every trial.  A trial is repeated once where the unit settles far from its start.  One
    twin shows whether it does, and whether the effect does.
    The last step scales the last prediction, without another twin.
    """
    effect, null = candidate(name), problem.null
    strength, power = effect.strength, effect.power
    expected = np.full(len(null.keys), np.inf) if expected is None else expected
    parameters, times = amplified(name, bounded(name, parameters), effect_size(null, problem.seen, expected))
    bare = constrained_refit(
        with_effect(problem.model, name, parameters), constrained_refit(problem.model, problem.case.base)
    )
    first = replace(bare, white=white**times * bare.white)
    least = problem.misfit() - COMPARED
    trial = _Trial(parameters, first, problem.affected([name], expected * times))
    way: _Rescaling | None = None
    repeated = False
    for turn in range(MOST_TRIES):
        is_last = turn == MOST_TRIES - 1
        model = with_effect(problem.model, name, trial.parameters)
        predicted = problem.predict(model, trial.base, 1, trial.only)
        size = effect_size(null, problem.seen, predicted.mean - null.mean)
        stronger = trial.parameters if is_last else until_visible(name, trial.parameters, size)
        if stronger != trial.parameters:
            times = abs(stronger[strength] / trial.parameters[strength]) ** power
            base = extrapolated_unit(bare, trial.base, times, MOST_EXTRAPOLATED)
            trial = _Trial(stronger, base, problem.affected([name]))
            continue
        assumed, trial = trial.base, replace(trial, base=problem.settled_unit(model, trial.base, predicted))
        if not repeated and not is_last and not has_converged(assumed, trial.base):
            repeated = True
            continue
        if twins_of(name) > 1:
            predicted = problem.predict(model, assumed, twins_of(name), trial.only)
        way = _rescaling(problem, name, trial, predicted, least, way)
        if way.is_useless or is_last or (way.is_near and turn):
            break
        if not way.is_weak:
            change = (predicted.mean - null.mean) * way.factor**power
            trial = _Trial(
                bounded(name, {**trial.parameters, strength: trial.parameters[strength] * way.factor}),
                extrapolated_unit(bare, trial.base, way.factor**power, MOST_EXTRAPOLATED),
                problem.affected([name], change),
            )
    assert way is not None
    return _rescaled_fit(problem, name, trial, bare, way)


def _rescaling(
    problem: Problem, name: str, trial: _Trial, predicted: Prediction, least: float, before: _Rescaling | None
) -> _Rescaling:
    """The way from a trial to a better strength.

    Args:
        predicted: its prediction.
        least: misfit above which the effect is useless.
        before: the way to the trial, which gives the slope with it.
    """
    effect, null = candidate(name), problem.null
    strength = trial.parameters[effect.strength]
    scale, sd = scale_to(null, problem.seen, predicted)
    slope = None if before is None else before.slope
    if problem.misfit(with_change_scaled(null, predicted, scale)) > least:
        return _Rescaling(strength, predicted, scale, sd, LEAST_FACTOR, slope, is_useless=True)
    last = None if before is None else (before.strength, before.predicted)
    slope = slope_between(problem, last, (strength, predicted)) if effect.power == 2.0 else None
    factor = factor_to(problem, name, predicted, scale, slope)
    size = effect_size(null, problem.seen, predicted.mean - null.mean)
    is_weak = abs(scale) * size < VISIBLE or (
        effect.is_linear and 1 / MOST_EXTRAPOLATED < scale < 1 and scale * size < TARGET_SIZE
    )
    is_near = is_weak or ROUND_OFF[0] < factor < ROUND_OFF[1]
    return _Rescaling(strength, predicted, scale, sd, factor, slope, is_weak, is_near)


def _rescaled_fit(problem: Problem, name: str, trial: _Trial, bare: BaseFit, way: _Rescaling) -> Fit:
    """The fit at the end of the way, by scaling the last prediction; at the trial itself where that is far."""
    effect, most = candidate(name), MOST_EXTRAPOLATED
    now = trial.parameters[effect.strength]
    final = bounded(name, {**trial.parameters, effect.strength: now * way.factor}) if way.is_near else trial.parameters
    times = (final[effect.strength] / now) ** effect.power if now else 1.0
    if way.is_near and way.slope is not None:
        mean = way.predicted.mean + way.slope * np.log(times) / effect.power
        predicted = replace(way.predicted, mean=mean)
    else:
        predicted = with_change_scaled(problem.null, way.predicted, times)
    sd = {effect.strength: abs(final[effect.strength]) * (way.sd / max(abs(way.scale), 1e-9) / effect.power)}
    base = extrapolated_unit(bare, trial.base, times, most)
    return problem.fit_of(name, final, with_effect(problem.model, name, final), base, predicted, sd)


def until_visible(name: str, parameters: dict[str, float], size: float) -> dict[str, float]:
    """Raise a strength until it shows by twice `VISIBLE` noises, or to the end of its bounds.

    Args:
        parameters: its parameters, which are returned where the effect shows.
        size: noises by which it shows.
    """
    if size >= VISIBLE:
        return parameters
    strength = candidate(name).strength
    more = (2 * VISIBLE / max(size, 0.2)) ** (1 / candidate(name).power)
    return bounded(name, {**parameters, strength: parameters[strength] * more})


def factor_to(problem: Problem, name: str, predicted: Prediction, scale: float, slope: Floats | None) -> float:
    """Factor of a strength: along its slope where there is one, else by the best scale of its change.

    A tenth where the scale is negative and the strength cannot be.
    """
    if slope is not None:
        step = step_of(problem.null, problem.seen, predicted, slope[:, None])[0]
        return float(np.exp(np.clip(step[0], -1.0, 1.0)))
    if scale < 0 and not candidate(name).may_be_negative:
        return 0.1
    size = float(np.clip(abs(scale) ** (1 / candidate(name).power), LEAST_FACTOR, 1 / LEAST_FACTOR))
    return -size if scale < 0 else size


def slope_between(
    problem: Problem, one: tuple[float, Prediction] | None, other: tuple[float, Prediction]
) -> Floats | None:
    """(S,) change of the statistics for one more of a strength's logarithm, by twins at two strengths; None at one.

    A change with the square of a strength saturates beside other noise, or is the logarithm of a sum.
    """
    if one is None or not one[0] * other[0] > 0 or abs(step := float(np.log(other[0] / one[0]))) < SMALL_STEP:
        return None
    null = problem.null
    both = (one[1].mean != null.mean) & (other[1].mean != null.mean)
    slope = slope_of(null, problem.seen, other[1], one[1], step) * both
    return slope if slope.any() else None


def _fit_random_course(problem: Problem, name: str, parameters: dict[str, float]) -> Fit:
    """The maximum-likelihood strength of an effect that shows by the scatter of its twins.

    Statistics of one recording are of one course in time, so a recording says no more of the strength than one number.
    """
    strength, power = candidate(name).strength, candidate(name).power
    only = problem.affected([name])

    def tried(count: int) -> tuple[BaseFit, Prediction]:
        model = with_effect(problem.model, name, bounded(name, parameters))
        base = constrained_refit(model, problem.case.base)
        return base, problem.predict(model, base, count, only)

    factor, _ = likeliest(problem.null, problem.seen, tried(OF_EVENTS)[1])
    if not 1 / LARGEST_FACTOR < factor < LARGEST_FACTOR:
        parameters = bounded(name, {**parameters, strength: parameters[strength] * factor ** (1 / power)})
    base, predicted = tried(OF_RANDOM_COURSE)
    factor, sd = likeliest(problem.null, problem.seen, predicted)
    parameters = bounded(name, {**parameters, strength: parameters[strength] * factor ** (1 / power)})
    predicted = with_change_scaled(problem.null, predicted, factor)
    sds = {strength: parameters[strength] * max(sd, np.sqrt(2.0 / len(only))) / power}
    return problem.fit_of(name, parameters, with_effect(problem.model, name, parameters), base, predicted, sds)


def _fit_maps(problem: Problem, name: str, start: Mapping[str, float]) -> Fit:
    """All parameters of a pattern, with the spreads of the unit, by maps of rates: from the best of three strengths."""
    own = {key: start[key] for key in problem.fitted_parameters(name)}
    tried = [_of_pattern(problem, name, own, candidate(name).strength, f, UNITS_OF_A_STEP) for f in STARTS_OF_MAPS]
    return with_fitted_shapes(problem, min(tried, key=lambda f: f.misfit))


def _fit_pattern(problem: Problem, name: str, start: Mapping[str, float]) -> Fit:
    """Coarse to fine search over the strength (and one more parameter), drawing units."""
    parameters = bounded(name, start)
    best: Fit | None = None
    for factors in ((0.03, 0.1, 0.3, 1.0, 3.0), (0.55, 0.75, 1.35, 1.8), (0.8, 0.9, 1.1, 1.25), (0.95, 1.05)):
        for key in candidate(name).fitted:
            centre = best.parameters if best else parameters
            for factor in factors:
                now = _of_pattern(problem, name, centre, key, factor)
                best = now if best is None or now.misfit < best.misfit else best
    assert best is not None
    return best


def _of_pattern(
    problem: Problem, name: str, parameters: Mapping[str, float], key: str, factor: float, units: int | None = None
) -> Fit:
    """A pattern with one of its parameters multiplied, by so many drawn units; None: as many as the null has."""
    tried = bounded(name, {**parameters, key: parameters[key] * factor})
    model = with_effect(problem.model, name, tried)
    predicted = problem.with_pattern(model, problem.null.prediction, units)
    return problem.fit_of(name, tried, model, constrained_refit(model, problem.case.base), predicted)


def with_shapes_to_fit(problem: Problem, before: float, fits: Sequence[Fit]) -> list[Fit]:
    """Fits whose other parameters can matter: they remove a share (`Searching.worth`) of the best's misfit.

    None of them where a fit without other parameters leaves less, and no more than chance.

    Args:
        before: misfit of the model itself.
    """
    least = min((f.misfit for f in fits), default=np.inf)
    simple = min((f for f in fits if not candidate(f.name).has_shapes), key=lambda f: f.misfit, default=None)
    explained = simple is not None and not is_significant(problem.null, simple.rho, simple.prediction)
    enough = simple.misfit if simple and explained else np.inf
    near = before - WORTH * (before - least)
    return [f for f in fits if candidate(f.name).has_shapes and f.misfit < min(near, enough)]


def with_fitted_shapes(problem: Problem, fitted: Fit) -> Fit:
    """The fit with all fitted parameters of its candidate at their best."""
    name = fitted.name
    problem.begin(f"fitting the shape of {name}")
    only = problem.affected([name], fitted.prediction.mean - problem.null.mean)
    probe = probe_of(problem, [name], only, twins_of(name))
    free = [*((name, key) for key in problem.fitted_parameters(name)), *spreads_of(problem, fitted.model)]
    end = descend(problem, probe, fitted.model, fitted.base, free, COMPARED)
    shaped = where_ended(problem, fitted, end, free)
    return fitted if shaped.misfit > fitted.misfit else shaped


def where_ended(problem: Problem, fitted: Fit, end: Descent, free: Free) -> Fit:
    """The fit at the end of a descent over the parameters `free`, with errors of its own effect's."""
    values = next(e for e in end.model.effects if e.name == fitted.name).parameters()
    errors = zip(free, np.sqrt(np.diag(end.covariance)), strict=True)
    sd = {k: error_of(name, k, values[k], float(e)) for (name, k), e in errors if name == fitted.name}
    own = {k: values[k] for k in fitted.parameters}
    return problem.fit_of(fitted.name, own, end.model, end.base, end.prediction, sd)
