"""Fitting one candidate: simulate the campaign with it, scale and shape it until its statistics are the measured ones.

Every twin is compared with the null's of the same draws, so that what is left of their difference is the effect.
Statistics move in proportion to the strength (or its square), so each twin says by how much to scale the next; its
other parameters are of `shapes`.  The unit is refitted along the way, so that the candidate cannot borrow from it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.candidates.strength import AS_LOUD, as_loud, bounded, is_linear, may_be_negative, with_effect
from spikecam_env.gap.candidates.table import candidate, is_pattern
from spikecam_env.gap.compare.distance import judged, size_of
from spikecam_env.gap.compare.prediction import Draw, Null, Prediction, paired, scaled, values_of
from spikecam_env.gap.compare.step import likeliest, scale_to, slope_of, step_of
from spikecam_env.gap.twins.case import Case, rests_on, twins
from spikecam_env.gap.twins.fresh_units import UNITS, drawn_banks
from spikecam_env.gap.unit.false_spikes import false_spikes_of
from spikecam_env.gap.unit.indirect_inference import MOST_EXTRAPOLATED, extrapolated_unit, has_converged, inferred_unit
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.gap.unit.traps import traps_of
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]

HOPE = 5.0
"""Misfit that a twin, scaled at best, has to remove for its fit to go on."""

TURNS = 5
"""Most twins that the fit of one candidate's strength takes."""

VISIBLE = 4.0
"""Noises that a simulated effect has to show somewhere to be scaled by."""

FAINT = 1e-3
"""Least factor by which a strength is multiplied at once; and of one without hope."""

WANDER, SEVERAL = 6, 3
"""Twins of an effect that makes statistics scatter; and of one that is few events, or in few pixels, or that is
`mixed`, and so cannot be simulated louder to stand above one twin's noise."""

APART = 0.05
"""Least step of a logarithm between two twins for a slope."""


MANY = 240
"""The same where these do not show what was measured."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A candidate at its best.  parameters, sd: by name.  prediction: what it gives; base: its unit.

    rho: (S,) what it leaves, in noise.  misfit: `distance.judged`.
    """

    name: str
    parameters: dict[str, float]
    sd: dict[str, float]
    prediction: Prediction
    base: BaseFit
    rho: Array
    misfit: float
    model: SensorModel


def predict(
    case: Case, model: SensorModel, base: BaseFit, null: Null, count: int, only: Sequence[int] | None = None
) -> Prediction:
    """What a model with effects gives, from twins of the null's last `count` draws; what is not simulated (`only`:
    recordings, by index) is as in `null`."""
    numbers = [d.number for d in null.draws[-count:]]
    made = twins(case, model, base, numbers, only, {d.number: d.refit for d in null.draws})
    draws = [Draw(n, values_of(t.bank, null.keys), t.base) for n, t in zip(numbers, made, strict=True)]
    predicted = paired(null, draws)
    patterned = traps_of(model) or false_spikes_of(model)
    return with_pattern(case, model, null, predicted) if patterned else predicted


def twins_of(name: str) -> int:
    """How many twins say what an effect does."""
    what = candidate(name)
    return SEVERAL if what.events or what.strikes or what.mixed else 1


def as_seen(model: SensorModel, base: BaseFit, null: Null, predicted: Prediction) -> BaseFit:
    """The unit moved so that with the effect it is refitted as the null's is without."""
    [without] = [d.refit for d in null.draws if d.number == predicted.draws[-1].number]
    there = predicted.draws[-1].refit
    return inferred_unit(model, base, without, [there]) if without and there else base


def with_pattern(case: Case, model: SensorModel, null: Null, predicted: Prediction, count: int = UNITS) -> Prediction:
    """A prediction with its pattern statistics replaced by those of `count` units of the model."""
    drawn = drawn_banks(model, case.base, case.conditions, case.shape, count, case.seed)
    values = np.array([values_of(b, null.keys) for b in drawn])
    known = np.isfinite(values).all(axis=0)
    values = np.where(known, values, 0.0)
    mean = np.where(known, values.mean(axis=0), predicted.mean)
    spread = np.where(known, np.maximum(values.std(axis=0, ddof=1), null.sd), predicted.spread)
    error = np.where(known, spread / np.sqrt(count), predicted.error)
    return replace(predicted, mean=mean, error=error, spread=spread, units=np.where(known, values, np.nan))


