"""Fitting one candidate: simulate the campaign with it, scale and shape it until its statistics are the measured ones.

Every twin is compared with the null's of the same draws, so that what is left of their difference is the effect.
Statistics move in proportion to the strength (or its square), so each twin says by how much to scale the next; its
other parameters are of `shapes`.  The unit is refitted along the way, so that the candidate cannot borrow from it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from spikecam_env.gap.candidates.strength import MOST_EXTRAPOLATED, TARGET_SIZE, amplified, bounded, with_effect
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import effect_size
from spikecam_env.gap.compare.prediction import Prediction, with_change_scaled
from spikecam_env.gap.compare.step import likeliest, scale_to, slope_of, step_of
from spikecam_env.gap.fit.gauss_newton import COMPARED, LONGEST_STEP, MOST_STEPS, SMALL_STEP
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.fit.recordings import OF_RANDOM_COURSE, twins_of
from spikecam_env.gap.unit.indirect_inference import extrapolated_unit, has_converged
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats

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


@dataclass(frozen=True, eq=False)
class Fit:
    """A candidate at its best fit.  parameters, sd: by name.  prediction: of its model; base: its unit.

    rho: (S,) residuals, in noise.  misfit: `distance.residual_and_misfit`.
    """

    name: str
    parameters: dict[str, float]
    sd: dict[str, float]
    prediction: Prediction
    base: BaseFit
    rho: Floats
    misfit: float
    model: SensorModel

    def added_to(self, model: SensorModel) -> list[str]:
        """Effects that it adds to a model, by name: its own, then those that are fitted with it."""
        has = {self.name, *(e.name for e in model.effects)}
        return [self.name, *(e.name for e in self.model.effects if e.name not in has)]


def fit(
    problem: Problem, name: str, start: Mapping[str, float], expected: Floats | None = None, white: float = 1.0
) -> Fit:
    """Best fit of one candidate's strength (of a pattern, all its parameters) added to the model.

    start: parameters near the best.  expected: (S,) change of the statistics to expect there, to leave out recordings
    that it does not concern.  white: s^2 of the unit there, over the refit's.
    """
    if candidate(name).is_pattern:
        return _fit_pattern(problem, name, start)
    if candidate(name).random_course:
        return _fit_random_course(problem, name, dict(start))
    return _fit_twins(problem, name, dict(start), expected, white)


def _fit_twins(problem: Problem, name: str, parameters: dict[str, float], expected: Floats | None, white: float) -> Fit:
    """Twins at the start, made stronger until they show, once more where the unit settles far off, scaled until the
    strength is right to a third and the unit has settled; the last step is a scaling of what was simulated, without
    another twin."""
    what, null, seen = candidate(name), problem.null, problem.seen
    strength, power = what.strength, what.power
    expected = np.full(len(null.keys), np.inf) if expected is None else expected
    parameters, times = amplified(name, bounded(name, parameters), effect_size(null, seen, expected))
    start = constrained_refit(problem.model, problem.case.base)
    bare = constrained_refit(with_effect(problem.model, name, parameters), start)
    base = replace(bare, white=white**times * bare.white)
    least = problem.misfit() - COMPARED
    only = problem.affected([name], expected * times)
    last: tuple[float, Prediction] | None = None
    slope: Floats | None = None
    settled_once = False
    for turn in range(MOST_TRIES):
        at_last = turn == MOST_TRIES - 1
        tried = with_effect(problem.model, name, parameters)
        predicted = problem.predict(tried, base, twins_of(name), only)
        size = effect_size(null, seen, predicted.mean - null.mean)
        stronger = parameters if at_last else until_visible(name, parameters, size)
        if stronger != parameters:
            times = abs(stronger[strength] / parameters[strength]) ** power
            base = extrapolated_unit(bare, base, times, MOST_EXTRAPOLATED)
            parameters, only = stronger, problem.affected([name])
            continue
        assumed, base = base, problem.settled_unit(tried, base, predicted)
        if not settled_once and not at_last and not has_converged(assumed, base):
            settled_once = True
            continue
        scale, sd = scale_to(null, seen, predicted)
        if problem.misfit(with_change_scaled(null, predicted, scale)) > least:
            factor, near = LEAST_FACTOR, True
            break
        now = parameters[strength], predicted
        slope = slope_between(problem, last, now) if power == 2.0 else None
        factor, last = factor_to(problem, name, predicted, scale, slope), now
        weak = abs(scale) * size < VISIBLE or (
            what.is_linear and 1 / MOST_EXTRAPOLATED < scale < 1 and scale * size < TARGET_SIZE
        )
        near = weak or ROUND_OFF[0] < factor < ROUND_OFF[1]
        if at_last or (near and turn):
            break
        if weak:
            continue
        parameters = bounded(name, {**parameters, strength: parameters[strength] * factor})
        base = extrapolated_unit(bare, base, factor**power, MOST_EXTRAPOLATED)
        only = problem.affected([name], (predicted.mean - null.mean) * factor**power)
    final = bounded(name, {**parameters, strength: parameters[strength] * factor}) if near else parameters
    moved = (final[strength] / parameters[strength]) ** power if parameters[strength] else 1.0
    if near and slope is not None:
        predicted = replace(predicted, mean=predicted.mean + slope * np.log(moved) / power)
    else:
        predicted = with_change_scaled(null, predicted, moved)
    rho, left = problem.residual_and_misfit(predicted)
    sds = {strength: abs(final[strength]) * (sd / max(abs(scale), 1e-9) / power)}
    there = with_effect(problem.model, name, final)
    unit = extrapolated_unit(bare, base, moved, MOST_EXTRAPOLATED)
    return Fit(name, final, sds, predicted, unit, rho, left, there)


def until_visible(name: str, parameters: dict[str, float], size: float) -> dict[str, float]:
    """The parameters at a strength that shows by twice `VISIBLE` noises, or where its bounds end; as they are where it
    shows.  size: noises that it shows by."""
    if size >= VISIBLE:
        return parameters
    strength = candidate(name).strength
    more = (2 * VISIBLE / max(size, 0.2)) ** (1 / candidate(name).power)
    return bounded(name, {**parameters, strength: parameters[strength] * more})


def factor_to(problem: Problem, name: str, predicted: Prediction, scale: float, slope: Floats | None) -> float:
    """By how much to multiply a strength: along its slope where there is one, else by what scales its change best; a
    tenth where that is negative and the strength cannot be."""
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
    """(S,) change of the statistics for one more of a strength's logarithm, by twins at two of them; None where these
    are not two.  What goes with the square of a strength saturates where other noise is, or is a logarithm of both."""
    if one is None or not one[0] * other[0] > 0 or abs(step := float(np.log(other[0] / one[0]))) < SMALL_STEP:
        return None
    null = problem.null
    both = (one[1].mean != null.mean) & (other[1].mean != null.mean)
    slope = slope_of(null, problem.seen, other[1], one[1], step) * both
    return slope if slope.any() else None


def _fit_random_course(problem: Problem, name: str, parameters: dict[str, float]) -> Fit:
    """The maximum-likelihood strength of an effect that shows by the scatter of its twins.

    Statistics of one recording are of one course in time: its strength is known no better than from one number each.
    """
    strength, power = candidate(name).strength, candidate(name).power
    only = problem.affected([name])
    for _ in range(2):
        there = with_effect(problem.model, name, bounded(name, parameters))
        base = constrained_refit(there, problem.case.base)
        predicted = problem.predict(there, base, OF_RANDOM_COURSE, only)
        factor, sd = likeliest(problem.null, problem.seen, predicted)
        parameters = bounded(name, {**parameters, strength: parameters[strength] * factor ** (1 / power)})
        if 1 / LARGEST_FACTOR < factor < LARGEST_FACTOR:
            break
    predicted = with_change_scaled(problem.null, predicted, factor)
    rho, left = problem.residual_and_misfit(predicted)
    sds = {strength: parameters[strength] * max(sd, np.sqrt(2.0 / len(only))) / power}
    return Fit(name, parameters, sds, predicted, base, rho, left, with_effect(problem.model, name, parameters))


def _fit_pattern(problem: Problem, name: str, start: Mapping[str, float]) -> Fit:
    """Coarse to fine search over the strength (and one more parameter), drawing units."""
    what = candidate(name)
    parameters = bounded(name, start)
    best: Fit | None = None
    for factors in ((0.03, 0.1, 0.3, 1.0, 3.0), (0.55, 0.75, 1.35, 1.8), (0.8, 0.9, 1.1, 1.25), (0.95, 1.05)):
        for key in what.fitted:
            centre = best.parameters if best else parameters
            for factor in factors:
                tried = bounded(name, {**centre, key: centre[key] * factor})
                there = with_effect(problem.model, name, tried)
                predicted = problem.with_pattern(there, problem.null.prediction)
                rho, left = problem.residual_and_misfit(predicted)
                now = Fit(name, tried, {}, predicted, constrained_refit(there, problem.case.base), rho, left, there)
                best = now if best is None or now.misfit < best.misfit else best
    assert best is not None
    return best
