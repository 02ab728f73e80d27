"""Effects of the base pixel that a model lacks altogether: what the free refit had to move to meet the measurement.

The refit measures response, dark level and jitter of every pixel.  Where it finds what the model has no effect for, the
effect is missing, and the refit's value is its parameter; nothing has to be searched.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spikecam_env.gap.twins.case import Case, refit_recordings, twins
from spikecam_env.gap.twins.fresh_units import width
from spikecam_env.gap.unit.refit import DARK, DARK_PATTERN, NOISE, RESPONSE, common, within
from spikecam_env.robust import scatter
from spikecam_env.sensor import Effect, SensorModel
from spikecam_env.sensor.effects import CATALOGUE
from spikecam_env.sensor.effects.base import build

LEAST_WIDTH = 5e-4
"""Relative spread of pixels that is more than the refit's own error."""

KNOWN_ALIKE = 2.0
"""Times the usual error of a dark level up to which it tells how pixels differ: of alike pixels with a spike or two in
the dark some have a rate there, and others thirty times the error."""

LEAST_JITTER = 1e-7
"""s^2 that is more than none: a pixel of 10 million electrons."""

QUIET, CLEAR = 4, 5.0
"""Twins without noise, whose refits say what s^2 alike pixels seem to have that beat with the read-out's clock; and by
how many of their standard deviations a measured one has to be more."""


@dataclass(frozen=True)
class Missing:
    """An effect that is not in the model, and its size.  also: names that one V_d cannot tell it from."""

    effect: Effect
    sd: float
    also: tuple[str, ...] = ()


def missing(case: Case, model: SensorModel, names: Sequence[str]) -> list[Missing]:
    """What the refit needs and the model has not, of the candidates in `names`; in the order of the pixel."""
    has = {e.name for e in model.effects}
    live = case.base.live
    gain, dark, white = case.base.gain[live], case.base.dark[live], case.base.white
    known = case.base.dark_sd[live] <= KNOWN_ALIKE * np.median(case.base.dark_sd[live])
    count = float(np.sqrt(2 * live.sum()))
    to_pA = model.circuit.capacitance_fF * model.circuit.swing_V * model.frame_rate_hz * 1e-3
    found: list[Missing] = []

    def add(name: str, value: float, sd: float, also: tuple[str, ...] = ()) -> None:
        if name in names:
            effect = build(CATALOGUE, name, {CATALOGUE[name].strength: value})
            found.append(Missing(effect, sd, also))

    spread = width(gain)
    if not has & set(RESPONSE) and spread > LEAST_WIDTH:
        add("conversion_gain_spread", spread, spread / count, ("bias_voltage_spread", "capacitor_spread"))
    level = common(dark, case.base.dark_sd[live])
    error = float(np.median(case.base.dark_sd[live]))
    if not has & set(DARK) and level > 5 * error / count and fires_in_the_dark(case, level):
        add("dark_current", level * to_pA, float(dark.std()) * to_pA / np.sqrt(live.sum()))
    if not has & set(DARK_PATTERN) and level > 0:
        own = float(np.sqrt(max(scatter(dark[known]) ** 2 - (level * width(gain)) ** 2 - error**2, 0.0)))
        if own > error:
            add("dark_current_spread", own * to_pA, own * to_pA / count)
    if not has & set(NOISE) and white > LEAST_JITTER and is_noise(case, with_all(model, found)):
        add("shot_noise", 1.0 / white, 0.02 / white, ("reset_noise", "excess_threshold_noise"))
    return found


def with_all(model: SensorModel, found: Sequence[Missing]) -> SensorModel:
    """The model with all that was found."""
    for m in found:
        model = model.with_effect(m.effect)
    return model


def is_noise(case: Case, model: SensorModel) -> bool:
    """Whether the refit's s^2 is more than refits of twins of a model without noise find: of alike pixels 3e-7, at some
    lights."""
    made = twins(case, model, within(model, case.base), range(QUIET), sorted(refit_recordings(case)))
    shown = np.array([t.base.white for t in made if t.base is not None])
    return bool(case.base.white > shown.mean() + CLEAR * shown.std(ddof=1))


def fires_in_the_dark(case: Case, level: float) -> bool:
    """Whether the dark recordings hold a third of the spikes that a dark level [thresholds/frame] would give.

    Phases are uniform, so `level` a frame is to be expected of every pixel; without a dark recording: True.
    """
    dark = [o for c, o in zip(case.conditions, case.observations, strict=True) if c.kind == "dark"]
    expected = sum(level * o.frames * o.times.count.size for o in dark)
    return not dark or sum(int(o.times.count.sum()) for o in dark) > expected / 3
