"""Search for effects of the pattern in maps: candidates fitted, the best added, while something is left.

Parameters are fitted by Gauss-Newton on the statistics, with the same draws at every step, together with all that were
added before and the model's own spreads; how a spread is shared between a Gaussian and a tail is nearly free, and
stated errors do not say so.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.candidates.strength import bounded, with_effect
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import HEAVY, is_significant, residual, robust_squares
from spikecam_env.gap.compare.prediction import Null, Prediction, values_of
from spikecam_env.gap.maps.bank import MapCase, map_bank, unit_maps, with_use
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.twins.fresh_units import SPREAD_PARAMETERS as UNIT_SPREADS
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.types import Floats

STEPS = 6
"""Steps of a fit."""

FITTED_SPREADS = {"response": UNIT_SPREADS["gain"], "dark": UNIT_SPREADS["dark"]}
"""Parameters that are scaled to fit how pixels differ: by the quantity they spread, then by effect."""

LINEAR_PARAMETERS = ("centre_x", "centre_y")
"""Parameters that are fitted in their own unit; all others are fitted by their logarithm."""

DERIVATIVE_STEP = 0.1
"""Step of a derivative, of a parameter's logarithm or in its own unit."""

FIRST_DAMPING = 0.02
"""Share of the curvature that is added to it at first (Levenberg and Marquardt)."""


@dataclass(frozen=True)
class PatternModel:
    """A model in the search."""

    model: SensorModel
    factors: dict[str, float]
    """Factors of its own spreads."""
    added: tuple[str, ...] = ()
    """Names of the effects that were added."""

    @property
    def fitted(self) -> SensorModel:
        """The model with its spreads scaled."""
        out = self.model
        for kind, spreads in FITTED_SPREADS.items():
            for effect in self.model.effects:
                if effect.name in spreads and kind in self.factors:
                    key = spreads[effect.name]
                    out = out.with_effect(replace(effect, **{key: effect.parameters()[key] * self.factors[kind]}))
        return out


@dataclass(frozen=True)
class MapFit:
    """A fit of a candidate beside those that were added before."""

    name: str
    """Name of the candidate, "" for spreads alone."""
    state: PatternModel
    sd: dict[str, float]
    """Standard deviations, by "effect.parameter" and of the factors."""
    predicted: Floats
    """(S,) predicted statistics."""
    rho: Floats
    """(S,) residuals, in noise."""
    misfit: float


def mean_prediction(null: Null, mean: Floats, units: int) -> Prediction:
    """A mean over that many units."""
    return Prediction(mean, null.sd / np.sqrt(units), null.sd)


def unit_means(state: PatternModel, case: MapCase, keys: Sequence[StatisticKey], units: Sequence[int]) -> Floats:
    """(S,) mean statistics over units."""
    mean: Floats = np.mean([values_of(map_bank(unit_maps(state.fitted, case, n)), keys) for n in units], axis=0)
    return mean


def spreads_matched(state: PatternModel, case: MapCase, measured: dict[StatisticKey, float]) -> PatternModel:
    """Spreads moved towards the measured width of each kind of map, as far as units differ."""
    for _ in range(2):
        simulated = map_bank(unit_maps(state.fitted, case, 0))
        factors = dict(state.factors)
        for spread, kinds in (("response", ("flat", "picture")), ("dark", ("dark",))):
            keys = [
                StatisticKey("texture", m.shown.name, "fine")
                for m in case.maps
                if m.shown.kind in kinds and m.shown.use == "fit"
            ]
            off = [measured[k] - simulated[k] for k in keys if k in measured and k in simulated]
            if off and any(e.name in FITTED_SPREADS[spread] for e in state.model.effects):
                factors[spread] = float(
                    np.clip(factors.get(spread, 1.0) * np.exp(np.mean(off)), *case.settings.unit.spread_limits)
                )
        state = replace(state, factors=factors)
    return state


