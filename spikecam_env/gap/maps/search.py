"""Which effects of the pattern are in the maps: candidates fitted, the best added, while something is left.

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
from spikecam_env.gap.maps.bank import Maps, bank, of_use, unit_maps
from spikecam_env.gap.statistics import Key
from spikecam_env.gap.twins.fresh_units import SPREAD_LIMITS
from spikecam_env.gap.twins.fresh_units import SPREAD_PARAMETERS as OF_A_UNIT
from spikecam_env.sensor import CATALOGUE, SensorModel

Array = NDArray[np.float64]

UNITS = 8
"""Units of each model that its predictions are means over."""

STEPS = 6
"""Gauss-Newton steps of a fit."""

GAIN = 25.0
"""Misfit that an effect has to remove to be added."""

MOST = 5
"""Effects that one diagnosis of maps names together."""

SPREADS = {"response": OF_A_UNIT["gain"], "dark": OF_A_UNIT["dark"]}
"""What is scaled to fit how pixels differ: parameters of effects, by what they spread."""

SHARES = ("centre_x", "centre_y")
"""Parameters that are fitted as they are; all others by their logarithm."""

_NUDGE = 0.1


@dataclass(frozen=True)
class State:
    """A model on its way: names of effects added to it, and factors of its own spreads."""

    model: SensorModel
    factors: dict[str, float]
    added: tuple[str, ...] = ()

    @property
    def fitted(self) -> SensorModel:
        """The model with its spreads scaled."""
        out = self.model
        for what, spreads in SPREADS.items():
            for effect in self.model.effects:
                if effect.name in spreads and what in self.factors:
                    key = spreads[effect.name]
                    out = out.with_effect(
                        replace(effect, **{key: effect.parameters()[key] * self.factors[what]})  # type: ignore[arg-type]
                    )
        return out


@dataclass(frozen=True)
class Tried:
    """A fit.  name: of the candidate, "" for spreads alone.  parameters, sd: of the candidate, and of factors."""

    name: str
    state: State
    sd: dict[str, float]
    predicted: Array
    rho: Array
    misfit: float


def predicted_by(null: Null, mean: Array, units: int) -> Prediction:
    """A mean over that many units."""
    return Prediction(mean, null.sd / np.sqrt(units), null.sd)


def predict(state: State, case: Maps, keys: Sequence[Key], units: Sequence[int]) -> Array:
    """(S,) mean statistics over units."""
    return np.mean([values_of(bank(unit_maps(state.fitted, case, n)), keys) for n in units], axis=0)


def within(state: State, case: Maps, measured: dict[Key, float]) -> State:
    """Spreads moved towards the measured width of each kind of map, as far as units differ."""
    for _ in range(2):
        simulated = bank(unit_maps(state.fitted, case, 0))
        factors = dict(state.factors)
        for what, kinds in (("response", ("flat", "picture")), ("dark", ("dark",))):
            keys = [
                Key("texture", m.shown.name, "fine")
                for m in case.maps
                if m.shown.kind in kinds and m.shown.use == "fit"
            ]
            off = [measured[k] - simulated[k] for k in keys if k in measured and k in simulated]
            if off and any(e.name in SPREADS[what] for e in state.model.effects):
                factors[what] = float(np.clip(factors.get(what, 1.0) * np.exp(np.mean(off)), *SPREAD_LIMITS))
        state = replace(state, factors=factors)
    return state


def search(
    case: Maps, given: State, null: Null, values: Array, names: Sequence[str]
) -> tuple[list[list[Tried]], list[Tried]]:
    """(rounds, rejected): the spreads alone; then, each round, candidates, the one that leaves least first; and what
    was tried last and did not help."""
    rounds = [[fitted(case, given, null, values, "")]]
    left = list(names)
    while left and len(rounds) <= MOST:
        now = rounds[-1][0]
        if not is_significant(null, now.rho):
            break
        with ThreadPoolExecutor(case.jobs) as pool:
            tried = list(pool.map(lambda n, start=now.state: fitted(case, start, null, values, n), left))
        tried.sort(key=lambda t: t.misfit)
        if tried[0].misfit > now.misfit - GAIN:
            return rounds, tried
        rounds.append(tried)
        left = [t.name for t in tried[1:] if t.misfit < now.misfit]
    return rounds, []


def fitted(case: Maps, start: State, null: Null, values: Array, name: str) -> Tried:
    """A candidate's parameters, all that were added before, and the spreads, together."""
    state = start
    if name:
        default = CATALOGUE[name]().parameters()
        state = State(with_effect(state.model, name, default), state.factors, (*state.added, name))
    free = [("", w) for w in SPREADS if w in state.factors]
    free += [(n, p) for n in state.added for p in free_of(n)]
    use = of_use(case, null.keys, "fit")
    sd = dict.fromkeys((f"{n}.{p}" for n, p in free), np.nan)
    damping, best, least = 0.02, state, np.inf
    for _ in range(STEPS):
        at = predict(state, case, null.keys, [0])
        now = robust_squares(residual(null, values, predicted_by(null, at, 1))[use])
        if now > least:
            damping *= 8.0
        else:
            best, least, predicted = state, now, at
            jacobian = np.stack(
                [predict(_moved(best, f, _NUDGE), case, null.keys, [0]) - predicted for f in free], axis=1
            ) / _NUDGE if free else np.zeros((len(at), 0))  # fmt: skip
            damping *= 0.5
        if not free:
            break
        step, covariance = _step(null, values, predicted, np.nan_to_num(jacobian), use, damping)
        sd = dict(zip(sd, np.sqrt(np.diag(covariance)), strict=True))
        state = best
        for f, s in zip(free, np.clip(step, -1.0, 1.0), strict=True):
            state = _moved(state, f, float(s))
        if np.abs(step).max() < 0.01:
            break
    predicted = predict(best, case, null.keys, range(UNITS))
    rho = residual(null, values, predicted_by(null, predicted, UNITS))
    return Tried(name, best, sd, predicted, rho, robust_squares(rho[use]))


