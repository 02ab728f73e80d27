"""Pairs of effects of which neither shows alone, a row of a table each: from where both are started at once.

dead_time + photo_response_nonlinearity     x (1 + tau x) / (1 + tau x (1 + tau x)) = x (1 - (tau x)^2 + ...)
    The mean rate stays to first order, and what both leave together goes with the square of their strength.
clock_feedthrough + readout_skew            rows that are read at other moments see an edge of the clock each elsewhere
    In a static scene the skew shows by the edge alone, and the edge without it fits few rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from spikecam_env.gap.candidates.strength import bounded, with_effect
from spikecam_env.gap.candidates.table import LACKING, candidate
from spikecam_env.gap.compare.prediction import with_change_scaled
from spikecam_env.gap.compare.step import scale_to
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import CATALOGUE, SensorModel

Parameters = dict[str, float]
Both = tuple[Parameters, Parameters]
"""Parameters of the first effect and of the second."""


@dataclass(frozen=True)
class Pair:
    """Two effects that are started together.

    names: of both.  starts: parameters of both to begin from, for a problem.  scaled: those whose strengths are scaled
    by what a twin shows, which goes with their `power`.  may_hide: whether a model to which `effects` were added, in a
    problem, may lack the two.
    """

    names: tuple[str, str]
    starts: Callable[[Problem], list[Both]]
    scaled: tuple[str, ...]
    power: float
    may_hide: Callable[[Problem, tuple[str, ...]], bool]


def cancelling_bends(problem: Problem) -> list[Both]:
    """A dead time of 1 us, and the non-linearity that takes as much off the interval as it adds."""
    return [({"tau_us": 1.0}, {"beta": -1e-6 * problem.case.frame_rate_hz})]


def edge_in_rows(problem: Problem) -> list[Both]:
    """The grid that the read-out of rows declares (`identification.start_with`)."""
    starts = candidate("readout_skew").start_with["clock_feedthrough"]
    grid = [dict(zip(starts, values, strict=True)) for values in product(*starts.values())]
    return [(bounded("clock_feedthrough", p), bounded("readout_skew", p)) for p in grid]


def a_bend_alone(problem: Problem, effects: tuple[str, ...]) -> bool:
    """Whether one bend of the rate curve was found, which may stand for what two leave."""
    return sum(candidate(name).bends_response for name in effects) == 1


def a_scene_alone(problem: Problem, effects: tuple[str, ...]) -> bool:
    """Whether nothing was found yet in recordings that do not show the skew by itself."""
    shown = problem.case.conditions
    return not effects and problem.case.scenes_only and LACKING[candidate("readout_skew").needs](shown) is not None


BENDS, EDGE = ("dead_time", "photo_response_nonlinearity"), ("clock_feedthrough", "readout_skew")

PAIRS = (
    Pair(BENDS, starts=cancelling_bends, scaled=BENDS, power=2.0, may_hide=a_bend_alone),
    Pair(EDGE, starts=edge_in_rows, scaled=EDGE[:1], power=1.0, may_hide=a_scene_alone),
)


def fit_pair(here: Problem, pair: Pair) -> Fit:
    """Both effects at the strengths that suit what is seen best, from the best of their starts."""
    unit = constrained_refit(here.model, here.case.base)
    best, factor = min((scaled_once(here, pair, s, unit) for s in pair.starts(here)), key=lambda t: t[0].misfit)
    round_off = here.settings.fitting.round_off
    for _ in range(here.settings.fitting.most_steps - 1):
        if round_off[0] < factor < round_off[1]:
            break
        again, factor = scaled_once(here, pair, parameters_in(best.model, pair), best.base)
        best = min((best, again), key=lambda f: f.misfit)
    return best


def scaled_once(here: Problem, pair: Pair, start: Both, base: BaseFit) -> tuple[Fit, float]:
    """(fit of both scaled to what is seen by one twin, the factor); of a wrong sign hardly anything is left."""
    there = with_both(here.model, pair, start)
    predicted = here.predict(there, constrained_refit(there, base), 1, here.affected(pair.names))
    most = here.settings.twins.most_extrapolated
    scale = max(scale_to(here.null, here.seen, predicted)[0], most**-pair.power)
    factor = float(np.clip(scale ** (1 / pair.power), 1 / most, most))
    parameters = tuple(
        stronger(n, p, factor) if n in pair.scaled else p for n, p in zip(pair.names, start, strict=True)
    )
    base = here.settled_unit(there, constrained_refit(there, base), predicted)
    predicted = with_change_scaled(here.null, predicted, factor**pair.power)
    rho, left = here.residual_and_misfit(predicted)
    name, (first, second) = pair.names[1], parameters
    own = {key: second[key] for key in candidate(name).fitted}
    return Fit(name, own, {}, predicted, base, rho, left, with_both(here.model, pair, (first, second))), factor


def stronger(name: str, parameters: Parameters, factor: float) -> Parameters:
    """Parameters of an effect with its strength times a factor."""
    strength = candidate(name).strength
    return bounded(name, {**parameters, strength: factor * parameters[strength]})


def with_both(model: SensorModel, pair: Pair, both: Both) -> SensorModel:
    """The model with both effects."""
    for name, parameters in zip(pair.names, both, strict=True):
        model = with_effect(model, name, CATALOGUE[name]().parameters() | parameters)
    return model


def parameters_in(model: SensorModel, pair: Pair) -> Both:
    """Parameters of both in a model that has them."""
    first, second = (next(e for e in model.effects if e.name == name).parameters() for name in pair.names)
    return first, second
