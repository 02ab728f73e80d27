"""Recordings that are rates only: how pixels differ, in the light and in the dark, is all that can be tested.

A twin is a fresh unit of the model, counted as the maps were; its median response and dark level are the measured ones.
Spreads of response and of dark level are free within what units differ by (`units.WITHIN`) before, and without limit
in the fits; one that then is further off than units are is a parameter that is wrong.  Parameters are fitted by
Gauss-Newton on the statistics, with the same draws at every step; how a spread is shared between a Gaussian and a tail
is nearly free, and stated errors do not say so.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.calibration.campaign import Campaign
from spikecam_env.errors import InputError
from spikecam_env.gap.candidates import candidate, chosen, is_pattern
from spikecam_env.gap.compare import (
    HEAVY,
    Null,
    Prediction,
    adjusted,
    alarmed,
    deviates,
    misfit,
    null_of,
    residual,
    values_of,
)
from spikecam_env.gap.fit import bounded, with_effect
from spikecam_env.gap.parameters import USUAL
from spikecam_env.gap.refit import BaseFit
from spikecam_env.gap.result import Diagnosis, Estimate, Evidence, Gap, NamedEffect, Ranked, Statistic
from spikecam_env.gap.statistics import Key, pattern, texture
from spikecam_env.gap.units import SPREADS as OF_A_UNIT
from spikecam_env.gap.units import WITHIN
from spikecam_env.gap.world import KNOWN, Shown, shown
from spikecam_env.sensor import CATALOGUE, SensorModel

Array = NDArray[np.float64]

UNITS = 8
"""Units of each model that its predictions are means over."""

STEPS = 6
"""Gauss-Newton steps of a fit."""

ALARM, GAIN, UNEXPLAINED = 0.02, 25.0, 0.08
"""As in `diagnose`; what stays unexplained is a share of mean squares here, since many statistics are very far off."""

MOST = 5
"""Effects that one diagnosis of maps names together."""

SPREADS = {"response": OF_A_UNIT["gain"], "dark": OF_A_UNIT["dark"]}
"""What is scaled to fit how pixels differ: parameters of effects, by what they spread."""

_SHARES = ("centre_x", "centre_y")
"""Parameters that are fitted as they are; all others by their logarithm."""

_NUDGE = 0.1


@dataclass(frozen=True)
class RateMap:
    """One recording of rates.  rate: (H, W) [spikes/frame], spread within a count."""

    shown: Shown
    rate: Array


@dataclass(frozen=True)
class Maps:
    """All of a campaign.  response: medians of lit maps less the dark's, by name.  dark: median dark level."""

    shape: tuple[int, int]
    maps: tuple[RateMap, ...]
    response: dict[str, float]
    dark: float
    seed: int
    jobs: int

    @property
    def bank(self) -> dict[Key, float]:
        return bank(self.maps)


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


def read_maps(campaign: Campaign, seed: int = 0, jobs: int = 1) -> Maps:
    """The rates of a campaign in known, steady light."""
    maps = []
    for r in campaign.recordings:
        condition = shown(r)
        if r.rates is not None and condition.kind in KNOWN:
            maps.append(RateMap(condition, spread_evenly(r.rate(), r.frames)))
    if not maps:
        raise InputError(
            f"{campaign.folder} has neither spikes nor rates in known, steady light: nothing can be tested"
        )
    dark = _dark_of(maps)
    level = float(np.median(dark)) if dark is not None else 0.0
    response = {m.shown.name: float(np.median(m.rate)) - level for m in maps if m.shown.kind != "dark"}
    return Maps(campaign.shape, tuple(maps), response, level, seed, jobs)


def spread_evenly(rate: Array, frames: int) -> Array:
    """Rates spread within a count: of ten spikes a pixel in the dark, quantiles else say which whole number it is."""
    return rate + (np.random.default_rng(frames).random(rate.shape) - 0.5) / frames


def _dark_of(maps: Sequence[RateMap]) -> Array | None:
    dark = [m.rate for m in maps if m.shown.kind == "dark"]
    return np.mean(dark, axis=0) if dark else None


def bank(maps: Sequence[RateMap]) -> dict[Key, float]:
    """Statistics of every map; texture of lit ones less the dark."""
    dark = _dark_of(maps)
    found = {}
    for m in maps:
        own = m.rate if m.shown.kind == "dark" or dark is None else m.rate - dark
        for group, values in (("pattern", pattern.statistics(m.rate)), ("texture", texture.statistics(own))):
            for name, value in values.items():
                found[Key(group, m.shown.name, name)] = value
    return found


