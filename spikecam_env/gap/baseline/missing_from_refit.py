"""Effects of the base pixel that a model lacks altogether, by the free refit.

The refit measures response, dark level and jitter of every pixel.  Where the model has no effect for one that is not 0,
the effect is missing, and the refit's value is its parameter; nothing has to be searched.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.check.label_audit import LEAST_ERROR
from spikecam_env.gap.compare.distance import CLEAR
from spikecam_env.gap.twins.case import Case, refit_recordings, twins
from spikecam_env.gap.twins.fresh_units import width
from spikecam_env.gap.unit.refit import DARK, DARK_PATTERN, NOISE, RESPONSE, common_level, constrained_refit
from spikecam_env.robust import scatter
from spikecam_env.sensor import Effect, SensorModel
from spikecam_env.sensor.effects import CATALOGUE
from spikecam_env.sensor.effects.base import build

LEAST_SPREAD = LEAST_ERROR / 2
"""Relative standard deviation of pixels' response, or of an interval, from which there is any: its two sides are the
least error of a label apart."""

FIRED_SHARE = 0.3
"""Of the spikes that a dark level would give, those that dark recordings hold where the level is there."""


@dataclass(frozen=True)
class Missing:
    """An effect that is not in the model, and its size."""

    effect: Effect
    sd: float
    also: tuple[str, ...] = ()
    """Names of effects that are the same at one V_d."""


def missing_effects(case: Case, model: SensorModel, names: Sequence[str]) -> list[Missing]:
    """Effects that the refit shows and the model lacks, of the candidates in `names`; in the order of the pixel."""
    missing = [_built(one) for one in (*_response(case, model), *_dark_level(case, model)) if one.name in names]
    return missing + [_built(one) for one in _noise(case, with_missing(model, missing)) if one.name in names]


class _Size(NamedTuple):
    """A strength that the refit shows, its standard deviation, and names of effects that are the same at one V_d."""

    name: str
    value: float
    sd: float
    also: tuple[str, ...] = ()


def _built(one: _Size) -> Missing:
    return Missing(build(CATALOGUE, one.name, {CATALOGUE[one.name].strength: one.value}), one.sd, one.also)


def _response(case: Case, model: SensorModel) -> Iterator[_Size]:
    """The spread of pixels' gain, where the model has none."""
    live = case.base.live
    spread = width(case.base.gain[live])
    if not _has(model, RESPONSE) and spread > LEAST_SPREAD:
        sd = spread / _root_of_twice(live)
        yield _Size("conversion_gain_spread", spread, sd, ("bias_voltage_spread", "capacitor_spread"))


def _dark_level(case: Case, model: SensorModel) -> Iterator[_Size]:
    """The dark level of all pixels, and its spread, where the model has none.

    Of equal pixels with a spike or two in the dark some have a rate there, and others thirty times the error: for the
    spread only those of the usual error count.
    """
    usual = case.settings.unit.usual
    live = case.base.live
    gain, dark, sd = case.base.gain[live], case.base.dark[live], case.base.dark_sd[live]
    count = _root_of_twice(live)
    to_pA = model.circuit.capacitance_fF * model.circuit.swing_V * model.frame_rate_hz * 1e-3
    level, error = common_level(dark, sd), float(np.median(sd))
    if not _has(model, DARK) and level > CLEAR * error / count and fires_in_the_dark(case, level):
        yield _Size("dark_current", level * to_pA, float(dark.std()) * to_pA / np.sqrt(live.sum()))
    if not _has(model, DARK_PATTERN) and level > 0:
        known = sd <= usual * np.median(sd)
        own = float(np.sqrt(max(scatter(dark[known]) ** 2 - (level * width(gain)) ** 2 - error**2, 0.0)))
        if own > error:
            yield _Size("dark_current_spread", own * to_pA, own * to_pA / count)


def _noise(case: Case, model: SensorModel) -> Iterator[_Size]:
    """The noise of a spike, where the model has none."""
    white, least = case.base.white, LEAST_SPREAD**2
    if not _has(model, NOISE) and white > least and is_noise(case, model):
        yield _Size("shot_noise", 1.0 / white, 0.02 / white, ("reset_noise", "excess_threshold_noise"))


def _has(model: SensorModel, names: Sequence[str]) -> bool:
    return any(e.name in names for e in model.effects)


def _root_of_twice(live: NDArray[np.bool_]) -> float:
    """By which the standard deviation of a spread over pixels is smaller than the spread."""
    return float(np.sqrt(2 * live.sum()))


def with_missing(model: SensorModel, missing: Sequence[Missing]) -> SensorModel:
    """The model with all that was found."""
    for m in missing:
        model = model.with_effect(m.effect)
    return model


def is_noise(case: Case, model: SensorModel) -> bool:
    """Whether the refit's s^2 is above that of twins of a model without noise: of equal pixels 3e-7, at some lights."""
    base = constrained_refit(model, case.base)
    made = twins(case, model, base, range(case.settings.twins.in_the_end), sorted(refit_recordings(case)))
    white = np.array([t.base.white for t in made if t.base is not None])
    return bool(case.base.white > white.mean() + CLEAR * white.std(ddof=1))


def fires_in_the_dark(case: Case, level: float) -> bool:
    """Whether the dark recordings hold a large share of the spikes that a dark level would give.

    Args:
        case: the measurement; True without a dark recording.
        level: of every pixel, as phases are uniform [thresholds/frame].
    """
    dark = [o for c, o in zip(case.conditions, case.observations, strict=True) if c.kind == "dark"]
    expected = sum(level * o.frames * o.times.count.size for o in dark)
    return not dark or sum(int(o.times.count.sum()) for o in dark) > FIRED_SHARE * expected
