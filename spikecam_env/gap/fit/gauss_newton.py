"""Gauss-Newton over the parameters of effects (`coordinates.py`), on twins of the same draws as the null's.

Derivatives cost a twin a parameter.  They are taken once, and then corrected by the change of each step (Broyden), but
of a long one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from spikecam_env.gap.candidates.strength import bounded, with_effect
from spikecam_env.gap.candidates.table import Candidates, candidate
from spikecam_env.gap.compare.distance import APART, SHOWS
from spikecam_env.gap.compare.prediction import Null, Prediction, own_variance
from spikecam_env.gap.compare.step import change_of, step_of
from spikecam_env.gap.fit.coordinates import moved_value
from spikecam_env.gap.fit.predict import settled_unit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.fit.slopes import NEAR, NO_SLOPES, UNIT, Free, Slopes
from spikecam_env.gap.twins.fresh_units import SPREAD_PARAMETERS, with_spreads_scaled
from spikecam_env.gap.unit.indirect_inference import has_converged
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats

PROBES = 2
"""Times that a model is probed: under the last unit, and under the unit that settles."""

STOP = 1.0
"""Least misfit that another step has to promise.  Small, since two parameters that compensate each other may both be
far off while a step gains little."""

COMPARED = 5 * STOP
"""As `STOP`, while candidates are compared: less would not change their order."""

MOST_STEPS = 4
"""Steps of a descent, and of effects that start together."""

SMALL_STEP = 0.05
"""Step of a logarithm that needs no other; two strengths so close show no slope."""

LONGEST_STEP = 0.7
"""Largest step of a logarithm at once, a factor of two, within what was open of the parameter before."""

WHITE = (UNIT, "white")
"""The unit's own s^2, where an effect hides it."""

UNIT_STEP = -0.2
"""Step of the logarithm of a unit's parameter to take a derivative by."""

UNITS_OF_A_STEP = 4
"""Fresh units of a twin of maps in a descent; a choice: they show their own chance."""

STRENGTH_STEPS = (0.25, 1.0)
"""Steps of a strength's logarithm to take a derivative by, at least and at most."""


@dataclass(frozen=True)
class Probe:
    """Predicts the statistics of a model and a unit."""

    by: Callable[[SensorModel, BaseFit, int], Prediction]
    """By a number of twins."""
    count: int = 1
    """Number of twins that show them."""

    def __call__(self, model: SensorModel, base: BaseFit) -> Prediction:
        return self.by(model, base, self.count)


@dataclass(frozen=True)
class Descent:
    """The end of a descent."""

    model: SensorModel
    base: BaseFit
    prediction: Prediction
    """Prediction of the last twins, the last step added in proportion."""
    columns: Floats
    """(S, n) derivatives by the n parameters' logarithms."""
    noise: Floats
    """(S, n) standard deviations of `columns`."""
    covariance: Floats
    """(n, n) covariance of the logarithms."""


def probe_of(problem: Problem, names: Sequence[str], only: Sequence[int], count: int) -> Probe:
    """The probe of effects: twins of some recordings, and drawn units where an effect changes the pattern.

    Args:
        names: of the effects.
        only: recordings to simulate, by index; none where all effects change the pattern alone.
        count: number of twins.
    """
    maps = problem.case.rates_only
    draws_units, units = Candidates(tuple(names)).any_pattern or maps, UNITS_OF_A_STEP if maps else None

    def statistics(model: SensorModel, base: BaseFit, count: int) -> Prediction:
        made = problem.predict(model, constrained_refit(model, base), count, only) if only else problem.null.prediction
        return problem.with_pattern(model, made, units) if draws_units else made

    return Probe(statistics, count)


def descend(
    problem: Problem,
    probe: Probe,
    model: SensorModel,
    base: BaseFit,
    free: Free,
    to_step: float = STOP,
    known: Slopes = NO_SLOPES,
) -> Descent:
    """Move the parameters `free` of a model to the least misfit.

    Where later steps leave more, the best point is returned, the first of several that are as good.  A last step is not
    taken if it promises little and is as long as a step may be.

    Args:
        probe: predicts the statistics of a model.
        model: the model to start from.
        free: parameters to move.
        to_step: misfit that a step has to promise, and the step before to have removed; default: that of a chosen
            effect.
        known: derivatives at the start, which are not taken.
    """
    null = problem.null
    at, base = at_settled_unit(probe, null, model, base, free)
    columns, noise = derivatives(problem, probe, model, base, at, free, known)
    before, longest = prior_sd(free), longest_of(free)
    tried = []
    for turn in range(MOST_STEPS):
        step, covariance = step_of(null, problem.seen, at, columns, noise, before)
        step = np.clip(step, -longest, longest)
        left, promised = (problem.misfit(p) for p in (at, replace(at, mean=at.mean + columns @ step)))
        tried.append((left, Descent(model, base, at, columns, noise, covariance)))
        model, base = moved(model, unit_after(model, base, null, at, free), free, step)
        little = left - promised < to_step or (turn > 0 and 0 <= tried[-2][0] - left < to_step)
        if turn == MOST_STEPS - 1 or little or np.all(np.abs(step) < SMALL_STEP):
            break
        after, base = at_settled_unit(probe, null, model, base, free)
        if np.abs(step).max() < NEAR:
            own = np.sqrt(own_variance(null, at) + own_variance(null, after))
            columns = broyden(columns, step, after.mean - at.mean, APART * own)
        else:
            columns, noise = derivatives(problem, probe, model, base, after, free)
        at = after
    least = min(t[0] for t in tried)
    guess = little and bool(np.any(np.abs(step) >= longest))
    if guess or left > least + problem.settings.deviance.by_chance:
        return next(point for misfit, point in tried if misfit < least + STOP)
    return Descent(model, base, replace(at, mean=at.mean + columns @ step), columns, noise, covariance)