def unit_maps(model: SensorModel, case: Maps, number: int) -> tuple[RateMap, ...]:
    """Maps of a fresh unit at the measured medians, counted over as many frames."""
    gain, dark = unit_levels(model, case, number)
    rng = np.random.default_rng([case.seed, number])
    made = []
    for m in case.maps:
        light = m.shown.picture.reshape(case.shape) / max(m.shown.level, 1e-12)
        rate = dark + gain * light * case.response.get(m.shown.name, 0.0)
        counts = np.floor(m.shown.frames * rate + rng.random(case.shape))
        rate = np.clip(counts / m.shown.frames, 0.0, 1.0)
        made.append(RateMap(m.shown, spread_evenly(rate, m.shown.frames)))
    return tuple(made)


def unit_levels(model: SensorModel, case: Maps, number: int) -> tuple[Array, Array]:
    """(H, W) response over its median, and dark level [spikes/frame], of a fresh unit."""
    unit = model.draw_unit(case.shape, case.seed + number)
    gain = unit.gain / max(float(np.median(unit.gain)), 1e-12)
    middle = float(np.median(unit.dark))
    dark = unit.dark * (case.dark / middle) if middle > 0 else unit.dark
    return gain.reshape(case.shape), dark.reshape(case.shape)


def predicted_by(null: Null, mean: Array, units: int) -> Prediction:
    """A mean over that many units."""
    return Prediction(mean, null.sd / np.sqrt(units), null.sd)


def predict(state: State, case: Maps, keys: Sequence[Key], units: Sequence[int]) -> Array:
    """(S,) mean statistics over units."""
    return np.mean([values_of(bank(unit_maps(state.fitted, case, n)), keys) for n in units], axis=0)


def diagnose_maps(
    campaign: Campaign,
    model: SensorModel,
    *,
    candidates: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    seed: int = 0,
    jobs: int = 1,
) -> Diagnosis:
    """Find what fixed pattern a model lacks, from rates alone.  Arguments as `diagnose.diagnose`."""
    case = read_maps(campaign, seed, jobs)
    names = chosen(model, candidates, exclude)
    tested = [n for n in names if is_pattern(n) and _visible(n, case)]
    values_by_key = case.bank
    given = _within(State(model, {}), case, values_by_key)
    banks = [bank(unit_maps(given.fitted, case, n)) for n in range(UNITS)]
    null = null_of(banks, list(values_by_key))
    null = replace(null, sd=np.maximum(null.sd, 1e-3 * null.floor))
    values = values_of(values_by_key, null.keys)
    z = deviates(null, values)
    rounds, rejected = search(case, given, null, values, tested) if adjusted(z).min() < ALARM else ([], [])
    return concluded(campaign, case, model, given, null, values, z, rounds, rejected, names, tested)


def _visible(name: str, case: Maps) -> bool:
    """Dark effects want a dark map, all others a lit one; what is one number with a spread of the model is none."""
    kinds = {m.shown.kind for m in case.maps}
    return "dark" in kinds if candidate(name).family == "dark" else bool(kinds & {"flat", "picture"})


def _within(state: State, case: Maps, measured: dict[Key, float]) -> State:
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
                factors[what] = float(np.clip(factors.get(what, 1.0) * np.exp(np.mean(off)), *WITHIN))
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
        if not alarmed(null, now.rho):
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
    free += [(n, p) for n in state.added for p in _free(n)]
    use = of_use(case, null.keys, "fit")
    sd = dict.fromkeys((f"{n}.{p}" for n, p in free), np.nan)
    damping, best, least = 0.02, state, np.inf
    for _ in range(STEPS):
        at = predict(state, case, null.keys, [0])
        now = misfit(residual(null, values, predicted_by(null, at, 1))[use])
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
    return Tried(name, best, sd, predicted, rho, misfit(rho[use]))


def of_use(case: Maps, keys: Sequence[Key], use: str) -> NDArray[np.bool_]:
    """(S,) which statistics are of recordings of this use."""
    names = {m.shown.name for m in case.maps if m.shown.use == use}
    return np.array([k.recording in names for k in keys])


