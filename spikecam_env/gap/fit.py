"""Fitting one candidate: simulate the campaign with it, scale and shape it until its statistics are the measured ones.

Statistics move in proportion to the strength (or its square), so each twin says by how much to scale the next; other
parameters follow by Gauss-Newton.  The unit is refitted along the way, so that the candidate cannot borrow from it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.candidates import candidate, is_pattern
from spikecam_env.gap.case import Case, rests_on, settled, twins
from spikecam_env.gap.compare import HEAVY, TOLERANCE, Null, judged, scale_of, spread_of, values_of
from spikecam_env.gap.refit import BaseFit, within
from spikecam_env.gap.units import drawn_banks
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.sensor.effects.base import build

Array = NDArray[np.float64]

NEEDED = 15.0
"""Misfit by which an effect found earlier has to be missed, once another has been added, to be kept."""

TURNS = 5
"""Most twins, Gauss-Newton steps apart, that the fit of one candidate takes."""

VISIBLE = 12.0
"""Noises that a simulated effect has to show somewhere to be scaled by: the loudest of 600 noises alone is near 4."""

UNITS = 24
"""Units drawn for the pattern statistics of one model."""


@dataclass(frozen=True)
class Fit:
    """A candidate at its best.  parameters, sd: by name.  predicted: (S,) mean over `count` twins; base: its unit.

    spread: (S,) standard deviation of one campaign.  rho: (S,) what it leaves, in noise.  misfit: `compare.judged`.
    """

    name: str
    parameters: dict[str, float]
    sd: dict[str, float]
    predicted: Array
    spread: Array
    count: int
    base: BaseFit
    rho: Array
    misfit: float
    model: SensorModel


def predict(
    case: Case,
    model: SensorModel,
    base: BaseFit,
    null: Null,
    count: int,
    first: int = 0,
    only: Sequence[int] | None = None,
) -> tuple[Array, list[BaseFit]]:
    """(S,) mean statistics of twins under a model, and the twins' refits; what is not simulated is as in `null`."""
    values, refits = simulated(case, model, base, null, count, first, only)
    return values.mean(axis=0), refits


def simulated(
    case: Case,
    model: SensorModel,
    base: BaseFit,
    null: Null,
    count: int,
    first: int = 0,
    only: Sequence[int] | None = None,
) -> tuple[Array, list[BaseFit]]:
    """(count, S) statistics of each twin, see `predict`."""
    made = twins(case, model, base, count, first, only)
    values = np.array([values_of(t.bank, null.keys) for t in made])
    known = np.isfinite(values).all(axis=0)
    return np.where(known, values, null.mean), [t.base for t in made]


def with_pattern(case: Case, model: SensorModel, null: Null, mean: Array) -> Array:
    """`mean` with its pattern statistics replaced by those of units of the model."""
    drawn = drawn_banks(model, case.base, case.conditions, case.shape, UNITS, case.seed)
    values = np.array([values_of(b, null.keys) for b in drawn])
    known = np.isfinite(values).all(axis=0)
    return np.where(known, np.where(known, values, 0.0).mean(axis=0), mean)


def fit(
    case: Case,
    model: SensorModel,
    null: Null,
    measured: Array,
    name: str,
    start: Mapping[str, float],
    expected: Array | None = None,
) -> Fit:
    """Best fit of one candidate added to `model`, whose own predictions are `null`.

    start: parameters near the best.  expected: (S,) change of the statistics to expect there, to leave out recordings
    that it does not concern.
    """
    if is_pattern(name):
        return _fit_pattern(case, model, null, measured, name, start)
    return _fit_twins(case, model, null, measured, name, dict(start), expected)


def with_effect(model: SensorModel, name: str, parameters: Mapping[str, float]) -> SensorModel:
    """The model with a candidate added."""
    return model.with_effect(build(CATALOGUE, name, dict(parameters)))


def bounded(name: str, parameters: Mapping[str, float]) -> dict[str, float]:
    """Parameters within what their effect allows, whole where they must be."""
    out = {}
    for key, f in CATALOGUE[name].__dataclass_fields__.items():
        if key not in parameters:
            continue
        low, high = f.metadata["bounds"] or (-np.inf, np.inf)
        value = float(np.clip(parameters[key], low, high))
        out[key] = round(value) if isinstance(f.default, int) and not isinstance(f.default, bool) else value
    return out


def _scale(null: Null, measured: Array, predicted: Array) -> tuple[float, float]:
    """Scale of a simulated effect that comes nearest to the measured statistics, and its standard error."""
    known = np.isfinite(measured)
    gap, effect = np.where(known, measured - null.mean, 0.0), np.where(known, predicted - null.mean, 0.0)
    return scale_of(gap, effect, null.noise**2, null.sd**2)