def broyden(columns: Floats, step: Floats, change: Floats, noise: Floats | float = 0.0) -> Floats:
    """Correct derivatives by the change that a step made; derivatives of 0 stay.

    Args:
        columns: (S, n) derivatives.
        step: (n,) the step.
        change: (S,) change of the statistics.
        noise: (S,) largest surprise that is chance.  Over a short step, chance would look like knowledge.
    """
    surprise = change - columns @ step
    corrected = (columns != 0) & (np.abs(surprise) > noise)[:, None]
    return np.asarray(columns + corrected * np.outer(surprise, step) / (step @ step))


def spreads_of(problem: Problem, model: SensorModel) -> list[tuple[str, str]]:
    """Spreads of the unit that are fitted with effects: those of maps of rates, where no refit shows each pixel."""
    has = {e.name for e in model.effects} if problem.case.rates_only else set()
    return [(UNIT, part) for part, spreads in SPREAD_PARAMETERS.items() if has & spreads.keys()]


def moved(model: SensorModel, base: BaseFit, free: Free, step: Floats) -> tuple[SensorModel, BaseFit]:
    """The model and the unit with the coordinates of these parameters moved."""
    for (name, key), s in zip(free, step, strict=True):
        if (name, key) == WHITE:
            base = replace(base, white=base.white * float(np.exp(s)))
            continue
        if name == UNIT:
            factor = float(np.exp(s))
            model = with_spreads_scaled(model, model, {key: factor}, (factor, factor))
            continue
        here = next(e for e in model.effects if e.name == name).parameters()
        model = with_effect(model, name, bounded(name, {**here, key: moved_value(name, key, here[key], float(s))}))
    return model, base


def derivatives(
    problem: Problem,
    probe: Probe,
    model: SensorModel,
    base: BaseFit,
    at: Prediction,
    free: Free,
    known: Slopes = NO_SLOPES,
) -> tuple[Floats, Floats]:
    """Derivatives of the statistics by the parameters' logarithms, each under a unit that has settled.

    Under a unit that has not, saturated light would say too much.  A statistic counts for all parameters of an effect
    if one of them clearly moves it.

    Args:
        probe: predicts the statistics of a model.
        at: the prediction of the model.
        free: the n parameters.
        known: derivatives by some of them, which are not taken.

    Returns:
        ((S, n) derivatives, (S, n) their standard deviations).
    """
    new = [f for f in free if f not in known.free]
    if new:
        known = Slopes(tuple(new), *_taken(problem, probe, model, base, at, new), (np.nan,) * len(new)).beside(known)
    own = known.of(free)
    return own.columns, own.noise


def _taken(
    problem: Problem, probe: Probe, model: SensorModel, base: BaseFit, at: Prediction, free: Free
) -> tuple[Floats, Floats]:
    """`derivatives` by twins of each parameter a step away."""
    null = problem.null
    peak = float(np.max(np.abs(at.mean - null.mean) / null.noise))
    sizes = np.array([derivative_step(name, key, peak) for name, key in free])
    with ThreadPoolExecutor(problem.case.jobs) as pool:
        steps = [moved(model, base, [key], np.array([size])) for key, size in zip(free, sizes, strict=True)]
        beside = [
            made for made, _ in pool.map(lambda step: at_settled_unit(probe, null, step[0], step[1], free), steps)
        ]
    changes, noise, clear = (
        np.stack(v, axis=1) for v in zip(*(change_of(null, problem.seen, p, at) for p in beside), strict=True)
    )
    same_effect = np.array([[name == other for name, _ in free] for other, _ in free])
    return np.where(clear @ same_effect, changes, 0.0) / sizes, noise / sizes


def at_settled_unit(
    probe: Probe, null: Null, model: SensorModel, base: BaseFit, free: Free
) -> tuple[Prediction, BaseFit]:
    """(prediction of a model under a settled unit, that unit); one twin shows whether the unit moves."""
    made = probe.by(model, base, 1)
    settled = unit_after(model, base, null, made, free)
    if not has_converged(base, settled):
        return probe(model, settled), settled
    return (made if probe.count == 1 else probe(model, base)), base


def unit_after(model: SensorModel, base: BaseFit, null: Null, made: Prediction, free: Free) -> BaseFit:
    """The unit that settles (`predict.settled_unit`); an s^2 that is fitted stays."""
    settled = settled_unit(model, constrained_refit(model, base), null, made)
    return replace(settled, white=base.white) if WHITE in free else settled


def prior_sd(free: Free) -> Floats:
    """(n,) standard deviations of the logarithms before any data: 1, of a shape twice the step of its derivative."""
    fitted = [name != UNIT and key != candidate(name).strength for name, key in free]
    return np.array(
        [2 * abs(candidate(f[0]).shape_step) if shape else 1.0 for f, shape in zip(free, fitted, strict=True)]
    )


def longest_of(free: Free) -> Floats:
    """(n,) largest step of each logarithm at once: `LONGEST_STEP`, and no more than its `prior_sd`."""
    return np.minimum(prior_sd(free), LONGEST_STEP)


def derivative_step(name: str, key: str, peak: float) -> float:
    """Step of a logarithm to take a derivative by, long enough to show above the twins' own noise.

    Args:
        peak: noises by which the effect shows.
    """
    if name == UNIT:
        return UNIT_STEP
    if key != candidate(name).strength:
        return candidate(name).shape_step
    return float(np.clip(SHOWS / max(peak, 1e-9), *STRENGTH_STEPS))