def _free(name: str) -> tuple[str, ...]:
    return (*candidate(name).fitted, *(p for p in _SHARES if p in CATALOGUE[name].__dataclass_fields__))


def _moved(state: State, what: tuple[str, str], step: float) -> State:
    """A parameter changed by a step, of its logarithm or in its own unit."""
    name, key = what
    if not name:
        return replace(
            state, factors={**state.factors, key: float(np.clip(state.factors[key] * np.exp(step), 1e-3, 1e3))}
        )
    effect = next(e for e in state.model.effects if e.name == name)
    old = effect.parameters()
    new = old[key] + step if key in _SHARES else old[key] * np.exp(step)
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


def concluded(
    campaign: Campaign, case: Maps, model: SensorModel, given: State, null: Null, values: Array, z: Array,
    rounds: list[list[Tried]], rejected: list[Tried], names: Sequence[str], tested: Sequence[str],
) -> Diagnosis:  # fmt: skip
    """From the search to a verdict."""
    last = rounds[-1][0] if rounds else None
    use = of_use(case, null.keys, "fit")
    rho = last.rho if last else residual(null, values, null.prediction)
    predicted = last.predicted if last else null.mean
    square = [float(np.mean(((values - mean) / null.noise) ** 2)) for mean in (null.mean, predicted)]
    left = (square[1] - 1.0) / max(square[0] - 1.0, 1e-9)
    significant = alarmed(null, rho)
    explained = not rounds or not significant or left < UNEXPLAINED
    parameters = off_usual(case, last.state) if last else {}
    effects = tuple(
        replace(_named(r, last), instead={t.name: _gap(case, null, values, t.predicted).removed for t in r[1:]})
        for r in rounds[1:]
        if last and shows(last, r[0].name)
    )
    unknown = None
    found = [e.name for e in effects]
    notes = (_left(null, rho, left),) if rounds and explained and significant else ()
    if not explained:
        verdict, unknown, effects = "unknown", _structure(null, rho, left, found), ()
    elif effects:
        verdict = "named"
    else:
        verdict = "parameter" if parameters else "none"
    patched = _patched(last.state, case) if last else model
    for e in (e for e in last.state.added if not shows(last, e)) if last else ():
        patched = patched.without(e)
    p = adjusted(z)
    return Diagnosis(
        verdict=verdict, sentence="", effects=effects, unknown=unknown, class_=None, parameters=parameters, data=notes,
        gap=_gap(case, null, values, predicted), statistics=tuple(
            Statistic(f"{k.group}: {k.name}", k.group, (k.recording,), float(values[j]), float(null.mean[j]),
                      float(predicted[j]), float(null.noise[j]), float(z[j]), float(rho[j]), float(p[j]),
                      not bool(use[j]))
            for j, k in enumerate(null.keys)
        ),
        ranking=tuple(_ranked(t, was[0].misfit, t is r[0] and r is not rejected)
                      for was, r in itertools.pairwise([*rounds, rejected]) for t in r),
        not_testable=tuple((n, _lack(n)) for n in names if n not in tested),
        bounds=(), patched=patched, model_name=model.name, campaign=str(campaign.folder), seed=case.seed, stages={},
        evidence=_evidence(case, given, last),
    )  # fmt: skip


def _lack(name: str) -> str:
    if not is_pattern(name):
        return "spikes: rates say nothing of when they come"
    return "a dark map" if candidate(name).family == "dark" else "a map of a flat"


def off_usual(case: Maps, state: State) -> dict[str, dict[str, float]]:
    """Spreads of the model that this unit has in another amount than units differ by: as `parameters.off_nominal`."""
    found = {}
    for what, factor in state.factors.items():
        if 1 / USUAL < factor < USUAL:
            continue
        for effect in state.model.effects:
            if effect.name in SPREADS[what]:
                key = SPREADS[what][effect.name]
                nominal = effect.parameters()[key]
                found[effect.name] = {"measured": nominal * factor, "nominal": nominal, "ratio": factor}
    return found


def _named(tried: list[Tried], last: Tried) -> NamedEffect:
    """The best of a round, with parameters as they are in the end; confidence and rivals are the round's."""
    best = tried[0]
    weights = [(t.name, float(np.exp(-max(t.misfit - best.misfit, 0.0) / 2))) for t in tried[1:]]
    total = 1.0 + sum(w for _, w in weights)
    return NamedEffect(best.name, candidate(best.name).family, min(1.0 / total, 0.99), _estimates(last, best.name),
                       tuple((n, w / total) for n, w in weights))  # fmt: skip


