"""The specification: the pixel frame by frame, in plain numpy, with every effect.

    charge += light of the frame                      (Poisson electrons with shot noise)
    while charge >= threshold:  spike;  charge -= threshold;  threshold = 1 + kappa n      (drawn at each reset)

Reset is asynchronous: charge after the crossing is kept.  A frame reports one bit; further crossings in it are lost.
Charge is in grains of the pixel's own threshold (`light`), so without noise all sums are exact integers.  Effects see
it in thresholds, a power of two away, so that to go there and back changes no bit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor.effects import Effect
from spikecam_env.sensor.effects.base import Exposure
from spikecam_env.sensor.light import GRAINS, Segment, ramp
from spikecam_env.sensor.model import generator
from spikecam_env.sensor.unit import Unit

Array = NDArray[np.float64]


@dataclass
class ReferenceState:
    """charge, threshold: (P,) float64 [grains]; rng: the pixels' own temporal noise; frame: number of the next.

    memory: what each effect remembers, by its name.
    """

    charge: Array
    threshold: Array
    rng: np.random.Generator
    frame: int
    memory: dict[str, Any]


def start(first: Exposure, effects: Sequence[Effect], phase: Array, seed: int) -> ReferenceState:
    """Pixels part-way through a cycle: phase (P,) in [0, 1) is the share of the nominal threshold collected.

    Each effect has a generator of its own: adding or removing one leaves the draws of the others as they were.
    """
    rng = generator(seed, "temporal")
    threshold = draw_threshold(first.unit.kappa, rng)
    memory = {e.name: e.begin(first, generator(seed, f"{e.name}: temporal")) for e in effects}
    return ReferenceState(np.floor(phase * GRAINS), threshold, rng, first.number, memory)


def run(first: Exposure, effects: Sequence[Effect], state: ReferenceState, segment: Segment) -> NDArray[np.uint8]:
    """Advance `state` over a segment; returns spikes (count, P) uint8.  first, effects: as given to `start`."""
    light = ramp(segment, *first.unit.grains_per_frame)
    spikes = np.zeros((segment.count, first.unit.gain.size), dtype=np.uint8)
    before = light.collected(segment.first)
    for i in range(segment.count):
        after = light.collected(segment.first + i + 1)
        now = replace(first, number=state.frame)
        spikes[i] = step(now, effects, state, (after - before).astype(np.float64))
        state.frame += 1
        before = after
    return spikes


def step(now: Exposure, effects: Sequence[Effect], state: ReferenceState, mean: Array) -> NDArray[np.bool_]:
    """One frame: `mean` (P,) is its expected charge [grains]; returns which pixels report a spike (P,)."""
    mean, dark = expected_charge(now, effects, state, mean)
    state.charge += collect(now.unit, mean, dark, state.rng)
    fired = fire(now, effects, state, mean, comparator_offset(now, effects, state))
    for effect in having("spiked", effects):
        charge, rate = thresholds(state.charge, now), thresholds(mean, now)
        charge, state.memory[effect.name] = effect.spiked(charge, fired, rate, now, state.memory[effect.name])
        state.charge = charge.reshape(-1) * GRAINS
    for effect in having("read_out", effects):
        fired, state.memory[effect.name] = effect.read_out(fired, now, state.memory[effect.name])
    return fired.reshape(-1)


def thresholds(grains: Array, now: Exposure) -> Array:
    """Charge (P,) [grains] as effects see it: (H, W) [thresholds]."""
    return (grains / GRAINS).reshape(now.shape)


def having(hook: str, effects: Sequence[Effect]) -> Iterator[Effect]:
    """The effects with a hook of their own of that name."""
    return (effect for effect in effects if effect.overrides(hook))


def expected_charge(
    now: Exposure, effects: Sequence[Effect], state: ReferenceState, mean: Array
) -> tuple[Array, Array]:
    """Charge (P,) expected in a frame and the dark part of it [grains], given that of the light law.

    The dark part matters, and is worked out, where an effect wants it or where dark charge is free of noise.
    """
    acting = list(having("collect", effects))
    if not acting and now.unit.dark_is_noisy:
        return mean, np.zeros(1)
    dark = np.minimum(np.floor(now.unit.dark * GRAINS), mean)
    if not acting:
        return mean, dark
    light_part, dark_part = thresholds(mean - dark, now), thresholds(dark, now)
    for effect in acting:
        memory = state.memory[effect.name]
        light_part, dark_part, state.memory[effect.name] = effect.collect(light_part, dark_part, now, memory)
    dark = np.maximum(dark_part, 0.0).reshape(-1) * GRAINS
    return np.maximum(light_part, 0.0).reshape(-1) * GRAINS + dark, dark


def collect(unit: Unit, mean: Array, dark: Array, rng: np.random.Generator) -> Array:
    """Charge of a frame [grains] given its expectation: Poisson electrons, paper (3)-(4), or the mean itself."""
    if not unit.shot:
        return mean
    certain = 0.0 if unit.dark_is_noisy else dark
    electrons = rng.poisson((mean - certain) * (unit.electrons / GRAINS))
    return electrons * (GRAINS / unit.electrons) + certain


def comparator_offset(now: Exposure, effects: Sequence[Effect], state: ReferenceState) -> Array | None:
    """What this frame adds to the thresholds that the comparators compare with (P,) [grains]; None for nothing."""
    threshold = state.threshold
    for effect in having("compare", effects):
        memory = state.memory[effect.name]
        changed, state.memory[effect.name] = effect.compare(thresholds(threshold, now), now, memory)
        threshold = changed.reshape(-1) * GRAINS
    return None if threshold is state.threshold else threshold - state.threshold


def fire(
    now: Exposure, effects: Sequence[Effect], state: ReferenceState, mean: Array, offset: Array | None
) -> NDArray[np.bool_]:
    """Reset every pixel that is at its threshold until none is; returns which fired (H, W)."""
    fired = np.zeros(mean.size, dtype=np.bool_)
    acting = list(having("after_reset", effects))
    crossed = np.flatnonzero(state.charge >= (state.threshold if offset is None else state.threshold + offset))
    while crossed.size:
        fired[crossed] = True
        shift = 0.0 if offset is None else offset[crossed]
        residual = (state.charge[crossed] - (state.threshold[crossed] + shift)) / GRAINS
        for effect in acting:
            residual = effect.after_reset(residual, mean[crossed] / GRAINS, now)
        state.charge[crossed] = residual * GRAINS
        state.threshold[crossed] = draw_threshold(now.unit.kappa[crossed], state.rng)
        crossed = crossed[residual * GRAINS >= state.threshold[crossed] + shift]
    return fired.reshape(now.shape)


def draw_threshold(kappa: Array, rng: np.random.Generator) -> Array:
    """Thresholds [grains] after a reset, paper (12): 1 + kappa n; exactly one without noise, and draws nothing."""
    if not np.any(kappa):
        return np.full(kappa.shape, float(GRAINS))
    return GRAINS * (1.0 + kappa * rng.standard_normal(kappa.shape))
