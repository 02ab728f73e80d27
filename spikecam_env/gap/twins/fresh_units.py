"""Fresh units drawn from a model: the fixed pattern of rates to expect, and its scatter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.statistics import StatisticKey, keyed, pattern
from spikecam_env.gap.unit.false_spikes import read_with_false_spikes
from spikecam_env.gap.unit.refit import BaseFit, responds
from spikecam_env.gap.unit.traps import drawn_traps, trap_level
from spikecam_env.robust import scatter
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats

SPREAD_PARAMETERS = {
    "gain": {"conversion_gain_spread": "sigma", "bias_voltage_spread": "sigma_V", "capacitor_spread": "sigma_fF"},
    "dark": {"dark_current_spread": "sigma_pA"},
}
"""Parameters that make pixels differ, by property of the unit and by effect."""


def drawn_banks(
    model: SensorModel,
    base: BaseFit,
    shown: Sequence[Condition],
    shape: tuple[int, int],
    count: int,
    seed: int,
    limits: tuple[float, float],
) -> list[dict[StatisticKey, float]]:
    """Pattern statistics of drawn units, at the measured unit's mean response, dark level and noise.

    The model's own spreads are scaled so that the whole spread is the measured one.

    Args:
        model: of the units.
        base: the measured unit.
        shown: conditions of the recordings.
        shape: (rows, columns).
        count: number of units.
        seed: of the first unit.
        limits: least and largest factor of a spread.
    """
    fitted = model
    for _ in range(2):
        factors = {
            part: spread_factor(fitted, part, width(getattr(base, part)[base.live]), shape, seed)
            for part in SPREAD_PARAMETERS
        }
        fitted = with_spreads_scaled(fitted, model, factors, limits)
    return [_pattern_statistics(fitted, base, shown, shape, seed + n) for n in range(count)]


def with_spreads_scaled(
    model: SensorModel, nominal: SensorModel, factors: Mapping[str, float], limits: tuple[float, float]
) -> SensorModel:
    """The model with its own spreads multiplied, within limits times those of a nominal model.

    Args:
        factors: by property of the unit (`SPREAD_PARAMETERS`).
        limits: least and largest multiple of a nominal spread.
    """
    scaled = model
    for part, factor in factors.items():
        for effect in model.effects:
            if effect.name in SPREAD_PARAMETERS[part]:
                key = SPREAD_PARAMETERS[part][effect.name]
                first = next(e for e in nominal.effects if e.name == effect.name).parameters()[key]
                value = np.clip(effect.parameters()[key] * factor, limits[0] * first, limits[1] * first)
                value = float(np.clip(value, *type(effect).__dataclass_fields__[key].metadata["bounds"]))
                scaled = scaled.with_effect(replace(effect, **{key: value}))
    return scaled


def spread_factor(model: SensorModel, part: str, wanted: float, shape: tuple[int, int], seed: int) -> float:
    """Factor for all spreads of `part` (gain or dark) that a model has, for a relative width `wanted`."""
    rest = model
    for name in {e.name for e in model.effects} & SPREAD_PARAMETERS[part].keys():
        rest = rest.without(name)
    units = [m.draw_unit(shape, seed) for m in (model, rest)]
    whole, others = (width(getattr(unit, part)[responds(unit.gain)]) for unit in units)
    own = whole**2 - others**2
    return float(np.sqrt(max(wanted**2 - others**2, 0.0) / own)) if own > 1e-10 else 1.0


def width(values: Floats) -> float:
    """Robust relative spread: the scatter over the median."""
    middle = float(np.median(values))
    return scatter(values) / middle if middle > 0 else 0.0


def drawn_response(model: SensorModel, base: BaseFit, shape: tuple[int, int], seed: int) -> tuple[Floats, Floats]:
    """(gain, dark), (P,) each, of a fresh unit of the model, scaled to the measured unit's medians."""
    unit = model.draw_unit(shape, seed)
    live, alive = base.live & (base.gain > 0), responds(unit.gain)
    gain = unit.gain * (np.median(base.gain[live]) / max(float(np.median(unit.gain[alive])), 1e-12))
    middle = float(np.median(unit.dark[alive]))
    dark = unit.dark * (np.median(base.dark[live]) / middle) if middle > 0 else unit.dark
    return gain, dark


def _pattern_statistics(
    model: SensorModel, base: BaseFit, shown: Sequence[Condition], shape: tuple[int, int], seed: int
) -> dict[StatisticKey, float]:
    gain, dark = drawn_response(model, base, shape, seed)
    charge = drawn_traps(model, shape, seed)
    rng, phases, false = (np.random.default_rng([seed, n]) for n in (1, 2, 3))
    bank: dict[StatisticKey, float] = {}
    for c in shown:
        if c.kind not in ("dark", "flat") or c.light is None:
            continue
        rate = gain * c.picture + dark + trap_level(model, charge, c.frames, rng)
        spikes = np.maximum(rate * c.frames, 1.0)
        noise = np.sqrt(base.white / spikes + 1.0 / (6.0 * c.frames**2))  # first and last spike, each read to a frame
        phase = phases.random(rate.size)
        count = np.floor(rate * c.frames + phase)
        read = np.clip(rate * (1.0 + noise * rng.standard_normal(rate.size)), 0.0, 1.0)
        read = np.where(count > 1, read, count / c.frames)  # as `ObservedRecording.rate`: one spike has no interval
        read = read_with_false_spikes(model, read, rate, phase, c.frames, false)
        bank |= keyed("pattern", c.name, pattern.statistics(read.reshape(shape)))
    return bank