def shows(last: Tried, name: str) -> bool:
    """Whether an effect's strength is more than two standard deviations in the end: a later one may take its place."""
    return last.sd[f"{name}.{CATALOGUE[name].strength}"] < 0.5


def _estimates(tried: Tried, name: str) -> dict[str, Estimate]:
    values = next(e for e in tried.state.model.effects if e.name == name).parameters()
    return {
        p: Estimate(values[p], tried.sd.get(f"{name}.{p}", np.nan) * (1.0 if p in _SHARES else values[p]))
        for p in _free(name)
    }


def _ranked(t: Tried, before: float, accepted: bool) -> Ranked:
    worst = float(np.abs(t.rho).max())
    reason = f"leaves {worst:.1f} noises at worst" if t.misfit < before else "explains nothing"
    return Ranked(t.name, candidate(t.name).family, before, t.misfit, _estimates(t, t.name), accepted, reason)


def _worst(null: Null, rho: Array) -> list[str]:
    order = sorted(range(len(rho)), key=lambda j: -abs(rho[j]))[:6]
    return [f"{null.keys[j].recording} {null.keys[j].name} ({rho[j]:+.1f})" for j in order]


def _left(null: Null, rho: Array, left: float) -> str:
    return (
        f"what is named leaves {100 * left:.1f} % of the mean square distance, and that is no chance; "
        f"largest, in noises: {', '.join(_worst(null, rho))}"
    )


def _structure(null: Null, rho: Array, left: float, found: list[str]) -> dict[str, Any]:
    """What is left once all that helps is in."""
    return {
        "light": "rates alone: in the dark and in the light",
        "left": round(left, 3),
        "found": found,
        "worst": _worst(null, rho),
        "patch": f"what helps: {', '.join(found)}, and spreads" if found else "spreads as fitted",
    }


def _gap(case: Maps, null: Null, values: Array, predicted: Array) -> Gap:
    b, a = (((values - mean) / null.noise) ** 2 for mean in (null.mean, predicted))
    by = {}
    for m in case.maps:
        of = np.array([k.recording == m.shown.name for k in null.keys])
        by[m.shown.name] = {"before": float(b[of].mean()), "after": float(a[of].mean()), "floor": 1.0}
    held = of_use(case, null.keys, "holdout")
    held = held if held.any() else np.ones(len(held), bool)
    before, after = float(b[held].mean()), float(a[held].mean())
    return Gap(before, after, 1.0, (before - after) / (before - 1.0) if before > 1.5 else 0.0, by)


def _patched(state: State, case: Maps) -> SensorModel:
    """The fitted model, its dark level the measured one."""
    out = state.fitted
    level = next((e for e in out.effects if e.name == "dark_current"), None)
    middle = float(np.median(out.draw_unit(case.shape, case.seed).dark))
    if level is None or middle <= 0 or case.dark <= 0:
        return out
    return out.with_effect(replace(level, mean_pA=level.parameters()["mean_pA"] * case.dark / middle))  # type: ignore[call-arg]


def _evidence(case: Maps, given: State, last: Tried | None) -> Evidence:
    """Response and dark level of every pixel, measured and of fresh units."""
    dark = _dark_of(case.maps)
    lit = [m for m in case.maps if m.shown.name in case.response and m.shown.use == "fit"]
    zero = np.zeros(case.shape)
    dark = zero if dark is None else dark
    gain = (lit[0].rate - dark) / max(case.response[lit[0].shown.name], 1e-12) if lit else zero

    def base(gain: Array, dark: Array) -> BaseFit:
        flat = np.zeros(gain.size)
        return BaseFit(gain.ravel(), dark.ravel(), flat, flat, 0.0, np.zeros((0, gain.size)), flat == 0)

    def levels(model: SensorModel) -> tuple[Array, Array]:
        fresh, level = unit_levels(model, case, UNITS)
        return fresh.ravel(), level.ravel()

    nothing = (None,) * len(case.maps)
    before = levels(given.fitted)
    after = levels(last.state.fitted) if last else None
    measured = base(gain, dark)
    return Evidence(
        tuple(m.shown for m in case.maps), nothing, nothing, nothing if last else None, measured,  # type: ignore[arg-type]
        base(*before), base(*after) if after else None, None, before, after,
    )  # fmt: skip