def _fit_twins(
    case: Case,
    model: SensorModel,
    null: Null,
    measured: Array,
    name: str,
    parameters: dict[str, float],
    expected: Array | None,
) -> Fit:
    """Twins at the start, made stronger until they show, scaled until the strength is right to a third; then, with
    shapes, Gauss-Newton; the last step is a scaling of what was simulated, without another twin."""
    what = candidate(name)
    strength = what.fitted[0]
    power = 2.0 if what.square else 1.0
    base = within(model, case.base)
    parameters = bounded(name, parameters)
    only = None if expected is None else concerned(case, [name], null, measured, expected)
    for turn in range(TURNS):
        tried = with_effect(model, name, parameters)
        predicted, refits = predict(case, tried, within(tried, base), null, 1, 100, only)
        seen = float(np.max(np.isfinite(measured) * np.abs(predicted - null.mean) / null.noise))
        if seen < VISIBLE and turn < TURNS - 1:
            louder = (2 * VISIBLE / max(seen, 1.0)) ** (1 / power)
            stronger = bounded(name, {**parameters, strength: parameters[strength] * louder})
            if stronger != parameters:
                parameters, only = stronger, None
                continue
        base = settled(tried, within(tried, base), case.base, refits)
        scale, sd = _scale(null, measured, predicted)
        factor = float(np.sign(scale) * np.clip(abs(scale) ** (1 / power), 1e-3, 1e3)) if scale else 1e-3
        if factor < 0 and not _may_be_negative(name):
            factor = 0.1
        near = 0.7 < factor < 1.4
        if near and len(what.fitted) > 1 and turn < TURNS - 1:
            step = _gauss_newton(case, model, null, measured, name, parameters, what.fitted, predicted, base, only)
            parameters = bounded(name, {k: v * step.get(k, 1.0) for k, v in parameters.items()})
            if max(abs(np.log(f)) for f in step.values()) > 0.1:
                continue
            predicted, _ = predict(case, with_effect(model, name, parameters), base, null, 1, 100, only)
            scale, sd = _scale(null, measured, predicted)
            factor, near = float(np.clip(abs(scale) ** (1 / power), 0.7, 1.4)), True
        too_weak_to_show = abs(scale) * seen < VISIBLE
        near |= too_weak_to_show
        if near or turn == TURNS - 1:
            break
        parameters = bounded(name, {**parameters, strength: parameters[strength] * factor})
        only = concerned(case, [name], null, measured, (predicted - null.mean) * factor**power)
    final = bounded(name, {**parameters, strength: parameters[strength] * factor}) if near else parameters
    moved = (final[strength] / parameters[strength]) ** power if parameters[strength] else 1.0
    scaled = null.mean + moved * (predicted - null.mean)
    rho, left = judged(null, measured, scaled, 1)
    relative = sd / max(abs(scale), 1e-9) / power
    return Fit(
        name,
        final,
        {strength: abs(final[strength]) * relative},
        scaled,
        null.sd,
        1,
        base,
        rho,
        left,
        with_effect(model, name, final),
    )


def concerned(case: Case, names: Sequence[str], null: Null, measured: Array, effect: Array) -> list[int] | None:
    """Recordings on which effects show, or something has to be explained, by index; None for all.

    With those that the refit rests on, unless the effects leave steady uniform light alone: the refit takes up their
    mean, and the others are judged by that refit.
    """
    seen = np.maximum(np.abs(effect), np.abs(np.nan_to_num(measured - null.mean))) > 5 * null.noise
    shows = {k.recording for k, s in zip(null.keys, seen, strict=True) if s}
    which = {i for i, c in enumerate(case.conditions) if c.name in shows}
    if not which:
        return None
    if which & rests_on(case) or not all(candidate(name).only_contrast for name in names):
        which |= rests_on(case)
    return sorted(which) if len(which) < len(case.conditions) else None


def _may_be_negative(name: str) -> bool:
    strength = CATALOGUE[name].strength
    bounds = CATALOGUE[name].__dataclass_fields__[strength].metadata["bounds"]
    return bool(bounds and bounds[0] < 0)


def _gauss_newton(
    case: Case,
    model: SensorModel,
    null: Null,
    measured: Array,
    name: str,
    parameters: dict[str, float],
    fitted: tuple[str, ...],
    predicted: Array,
    base: BaseFit,
    only: Sequence[int] | None,
) -> dict[str, float]:
    """Factors to multiply the fitted parameters by: one damped step in their logarithms, differences of 30 %."""
    columns = []
    for key in fitted:
        nudged = with_effect(model, name, bounded(name, {**parameters, key: parameters[key] * 1.3}))
        there, _ = predict(case, nudged, within(nudged, base), null, 1, 100, only)
        columns.append((there - predicted) / np.log(1.3))
    step = np.clip(_damped(null, measured, predicted, np.stack(columns, axis=1)), -1.0, 1.0)
    return {key: float(np.exp(s)) for key, s in zip(fitted, step, strict=True)}


