"""Traps of random telegraph noise: a trap raises the mean dark level of its pixel, which is part of the fixed pattern.

A refit finds that level in the pixels where the camera has its traps.  Twins have their traps in other pixels.
"""

from __future__ import annotations

import numpy as np

from spikecam_env.sensor import SensorModel
from spikecam_env.sensor.effects.random_telegraph_noise import RandomTelegraphNoise
from spikecam_env.sensor.unit import Unit
from spikecam_env.types import Floats


def traps_of(model: SensorModel) -> RandomTelegraphNoise | None:
    """The model's telegraph noise, or None."""
    return next((e for e in model.effects if isinstance(e, RandomTelegraphNoise)), None)


def trap_charge(traps: RandomTelegraphNoise, unit: Unit, frame_rate_hz: float) -> Floats:
    """(P,) charge that a trap brings in its upper state [thresholds/frame]."""
    return np.asarray(traps.amplitude_pA * 1e3 / frame_rate_hz / unit.threshold_fC, np.float64)


def less_traps(model: SensorModel, unit: Unit, dark: Floats) -> Floats:
    """(P,) dark levels of a refit less the traps' mean charge, since twins have traps of their own.

    The pixels of the highest levels are taken for those with a trap; none of them falls below the median.

    Args:
        model: with or without traps.
        unit: whose thresholds turn charge into levels.
        dark: (P,) levels of the refit.
    """
    traps = traps_of(model)
    if traps is None:
        return dark
    highest = np.argsort(dark)[dark.size - round(traps.fraction * dark.size) :]
    less = dark[highest] - trap_charge(traps, unit, model.frame_rate_hz)[highest] / 2
    out = dark.copy()
    out[highest] = np.maximum(less, np.median(dark))
    return np.asarray(out)


def drawn_traps(model: SensorModel, shape: tuple[int, int], seed: int) -> Floats:
    """(P,) `trap_charge` of a fresh unit of the model; 0 for pixels without a trap."""
    traps = traps_of(model)
    if traps is None:
        return np.zeros(shape[0] * shape[1])
    has = np.random.default_rng([seed, 2]).random(shape[0] * shape[1]) < traps.fraction
    return np.where(has, trap_charge(traps, model.draw_unit(shape, seed), model.frame_rate_hz), 0.0)


def trap_level(model: SensorModel, charge: Floats, frames: int, rng: np.random.Generator) -> Floats:
    """(P,) mean level that traps of such charge add to one recording [thresholds/frame]: the upper state's share of the
    time is drawn from a beta distribution, with mean 1/2 and the variance of the effect's law."""
    traps = traps_of(model)
    if traps is None:
        return charge
    d, window = traps.dwell_ms / 2, 1e3 * frames / model.frame_rate_hz
    variance = 0.5 * (d * window + d**2 * np.expm1(-window / d)) / window**2
    even = max((0.25 / variance - 1.0) / 2, 1e-2)
    return charge * rng.beta(even, even, size=charge.size)