def fit(
    case: Case,
    model: SensorModel,
    null: Null,
    measured: Array,
    name: str,
    start: Mapping[str, float],
    expected: Array | None = None,
    white: float = 1.0,
) -> Fit:
    """Best fit of one candidate's strength (of a pattern, all its parameters) added to `model`, which predicts `null`.

    start: parameters near the best.  expected: (S,) change of the statistics to expect there, to leave out recordings
    that it does not concern.  white: s^2 of the unit there, over the refit's.
    """
    if is_pattern(name):
        return _fit_pattern(case, model, null, measured, name, start)
    if candidate(name).wanders:
        return _fit_wander(case, model, null, measured, name, dict(start))
    return _fit_twins(case, model, null, measured, name, dict(start), expected, white)


def _fit_twins(
    case: Case,
    model: SensorModel,
    null: Null,
    measured: Array,
    name: str,
    parameters: dict[str, float],
    expected: Array | None,
    white: float,
) -> Fit:
    """Twins at the start, made stronger until they show, once more where the unit settles far off, scaled until the
    strength is right to a third and the unit has settled; the last step is a scaling of what was simulated, without
    another twin."""
    strength, power = candidate(name).fitted[0], candidate(name).power
    everywhere = np.full(len(null.keys), np.inf)
    expected = everywhere if expected is None else expected
    parameters, louder = as_loud(name, bounded(name, parameters), size_of(null, measured, expected))
    bare = constrained_refit(with_effect(model, name, parameters), constrained_refit(model, case.base))
    base = replace(bare, white=white**louder * bare.white)
    hopeless = judged(null, measured, null.prediction)[1] - HOPE
    only = concerned(case, [name], null, measured, expected * louder)
    last: tuple[float, Prediction] | None = None
    slope: Array | None = None
    still = False
    for turn in range(TURNS):
        at_last = turn == TURNS - 1
        tried = with_effect(model, name, parameters)
        predicted = predict(case, tried, base, null, twins_of(name), only)
        seen = size_of(null, measured, predicted.mean - null.mean)
        stronger = parameters if at_last else until_seen(name, parameters, seen)
        if stronger != parameters:
            base = extrapolated_unit(bare, base, abs(stronger[strength] / parameters[strength]) ** power)
            parameters, only = stronger, concerned(case, [name], null, measured, everywhere)
            continue
        assumed, base = base, as_seen(tried, base, null, predicted)
        if not still and not at_last and not has_converged(assumed, base):
            still = True
            continue
        scale, sd = scale_to(null, measured, predicted)
        if judged(null, measured, scaled(null, predicted, scale))[1] > hopeless:
            factor, near = FAINT, True
            break
        now = parameters[strength], predicted
        slope = slope_between(null, measured, last, now) if power == 2.0 else None
        factor, last = factor_to(name, null, measured, predicted, scale, slope), now
        weak = abs(scale) * seen < VISIBLE or (
            is_linear(name) and 1 / MOST_EXTRAPOLATED < scale < 1 and scale * seen < AS_LOUD
        )
        near = weak or 0.7 < factor < 1.4
        if at_last or (near and turn):
            break
        if weak:
            continue
        parameters = bounded(name, {**parameters, strength: parameters[strength] * factor})
        base = extrapolated_unit(bare, base, factor**power)
        only = concerned(case, [name], null, measured, (predicted.mean - null.mean) * factor**power)
    final = bounded(name, {**parameters, strength: parameters[strength] * factor}) if near else parameters
    moved = (final[strength] / parameters[strength]) ** power if parameters[strength] else 1.0
    if near and slope is not None:
        predicted = replace(predicted, mean=predicted.mean + slope * np.log(moved) / power)
    else:
        predicted = scaled(null, predicted, moved)
    rho, left = judged(null, measured, predicted)
    sds = {strength: abs(final[strength]) * (sd / max(abs(scale), 1e-9) / power)}
    there = with_effect(model, name, final)
    return Fit(name, final, sds, predicted, extrapolated_unit(bare, base, moved), rho, left, there)


def until_seen(name: str, parameters: dict[str, float], seen: float) -> dict[str, float]:
    """The parameters at a strength that shows by twice VISIBLE, or where its bounds end; as they are where it shows.
    seen: noises that it shows by."""
    if seen >= VISIBLE:
        return parameters
    strength = candidate(name).fitted[0]
    more = (2 * VISIBLE / max(seen, 0.2)) ** (1 / candidate(name).power)
    return bounded(name, {**parameters, strength: parameters[strength] * more})


