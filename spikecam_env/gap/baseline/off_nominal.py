"""Parameters off nominal: noise, dark level and spreads of the measured unit against those of the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.candidates.strength import bounded, with_effect
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.twins.fresh_units import SPREAD_PARAMETERS, spread_factor, width
from spikecam_env.gap.unit.refit import NOISE, BaseFit, unusual
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.types import Floats

USUAL_NOISE = 1.5
"""Times nominal, s^2 of a unit beyond which its noise is off: the electrons, or the square of the millivolts, of a unit
20 % off."""


@dataclass(frozen=True)
class OffNominal:
    """Parameters off nominal."""

    parameters: dict[str, dict[str, float]]
    """{effect: {measured, nominal, ratio}}, each effect's strength in its own unit."""
    nominal: BaseFit
    """The measured unit with those parameters as the model has them."""


def off_nominal(case: Case, model: SensorModel, base: BaseFit) -> OffNominal:
    """Strengths of the model's effects that are beyond the spread of units (`unit.usual`) in a unit.

    Args:
        case: the measurement; nothing is off in scenes alone, whose recordings are so short that the refit of jitter is
            a fifth too small (`null_model.unit_under`).
        model: whose parameters are nominal.
        base: the unit.
    """
    if case.scenes_only:
        return OffNominal({}, base)
    shape = (128, 128)
    unit = model.draw_unit(shape, 0)
    has = {e.name: e.parameters()[CATALOGUE[e.name].strength] for e in model.effects}
    live, usual_spread = base.live, case.settings.unit.usual
    ratios: dict[str, float] = {}
    shot = float(np.mean(1 / unit.electrons)) if unit.shot else 0.0
    reset = float(np.mean(unit.kappa**2))
    if has.keys() & set(NOISE) and unusual(base.white / max(shot + reset, 1e-12), USUAL_NOISE):
        if "reset_noise" in has and base.white > shot:
            ratios["reset_noise"] = float(np.sqrt((base.white - shot) / max(reset, 1e-12)))
        else:
            ratios["shot_noise"] = (shot + reset) / max(base.white, 1e-12)
        base = replace(base, white=shot + reset)
    level = level_off(base.dark[live], unit.dark)
    if "dark_current" in has and unusual(level, usual_spread):
        ratios["dark_current"] = level
    for part, factor_of_level in (("gain", 1.0), ("dark", level)):
        spreads = has.keys() & SPREAD_PARAMETERS[part].keys()
        values = getattr(base, part)
        if spreads and unusual(width(values[live]) / max(width(getattr(unit, part)), 1e-12), usual_spread):
            factor = spread_factor(model, part, width(values[live]), shape, 0)
            ratios |= {name: factor * factor_of_level for name in has if name in spreads}
            base = replace(base, **{part: narrowed(values, live, factor)})  # type: ignore[arg-type]
    if "dark_current" in ratios:
        base = replace(base, dark=base.dark / level)
    rows = {n: {"measured": has[n] * r, "nominal": has[n], "ratio": r} for n, r in ratios.items() if n in has}
    return OffNominal(rows, base)


def spreads_off(case: Case, model: SensorModel, fitted: SensorModel) -> dict[str, dict[str, float]]:
    """Spreads of a model that a fitted model has in another amount than units differ by, as rows of `OffNominal`."""
    rows = {}
    strengths = {e.name: e.parameters() for e in fitted.effects}
    for effect in model.effects:
        key = next((of[effect.name] for of in SPREAD_PARAMETERS.values() if effect.name in of), None)
        if key is None or effect.name not in strengths:
            continue
        measured, nominal = strengths[effect.name][key], effect.parameters()[key]
        if unusual(measured / nominal, case.settings.unit.usual):
            rows[effect.name] = {"measured": measured, "nominal": nominal, "ratio": measured / nominal}
    return rows


def level_off(values: Floats, nominal: Floats) -> float:
    """Ratio of two levels over pixels: of their medians or of their means, whichever is nearer to 1; 1 between both.

    Two distributions of another form, as of dark currents with a tail, differ by one of these and are of one level.

    Args:
        values: (P,) of a unit.
        nominal: (P,) of the model.
    """
    ratios = [float(of(values)) / max(float(of(nominal)), 1e-12) for of in (np.median, np.mean)]
    low, high = min(ratios), max(ratios)
    return low if low > 1.0 else min(high, 1.0)


def narrowed(values: Floats, live: NDArray[np.bool_], factor: float) -> Floats:
    """(P,) values with their distance from the median of the live ones divided by a factor."""
    middle = float(np.median(values[live]))
    return np.maximum(middle + (values - middle) / max(factor, 1e-3), 0.0)


def with_strengths(model: SensorModel, off: Mapping[str, Mapping[str, float]]) -> SensorModel:
    """The model with its parameters as they were measured."""
    for effect in model.effects:
        if effect.name in off:
            key = CATALOGUE[effect.name].strength
            model = with_effect(
                model, effect.name, bounded(effect.name, {**effect.parameters(), key: off[effect.name]["measured"]})
            )
    return model