def search_maps(
    case: MapCase, given: PatternModel, null: Null, values: Floats, names: Sequence[str]
) -> tuple[list[list[MapFit]], list[MapFit]]:
    """Add candidates while something is left.

    Returns:
        (rounds, rejected): the spreads alone, then the fits of each round, the best first; the fits of the last round,
        if it did not help.
    """
    rounds = [[fit_candidate(case, given, null, values, "")]]
    left = list(names)
    while left and len(rounds) <= case.settings.maps.most_effects:
        now = rounds[-1][0]
        if not is_significant(null, now.rho):
            break
        with ThreadPoolExecutor(case.jobs) as pool:
            tried = list(pool.map(lambda n, start=now.state: fit_candidate(case, start, null, values, n), left))
        tried.sort(key=lambda t: t.misfit)
        if tried[0].misfit > now.misfit - case.settings.deviance.accept_map:
            return rounds, tried
        rounds.append(tried)
        left = [t.name for t in tried[1:] if t.misfit < now.misfit]
    return rounds, []


def fit_candidate(case: MapCase, start: PatternModel, null: Null, values: Floats, name: str) -> MapFit:
    """A candidate's parameters, all that were added before, and the spreads, together."""
    state = start
    if name:
        default = CATALOGUE[name]().parameters()
        state = PatternModel(with_effect(state.model, name, default), state.factors, (*state.added, name))
    varied = [("", w) for w in FITTED_SPREADS if w in state.factors]
    varied += [(n, p) for n in state.added for p in fitted_parameters(n)]
    use, units = with_use(case, null.keys, "fit"), case.settings.maps.units
    sd = dict.fromkeys((f"{n}.{p}" for n, p in varied), np.nan)
    damping, best, least = FIRST_DAMPING, state, np.inf
    for _ in range(STEPS):
        at = unit_means(state, case, null.keys, [0])
        now = robust_squares(residual(null, values, mean_prediction(null, at, 1))[use])
        if now > least:
            damping *= 8.0
        else:
            best, least, predicted = state, now, at
            jacobian = np.stack(
                [unit_means(_moved(best, f, DERIVATIVE_STEP), case, null.keys, [0]) - predicted for f in varied], axis=1
            ) / DERIVATIVE_STEP if varied else np.zeros((len(at), 0))  # fmt: skip
            damping *= 0.5
        if not varied:
            break
        step, covariance = _step(null, values, predicted, np.nan_to_num(jacobian), use, damping)
        sd = dict(zip(sd, np.sqrt(np.diag(covariance)), strict=True))
        state = best
        for f, s in zip(varied, np.clip(step, -1.0, 1.0), strict=True):
            state = _moved(state, f, float(s))
        if np.abs(step).max() < 0.01:
            break
    predicted = unit_means(best, case, null.keys, range(units))
    rho = residual(null, values, mean_prediction(null, predicted, units))
    return MapFit(name, best, sd, predicted, rho, robust_squares(rho[use]))


def fitted_parameters(name: str) -> tuple[str, ...]:
    """Fitted parameters of a candidate: those of the table, and its centre."""
    return (*candidate(name).fitted, *(p for p in LINEAR_PARAMETERS if p in CATALOGUE[name].__dataclass_fields__))


def _moved(state: PatternModel, parameter: tuple[str, str], step: float) -> PatternModel:
    """A parameter changed by a step, of its logarithm or in its own unit."""
    name, key = parameter
    if not name:
        return replace(
            state, factors={**state.factors, key: float(np.clip(state.factors[key] * np.exp(step), 1e-3, 1e3))}
        )
    effect = next(e for e in state.model.effects if e.name == name)
    old = effect.parameters()
    new = old[key] + step if key in LINEAR_PARAMETERS else old[key] * np.exp(step)
    return replace(state, model=with_effect(state.model, name, bounded(name, {**old, key: new})))


def _step(
    null: Null, values: Floats, predicted: Floats, jacobian: Floats, use: NDArray[np.bool_], damping: float
) -> tuple[Floats, Floats]:
    """Damped Gauss-Newton step under the heavy-tailed loss, and the covariance of parameters."""
    rho = residual(null, values, mean_prediction(null, predicted, 1))
    gap = np.nan_to_num(values - predicted)
    noise = np.where(np.abs(rho) > 1e-9, np.abs(gap) / np.maximum(np.abs(rho), 1e-9), null.noise)
    w = np.where(use, (HEAVY + 1) / (HEAVY + rho**2) / noise**2, 0.0)
    square = jacobian.T @ (w[:, None] * jacobian) + 1e-9 * np.eye(jacobian.shape[1])
    step = np.linalg.solve(square + damping * np.diag(np.diag(square)), jacobian.T @ (w * gap))
    return np.asarray(step, np.float64), np.asarray(np.linalg.inv(square), np.float64)