def confirmed(case: Case, model: SensorModel, null: Null, measured: Array, found: Fit, count: int = 4) -> Fit:
    """The fit simulated anew with other draws, its unit settled once more: for the gate."""
    added = [e.name for e in found.model.effects if e not in model.effects]
    if added and all(is_pattern(name) for name in added):
        predicted = with_pattern(case, found.model, null, null.mean)
        rho, left = judged(null, measured, predicted, UNITS)
        return replace(found, predicted=predicted, rho=rho, misfit=left)
    only = concerned(case, added or [found.name], null, measured, found.predicted - null.mean)
    if only is not None:  # held-out recordings did not say whether they are concerned, and are judged
        only = sorted({*only, *(i for i, c in enumerate(case.conditions) if c.use != "fit")})
    _, refits = predict(case, found.model, within(found.model, found.base), null, 1, 200, only)
    base = settled(found.model, within(found.model, found.base), case.base, refits)
    values, _ = simulated(case, found.model, base, null, count, 300, only)
    predicted, spread = values.mean(axis=0), spread_of(null, values)
    if any(is_pattern(name) for name in added):
        predicted = with_pattern(case, found.model, null, predicted)
    rho, left = judged(null, measured, predicted, count, spread)
    return replace(found, predicted=predicted, spread=spread, count=count, base=base, rho=rho, misfit=left)


def gain(case: Case, model: SensorModel, null: Null, measured: Array, found: Fit) -> float:
    """Misfit that a confirmed candidate removes, over `model` simulated by the same draws."""
    if is_pattern(found.name):
        return judged(null, measured, null.mean, UNITS)[1] - found.misfit
    instead = replace(found, model=model, base=within(model, case.base))
    return confirmed(case, model, null, measured, instead, found.count).misfit - found.misfit


def rejoined(case: Case, model: SensorModel, null: Null, measured: Array, found: Fit, earlier: Sequence[str]) -> Fit:
    """All effects found so far together; one that is no longer needed is left out again.

    model, null: as given, before any was added.
    """
    whole = found.model
    for name in earlier:
        fewer = confirmed(case, model, null, measured, replace(found, model=whole.without(name)), 2)
        both = confirmed(case, model, null, measured, replace(found, model=whole), 2)
        if fewer.misfit < both.misfit + NEEDED:
            whole = whole.without(name)
    return confirmed(case, model, null, measured, replace(found, model=whole))


def _damped(null: Null, measured: Array, predicted: Array, jacobian: Array) -> Array:
    """Robust, slightly damped least-squares step (n,) for a jacobian (S, n)."""
    noise2 = null.sd**2 * (2 + 1 / null.twins) + null.floor**2 + (TOLERANCE * (predicted - null.mean)) ** 2
    gap = np.nan_to_num(measured - predicted)
    w = np.isfinite(measured) * (HEAVY + 1) / (HEAVY + gap**2 / noise2) / noise2
    normal = jacobian.T @ (w[:, None] * jacobian)
    normal += 0.02 * np.diag(np.diag(normal)) + 1e-12 * np.eye(len(normal))
    return np.asarray(np.linalg.solve(normal, jacobian.T @ (w * gap)), dtype=np.float64)


def _fit_pattern(
    case: Case, model: SensorModel, null: Null, measured: Array, name: str, start: Mapping[str, float]
) -> Fit:
    """Coarse to fine search over the strength (and one more parameter), drawing units."""
    what = candidate(name)
    parameters = bounded(name, start)
    best: Fit | None = None
    for factors in ((0.03, 0.1, 0.3, 1.0, 3.0), (0.55, 0.75, 1.35, 1.8), (0.8, 0.9, 1.1, 1.25), (0.95, 1.05)):
        for key in what.fitted:
            centre = best.parameters if best else parameters
            for factor in factors:
                tried = bounded(name, {**centre, key: centre[key] * factor})
                there = with_effect(model, name, tried)
                predicted = with_pattern(case, there, null, null.mean)
                rho, left = judged(null, measured, predicted, UNITS)
                now = Fit(name, tried, {}, predicted, null.sd, UNITS, within(there, case.base), rho, left, there)
                best = now if best is None or now.misfit < best.misfit else best
    assert best is not None
    return best
