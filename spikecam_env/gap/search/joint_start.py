"""Two effects of which neither is found alone, fitted at once.

An edge of the array's clock gathers pixels in every row.  It shows as late and early spikes in rows that are read at
its moment.  In a static scene a rolling read-out shows by the edge alone, and the edge without it fits few rows.  An
effect declares its partner, and the values of their parameters to start from (`start_with`).

Two bends cancel: a dead time and a non-linearity of the other sign leave the mean rate alone to first order.

    x (1 + tau x) / (1 + tau x (1 + tau x)) = x (1 - (tau x)^2 + ...)        of each alone a part in tau x

The best fit of one alone stands in for the second order, and is far smaller than either.  The change by both goes with
the square of their strength, so one twin of both gives the strength.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from spikecam_env.gap.candidates.strength import MOST_EXTRAPOLATED, bounded, with_effect
from spikecam_env.gap.candidates.table import LACKING, candidate
from spikecam_env.gap.compare.prediction import with_change_scaled
from spikecam_env.gap.compare.step import scale_to
from spikecam_env.gap.fit.candidate import LARGEST_FACTOR, ROUND_OFF, where_ended
from spikecam_env.gap.fit.gauss_newton import COMPARED, MOST_STEPS, descend, probe_of
from spikecam_env.gap.fit.hypothesis import Fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.unit.indirect_inference import extrapolated_unit
from spikecam_env.gap.unit.refit import constrained_refit
from spikecam_env.sensor import CATALOGUE, SensorModel

DESCENTS = 2
"""Starts of two effects that start jointly, from which both are fitted."""


CANCELLING = ("dead_time", "photo_response_nonlinearity")

START_US = 1.0
"""Dead time [us] of the first twin of both."""


@dataclass(frozen=True)
class Pair:
    """Two effects: the recordings show `second` only beside `first`."""

    first: str
    second: str

    @property
    def names(self) -> tuple[str, str]:
        """Names of both."""
        return self.first, self.second


def pairs(problem: Problem, names: Collection[str]) -> list[Pair]:
    """Pairs among the candidates to fit at once: in unknown scenes, where the second shows only by the first."""
    if not problem.case.scenes_only:
        return []
    lacking = [n for n in names if LACKING[candidate(n).needs](problem.case.conditions) is not None]
    return [Pair(first, second) for second in lacking for first in candidate(second).start_with if first in names]


def fit_pairs(here: Problem, names: Collection[str]) -> list[Fit]:
    """A fit of each pair, as one of its first effect, whose model has both; those that the budget allows."""
    return [fit for pair in pairs(here, names) if (fit := _fit_pair(here, pair)) is not None]


def _fit_pair(here: Problem, pair: Pair) -> Fit | None:
    starts = candidate(pair.second).start_with[pair.first]
    grid = [dict(zip(starts, values, strict=True)) for values in product(*starts.values())]
    only = here.affected(pair.names)
    free = [(name, key) for name in pair.names for key in candidate(name).fitted]
    cost = len(only) * (len(grid) + DESCENTS * (1 + len(free)))
    if not here.allows(f"{pair.first} with {pair.second}", cost, needed=True):
        return None
    fitted = candidate(pair.first).fitted
    strength = fitted[0]

    def start(parameters: dict[str, float]) -> Fit:
        second, first = (CATALOGUE[name]().parameters() | bounded(name, parameters) for name in reversed(pair.names))
        model = with_effect(here.model, pair.second, second)
        tried = with_effect(model, pair.first, first)
        predicted = here.predict(tried, constrained_refit(tried, here.case.base), 1, only)
        scale, _ = scale_to(here.null, here.seen, predicted)
        scale = float(np.sign(scale) * np.clip(abs(scale), 1 / LARGEST_FACTOR, LARGEST_FACTOR))
        scaled = bounded(pair.first, {**first, strength: first[strength] * scale})
        predicted, model = with_change_scaled(here.null, predicted, scale), with_effect(model, pair.first, scaled)
        own = {k: scaled[k] for k in fitted}
        return here.fit_of(pair.first, own, model, constrained_refit(model, here.case.base), predicted)

    def descended(fit: Fit) -> Fit:
        end = descend(here, probe_of(here, pair.names, only, 1), fit.model, fit.base, free, COMPARED)
        return where_ended(here, fit, end, free)

    with ThreadPoolExecutor(here.case.jobs) as pool:
        best = sorted(pool.map(start, grid), key=lambda f: f.misfit)[:DESCENTS]
        fits = list(pool.map(descended, best))
    return min(fits, key=lambda f: f.misfit)


def with_pairs(fits: Sequence[Fit], of_pairs: Sequence[Fit], tie: float) -> list[Fit]:
    """Fits of single candidates; a pair's replaces its first effect's if it leaves less misfit by more than a tie."""
    alone = {f.name: f.misfit for f in fits}
    better = {f.name: f for f in of_pairs if f.misfit < alone.get(f.name, np.inf) - tie}
    return [*better.values(), *(f for f in fits if f.name not in better)]


def one_by_one(turn: Round) -> list[Round]:
    """The round; where another effect is fitted with its best, as two, the second of that one."""
    best = turn.fits[0]
    rounds = [turn]
    for name in best.added_to(turn.start.model)[1:]:
        parameters = {k: best.parameters_of(name)[k] for k in candidate(name).fitted}
        own = replace(best, name=name, parameters=parameters, sd={})
        start = replace(turn.start, model=best.model.without(name))
        rounds.append(replace(turn, start=start, fits=(own,), rivals=()))
    return rounds


def fit_cancelling_pair(problem: Problem, names: Collection[str]) -> Fit | None:
    """Fit two bends that cancel at once, by one strength.

    Args:
        problem: the problem before any effect was added.

    Returns:
        A fit of the dead time whose model has both.  None if the strength has the wrong sign, or if one of them is no
        candidate.
    """
    if not set(CANCELLING) <= set(names):
        return None
    frame_rate_hz = problem.case.frame_rate_hz
    only = problem.affected(CANCELLING)
    tau_us = START_US
    bare = base = constrained_refit(
        with_both(problem.model, tau_us, frame_rate_hz), constrained_refit(problem.model, problem.case.base)
    )
    for _ in range(MOST_STEPS):
        model = with_both(problem.model, tau_us, frame_rate_hz)
        predicted = problem.predict(model, base, 1, only)
        base = problem.settled_unit(model, base, predicted)
        square, _ = scale_to(problem.null, problem.seen, predicted)
        if square <= 0:
            return None
        factor = float(np.clip(np.sqrt(square), 1 / MOST_EXTRAPOLATED, MOST_EXTRAPOLATED))
        base, tau_us = extrapolated_unit(bare, base, factor**2, MOST_EXTRAPOLATED), tau_us * factor
        if ROUND_OFF[0] < factor < ROUND_OFF[1]:
            break
    predicted = with_change_scaled(problem.null, predicted, factor**2)
    model = with_both(problem.model, tau_us, frame_rate_hz)
    return problem.fit_of(CANCELLING[0], {"tau_us": tau_us}, model, base, predicted)


def with_both(model: SensorModel, tau_us: float, frame_rate_hz: float) -> SensorModel:
    """The model with a dead time and the non-linearity that cancels it."""
    beta = -tau_us * 1e-6 * frame_rate_hz
    bent = with_effect(model, CANCELLING[0], bounded(CANCELLING[0], {"tau_us": tau_us}))
    return with_effect(bent, CANCELLING[1], bounded(CANCELLING[1], {"beta": beta}))