def free_of(name: str) -> tuple[str, ...]:
    return (*candidate(name).fitted, *(p for p in SHARES if p in CATALOGUE[name].__dataclass_fields__))


def _moved(state: State, what: tuple[str, str], step: float) -> State:
    """A parameter changed by a step, of its logarithm or in its own unit."""
    name, key = what
    if not name:
        return replace(
            state, factors={**state.factors, key: float(np.clip(state.factors[key] * np.exp(step), 1e-3, 1e3))}
        )
    effect = next(e for e in state.model.effects if e.name == name)
    old = effect.parameters()
    new = old[key] + step if key in SHARES else old[key] * np.exp(step)
    return replace(state, model=with_effect(state.model, name, bounded(name, {**old, key: new})))


def _step(
    null: Null, values: Array, predicted: Array, jacobian: Array, use: NDArray[np.bool_], damping: float
) -> tuple[Array, Array]:
    """Damped Gauss-Newton step under the heavy-tailed loss, and the covariance of parameters."""
    rho = residual(null, values, predicted_by(null, predicted, 1))
    gap = np.nan_to_num(values - predicted)
    noise = np.where(np.abs(rho) > 1e-9, np.abs(gap) / np.maximum(np.abs(rho), 1e-9), null.noise)
    w = np.where(use, (HEAVY + 1) / (HEAVY + rho**2) / noise**2, 0.0)
    square = jacobian.T @ (w[:, None] * jacobian) + 1e-9 * np.eye(jacobian.shape[1])
    step = np.linalg.solve(square + damping * np.diag(np.diag(square)), jacobian.T @ (w * gap))
    return np.asarray(step, np.float64), np.asarray(np.linalg.inv(square), np.float64)
