"""What a block of frames does to the pixels, whatever fires: charge that arrives and references that move.

Worked out here from the effects' hooks, once for all engines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from spikecam_env.sensor.effects.base import Array, Charge, Effect, Exposure, Field, Spikes, having
from spikecam_env.sensor.light import GRAINS
from spikecam_env.sensor.model import generator

Memory = dict[str, Any]
"""What each effect remembers, by its name."""


@dataclass(frozen=True)
class Comparators:
    """A pixel fires at threshold * factor + grains_per_mV * (common + field), in F frames of H rows and P pixels.

    factor: (F, H).  common: (F, H) [mV].  field: (F, P), or (1, P) where all frames are alike, float32 [mV].
    grains_per_mV: (P,).
    """

    factor: Array
    common: Array
    field: Field
    grains_per_mV: Array


def begin(first: Exposure, effects: Sequence[Effect], seed: int, unit_seed: int | None = None) -> Memory:
    """What each effect remembers at the first frame.

    Each has generators of its own: adding or removing one leaves the draws of the others as they were.
    """
    of_unit = seed if unit_seed is None else unit_seed
    return {
        e.name: e.begin(first, generator(of_unit, f"{e.name}: unit"), generator(seed, f"{e.name}: temporal"))
        for e in effects
    }


def expected_charge(
    now: Exposure, effects: Sequence[Effect], memory: Memory, mean: Array, rise: Array | float = 0.0
) -> tuple[Charge, Charge]:
    """Charge of the frames from light and in the dark, given that of the light law, mean (F or 1, P) [thresholds].

    rise: of that law within each frame, as mean, where `wants_rise`.
    The dark part matters, and is worked out, where an effect wants it or where dark charge is free of noise.
    Updates `memory`.
    """
    acting = having("collect", effects)
    whole = mean.reshape(-1, *now.shape)
    if not acting and now.unit.dark_is_noisy:
        return Charge(whole), Charge(np.zeros((1, *now.shape)))
    dark_grains = np.floor(now.unit.dark * GRAINS).reshape(now.shape)
    below = np.minimum(dark_grains / GRAINS, whole)
    light = Charge(whole - below, rise=rise if isinstance(rise, float) else rise.reshape(-1, *now.shape))
    dark = Charge(below)
    for effect in acting:
        light, dark, memory[effect.name] = effect.collect(light, dark, now, memory[effect.name])
    return light, dark


def wants_rise(effects: Sequence[Effect]) -> bool:
    """Whether an effect asks how light changes within a frame."""
    return any(effect.within_frame for effect in effects)


def comparators(now: Exposure, effects: Sequence[Effect], memory: Memory) -> Comparators:
    """How the references move in the frames; updates `memory`."""
    factor = np.ones((now.frames, now.shape[0], 1))
    common = np.zeros((now.frames, now.shape[0], 1))
    fields: list[Field] = []
    for effect in having("compare", effects):
        shift, memory[effect.name] = effect.compare(now, memory[effect.name])
        factor = factor * shift.factor
        millivolts = np.asarray(shift.millivolts)
        if millivolts.shape[-1:] in ((), (1,)):
            common = common + millivolts
        else:
            fields.append(millivolts.astype(np.float32, copy=False))
    pixels = now.shape[0] * now.shape[1]
    field = reduce(np.add, fields) if fields else np.zeros((1, pixels), dtype=np.float32)
    grains_per_mV = GRAINS * (1e-3 / now.unit.swing_V)
    return Comparators(factor[:, :, 0], common[:, :, 0], field.reshape(-1, pixels), grains_per_mV)


def read_out(now: Exposure, effects: Sequence[Effect], memory: Memory, spikes: Spikes) -> Spikes:
    """The bits reported (F, H, W) of those that fired; updates `memory`."""
    for effect in having("read_out", effects):
        spikes, memory[effect.name] = effect.read_out(spikes, now, memory[effect.name])
    return spikes
