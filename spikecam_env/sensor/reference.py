"""The specification: the pixel frame by frame, in plain numpy, with every effect.

    charge += light of the frame                      (Poisson electrons with shot noise)
    while charge >= threshold:  spike;  charge -= threshold;  threshold = 1 + kappa n      (drawn at each reset)

Reset is asynchronous: charge after the crossing is kept.  A frame reports one bit; further crossings in it are lost.
Where references move within the frame (`crossing`), a pixel fires when it is first at its own.
However far noise and effects go, a frame brings MOST_GRAINS at most and a comparator trips at LEAST_LIMIT at least.
Charge is in grains of the pixel's own threshold (`light`), so without noise all sums are exact integers.  Effects see
it in thresholds, a power of two away, so that to go there and back changes no bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor import drive
from spikecam_env.sensor.crossing import first_crossing
from spikecam_env.sensor.effects.base import Effect, Exposure, having
from spikecam_env.sensor.light import GRAINS, LEAST_LIMIT, MOST_GRAINS, Segment, ramp
from spikecam_env.sensor.model import generator
from spikecam_env.sensor.unit import Unit

Array = NDArray[np.float64]


@dataclass
class ReferenceState:
    """charge, threshold: (P,) float64 [grains]; rng: the pixels' own temporal noise; frame: number of the next.

    missed: (P,) charge taken off at a reset for light that falls while the node is held, as far as as much has not yet
    arrived since, which it does without noise.  memory: what each effect remembers, by its name.
    """

    charge: Array
    threshold: Array
    missed: Array
    rng: np.random.Generator
    frame: int
    memory: drive.Memory


def start(
    first: Exposure, effects: Sequence[Effect], phase: Array, seed: int, unit_seed: int | None = None
) -> ReferenceState:
    """Pixels part-way through a cycle: phase (P,) in [0, 1) is the share of the nominal threshold collected.

    seed: of the temporal noise.  unit_seed: of what effects draw once a unit, where it is another.
    """
    rng = generator(seed, "temporal")
    threshold = draw_threshold(first.unit.kappa, rng)
    memory = drive.begin(first, effects, seed, unit_seed)
    return ReferenceState(np.floor(phase * GRAINS), threshold, np.zeros(phase.size), rng, first.number, memory)


def run(first: Exposure, effects: Sequence[Effect], state: ReferenceState, segment: Segment) -> NDArray[np.uint8]:
    """Advance `state` over a segment; returns spikes (count, P) uint8.  first, effects: as given to `start`."""
    light = ramp(segment, *first.unit.grains_per_frame)
    spikes = np.zeros((segment.count, first.unit.gain.size), dtype=np.uint8)
    before = light.collected(segment.first)
    for i in range(segment.count):
        after = light.collected(segment.first + i + 1)
        now = replace(first, number=state.frame)
        spikes[i] = step(now, effects, state, (after - before).astype(np.float64), light.rise)
        state.frame += 1
        before = after
    return spikes


def step(
    now: Exposure, effects: Sequence[Effect], state: ReferenceState, mean: Array, rise: Array
) -> NDArray[np.bool_]:
    """One frame: `mean` (P,) is its expected charge [grains], which rises by `rise` (P,) from its start to its end;
    returns which pixels report a spike (P,)."""
    light, dark = drive.expected_charge(now, effects, state.memory, mean / GRAINS, rise / GRAINS)
    dark_grains = np.clip(dark.values[0].reshape(-1) * GRAINS, 0.0, MOST_GRAINS)
    mean = np.minimum(np.maximum(light.values[0], 0.0).reshape(-1) * GRAINS + dark_grains, MOST_GRAINS)
    missed = np.minimum(state.missed, mean)
    state.missed -= missed
    gained = collect(now.unit, mean, dark_grains, missed, state.rng)
    state.charge += gained
    law = drive.comparators(now, effects, state.memory)
    if law.sway is None:
        fired = fire(now, effects, state, mean, references(now, effects, state, law)).reshape(now.shape)
    else:
        fired = fire_within(now, effects, state, mean, gained, law).reshape(now.shape)
    for effect in having("spiked", effects):
        charge, rate = thresholds(state.charge, now), thresholds(mean, now)
        charge, state.memory[effect.name] = effect.spiked(charge, fired, rate, now, state.memory[effect.name])
        state.charge = charge.reshape(-1) * GRAINS
    return drive.read_out(now, effects, state.memory, fired[None]).reshape(-1)


def thresholds(grains: Array, now: Exposure) -> Array:
    """Charge (P,) [grains] as effects see it: (H, W) [thresholds]."""
    return (grains / GRAINS).reshape(now.shape)


def collect(unit: Unit, mean: Array, dark: Array, missed: Array, rng: np.random.Generator) -> Array:
    """Charge of a frame [grains] given its expectation: Poisson electrons, paper (3)-(4), or the mean itself."""
    if not unit.shot:
        return mean
    certain = missed if unit.dark_is_noisy else np.minimum(missed + dark, mean)
    electrons = rng.poisson((mean - certain) * (unit.electrons / GRAINS))
    return electrons * (GRAINS / unit.electrons) + certain


def references(
    now: Exposure, effects: Sequence[Effect], state: ReferenceState, law: drive.Comparators
) -> Callable[[Array], Array]:
    """What the comparators compare with in this frame, as a function of the thresholds (P,) [grains]."""
    if not having("compare", effects) and not having("react", effects):
        return lambda threshold: np.maximum(threshold, LEAST_LIMIT)
    return partial(compared_with, now, effects, state, law, law.factor.T, law.common.T)


def compared_with(
    now: Exposure,
    effects: Sequence[Effect],
    state: ReferenceState,
    law: drive.Comparators,
    factor: Array,
    common: Array,
    threshold: Array,
) -> Array:
    """What pixels of these thresholds compare with (P,) [grains], where factor and common (H or 1, 1) [mV] stand so."""
    factor, common = (np.broadcast_to(rows, now.shape).reshape(-1) for rows in (factor, common))
    limit = thresholds(threshold * factor + law.grains_per_mV * (common + law.field[0]), now)
    for effect in having("react", effects):
        limit = effect.react(limit, now, state.memory[effect.name])
    return np.maximum(limit.reshape(-1) * GRAINS, LEAST_LIMIT)


def fire(
    now: Exposure,
    effects: Sequence[Effect],
    state: ReferenceState,
    mean: Array,
    compared_with: Callable[[Array], Array],
) -> NDArray[np.bool_]:
    """Reset every pixel that is at its threshold until none is; returns which fired (P,)."""
    fired = np.zeros(mean.size, dtype=np.bool_)
    acting = having("after_reset", effects)
    limit = compared_with(state.threshold)
    crossed = np.flatnonzero(state.charge >= limit)
    while crossed.size:
        fired[crossed] = True
        residual = (state.charge[crossed] - limit[crossed]) / GRAINS
        for effect in acting:
            residual = effect.after_reset(residual, mean[crossed] / GRAINS, now)
            state.missed[crossed] += effect.feedback(now).lost(mean[crossed] / GRAINS) * GRAINS
        state.charge[crossed] = residual * GRAINS
        state.threshold[crossed] = draw_threshold(now.unit.kappa[crossed], state.rng)
        limit = compared_with(state.threshold)
        crossed = crossed[state.charge[crossed] >= limit[crossed]]
    return fired


def fire_within(
    now: Exposure, effects: Sequence[Effect], state: ReferenceState, mean: Array, gained: Array, law: drive.Comparators
) -> NDArray[np.bool_]:
    """As `fire`, where references move within the frame, over which the charge gained (P,) comes evenly."""
    sway = law.sway
    assert sway is not None
    pixels, columns = mean.size, now.shape[1]
    at = np.broadcast_to(np.repeat(sway.at.T, columns if len(sway.at) > 1 else 1, axis=1), (sway.at.shape[1], pixels))
    nodes = [(sway.factor[0, :, k, None], sway.common[0, :, k, None]) for k in range(len(at))]
    fired, since = np.zeros(pixels, dtype=np.bool_), np.zeros(pixels)
    acting = having("after_reset", effects)
    left = np.arange(pixels)
    while left.size:
        limits = np.stack([compared_with(now, effects, state, law, *node, state.threshold)[left] for node in nodes])
        begin = state.charge[left] - gained[left]
        moment, taken = first_crossing(begin, gained[left], since[left], at[:, left], limits)
        crosses = moment <= 1.0
        crossed, since[left] = left[crosses], moment
        fired[crossed] = True
        residual = (state.charge[crossed] - taken[crosses]) / GRAINS
        for effect in acting:
            residual = effect.after_reset(residual, mean[crossed] / GRAINS, now)
            state.missed[crossed] += effect.feedback(now).lost(mean[crossed] / GRAINS) * GRAINS
        state.charge[crossed] = residual * GRAINS
        state.threshold[crossed] = draw_threshold(now.unit.kappa[crossed], state.rng)
        left = crossed
    return fired


def draw_threshold(kappa: Array, rng: np.random.Generator) -> Array:
    """Thresholds [grains] after a reset, paper (12): 1 + kappa n; exactly one without noise, and draws nothing."""
    if not np.any(kappa):
        return np.full(kappa.shape, float(GRAINS))
    return GRAINS * (1.0 + kappa * rng.standard_normal(kappa.shape))