def factor_to(
    name: str, null: Null, measured: Array, predicted: Prediction, scale: float, slope: Array | None
) -> float:
    """By how much to multiply a strength: along its slope where there is one, else by what scales its change best; a
    tenth where that is negative and the strength cannot be."""
    if slope is not None:
        return float(np.exp(np.clip(step_of(null, measured, predicted, slope[:, None])[0][0], -1.0, 1.0)))
    if scale < 0 and not may_be_negative(name):
        return 0.1
    size = float(np.clip(abs(scale) ** (1 / candidate(name).power), FAINT, 1 / FAINT))
    return -size if scale < 0 else size


def slope_between(
    null: Null, measured: Array, one: tuple[float, Prediction] | None, other: tuple[float, Prediction]
) -> Array | None:
    """(S,) change of the statistics for one more of a strength's logarithm, by twins at two of them; None where these
    are not two.  What goes with the square of a strength saturates where other noise is, or is a logarithm of both."""
    if one is None or not one[0] * other[0] > 0 or abs(step := float(np.log(other[0] / one[0]))) < APART:
        return None
    both = (one[1].mean != null.mean) & (other[1].mean != null.mean)
    slope = slope_of(null, measured, other[1], one[1], step) * both
    return slope if slope.any() else None


def _fit_wander(
    case: Case, model: SensorModel, null: Null, measured: Array, name: str, parameters: dict[str, float]
) -> Fit:
    """The strength under which what is seen is as likely as can be among twins that scatter.

    Statistics of one recording are of one course in time: its strength is known no better than from one number each.
    """
    strength = candidate(name).fitted[0]
    power = candidate(name).power
    only = concerned(case, [name], null, measured, np.full(len(null.keys), np.inf))
    for _ in range(2):
        there = with_effect(model, name, bounded(name, parameters))
        base = constrained_refit(there, case.base)
        predicted = predict(case, there, base, null, WANDER, only)
        factor, sd = likeliest(null, measured, predicted)
        parameters = bounded(name, {**parameters, strength: parameters[strength] * factor ** (1 / power)})
        if 0.5 < factor < 2.0:
            break
    predicted = scaled(null, predicted, factor)
    rho, left = judged(null, measured, predicted)
    sds = {strength: parameters[strength] * max(sd, np.sqrt(2.0 / len(only))) / power}
    return Fit(name, parameters, sds, predicted, base, rho, left, with_effect(model, name, parameters))


def concerned(case: Case, names: Sequence[str], null: Null, measured: Array, effect: Array) -> list[int]:
    """Recordings of use fit on which effects show, or something has to be explained, by index; all where none does.

    With those that the refit rests on: the refit takes up the effects' mean, and the others are judged by that refit.
    Of effects that leave steady uniform light alone, only the others, where the refit does not rest on them.
    """
    seen = np.maximum(np.abs(effect), np.abs(np.nan_to_num(measured - null.mean))) > 5 * null.noise
    shows = {k.recording for k, s in zip(null.keys, seen, strict=True) if s}
    fitted = {i for i, c in enumerate(case.conditions) if c.use == "fit"}
    which = {i for i in fitted if case.conditions[i].name in shows} or fitted
    uneven = {i for i in which if case.conditions[i].kind not in ("dark", "flat")}
    if uneven and not uneven & rests_on(case) and all(candidate(name).only_contrast for name in names):
        return sorted(uneven)
    return sorted(which | rests_on(case))


def with_held_out(case: Case, only: Sequence[int]) -> list[int]:
    """With the recordings held out: those in motion, and all where there is a refit to judge the others by."""
    held = {i for i, c in enumerate(case.conditions) if c.use != "fit"}
    if any(case.conditions[i].kind == "picture" for i in held):
        held |= rests_on(case)
    if not rests_on(case) <= {*only, *held}:
        held = {i for i in held if case.conditions[i].moves}
    return sorted({*only, *held})


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
                predicted = with_pattern(case, there, null, null.prediction)
                rho, left = judged(null, measured, predicted)
                now = Fit(name, tried, {}, predicted, constrained_refit(there, case.base), rho, left, there)
                best = now if best is None or now.misfit < best.misfit else best
    assert best is not None
    return best
