"""The specification: the pixel frame by frame, in plain numpy, with every effect.

    charge += light of the frame                      (Poisson electrons with shot noise)
    while charge >= threshold:  spike;  charge -= threshold;  threshold = 1 + kappa n      (drawn at each reset)

Reset is asynchronous: charge after the crossing is kept.  A frame reports one bit; further crossings in it are lost.
Where references move within the frame (`crossing`), a pixel fires when it is first at its own.
However far noise and effects go, a frame brings MOST_GRAINS at most and a comparator trips at LEAST_LIMIT at least.
Charge is in grains of the pixel's own threshold (`light`), so without noise all sums are exact integers.  Effects get
it in thresholds, a power of two away, so that the conversion changes no bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from heapq import heappop, heappush

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor import drive
from spikecam_env.sensor.effects.base import Effect, ExposureBlock, having
from spikecam_env.sensor.ground.crossing import MOST_AGAIN, NEVER, first_crossing
from spikecam_env.sensor.light import GRAINS, LEAST_LIMIT, MOST_GRAINS, Piece, Segment, on_grid, ramp
from spikecam_env.sensor.model import generator
from spikecam_env.sensor.unit import Unit
from spikecam_env.types import Floats, Masks, Spikes


@dataclass
class ReferenceState:
    """Pixels mid-stream, (P,) float64 [grains]."""

    charge: Floats
    threshold: Floats
    missed: Floats
    """Charge taken off at resets for light that falls while the node is held; as much of later light has no noise."""
    rng: np.random.Generator
    """Of the pixels' own temporal noise."""
    frame: int
    """Number of the next."""
    memory: drive.Memory


def start(
    first: ExposureBlock, effects: Sequence[Effect], phase: Floats, seed: int, unit_seed: int | None = None
) -> ReferenceState:
    """Pixels part-way through a cycle.

    Args:
        phase: (P,) in [0, 1), share of the nominal threshold collected.
        seed: of the temporal noise.
        unit_seed: of draws of effects once a unit, where it is another.
    """
    rng = generator(seed, "temporal")
    threshold = draw_threshold(first.unit.kappa, rng)
    memory = drive.begin(first, effects, seed, unit_seed)
    return ReferenceState(np.floor(phase * GRAINS), threshold, np.zeros(phase.size), rng, first.number, memory)


def run(first: ExposureBlock, effects: Sequence[Effect], state: ReferenceState, segment: Segment) -> Spikes:
    """Spikes (count, P) uint8 of a segment; advances `state`.  The first frame and effects are those of `start`."""
    light = ramp(segment, *first.unit.grains_per_frame)
    spikes = np.zeros((segment.count, first.unit.gain.size), dtype=np.uint8)
    before = light.collected(segment.first)
    for i in range(segment.count):
        after = light.collected(segment.first + i + 1)
        now = replace(first, number=state.frame)
        spikes[i] = step(now, effects, state, (after - before).astype(np.float64), light.rise, light.pieces)
        state.frame += 1
        before = after
    return spikes


def step(
    now: ExposureBlock,
    effects: Sequence[Effect],
    state: ReferenceState,
    mean: Floats,
    rise: Floats,
    pieces: Sequence[Piece] = (),
) -> Masks:
    """One frame; returns which pixels report a spike (P,).

    Args:
        mean: expected charge (P,) [grains].
        rise: of that charge from the frame's start to its end (P,).
        pieces: of the frame, where its light bends.
    """
    light, dark = drive.expected_charge(now, effects, state.memory, mean / GRAINS, rise / GRAINS, pieces)
    dark_grains = np.clip(dark.values[0].reshape(-1) * GRAINS, 0.0, MOST_GRAINS)
    mean = np.minimum(np.maximum(light.values[0], 0.0).reshape(-1) * GRAINS + dark_grains, MOST_GRAINS)
    missed = np.minimum(state.missed, mean)
    state.missed -= missed
    gained = collect(now.unit, mean, dark_grains, missed, state.rng)
    law = drive.comparators(now, effects, state.memory)
    if law.sway is None:
        state.charge += gained
        fired = fire(now, effects, state, mean, references(now, effects, state, law)).reshape(now.shape)
    else:
        fired = fire_in_turn(now, effects, state, mean, gained, law).reshape(now.shape)
    for effect in having("spiked", effects):
        spiked(effect, now, state, gained, fired)
        if effect.feedback(now).left and law.sway is None:
            again = fired
            for _ in range(MOST_AGAIN):
                again = crossed_again(now, effects, state, mean, again, law)
                if not again.any():
                    break
                spiked(effect, now, state, gained, again)
    return drive.read_out(now, effects, state.memory, fired[None]).reshape(-1)


def spiked(effect: Effect, now: ExposureBlock, state: ReferenceState, gained: Floats, fired: Masks) -> None:
    """Change charge by an effect, given the pixels that fired (H, W) and the charge (P,) gained in the frame."""
    charge, rate = thresholds(state.charge, now), thresholds(gained, now)
    charge, state.memory[effect.name] = effect.spiked(charge, fired, rate, now, state.memory[effect.name])
    state.charge = charge.reshape(-1) * GRAINS


def crossed_again(
    now: ExposureBlock,
    effects: Sequence[Effect],
    state: ReferenceState,
    mean: Floats,
    fired: Masks,
    law: drive.Comparators,
) -> Masks:
    """Of the pixels that fired (H, W), reset those that charge left by a reset takes to their threshold again.

    Returns:
        These pixels (H, W), whose bit is set already.
    """
    compared = references(now, effects, state, law)
    limit = compared(state.threshold)
    again: Masks = fired.reshape(-1) & (state.charge >= limit)
    pixels = np.flatnonzero(again)
    reset(now, effects, state, mean, limit[pixels], pixels)
    state.threshold[pixels] = draw_threshold(now.unit.kappa[pixels], state.rng)
    return again.reshape(now.shape)


def thresholds(grains: Floats, now: ExposureBlock) -> Floats:
    """Charge (P,) [grains] in the unit of effects: (H, W) [thresholds]."""
    return (grains / GRAINS).reshape(now.shape)


def collect(unit: Unit, mean: Floats, dark: Floats, missed: Floats, rng: np.random.Generator) -> Floats:
    """Charge of a frame [grains] given its expectation: Poisson electrons, paper (3)-(4), or the mean itself."""
    if not unit.shot:
        return mean
    certain = missed if unit.dark_is_noisy else np.minimum(missed + dark, mean)
    electrons = rng.poisson((mean - certain) * (unit.electrons / GRAINS))
    return electrons * (GRAINS / unit.electrons) + certain


def references(
    now: ExposureBlock, effects: Sequence[Effect], state: ReferenceState, law: drive.Comparators
) -> Callable[[Floats], Floats]:
    """Levels (P,) [grains] at which the comparators trip in this frame, as a function of the thresholds (P,)."""
    if not having("compare", effects) and not having("react", effects):
        return lambda threshold: np.maximum(threshold, LEAST_LIMIT)
    return partial(compared_with, now, effects, state, law, law.factor.T, law.common.T)


def compared_with(
    now: ExposureBlock,
    effects: Sequence[Effect],
    state: ReferenceState,
    law: drive.Comparators,
    factor: Floats,
    common: Floats,
    threshold: Floats,
) -> Floats:
    """Levels (P,) [grains] of pixels of these thresholds, given factor and common (H or 1, 1) [mV]."""
    factor, common = (np.broadcast_to(rows, now.shape).reshape(-1) for rows in (factor, common))
    limit = thresholds(threshold * factor + law.grains_per_mV * (common + law.field[0]), now)
    for effect in having("react", effects):
        limit = effect.react(limit, now, state.memory[effect.name])
    return np.maximum(limit.reshape(-1) * GRAINS, LEAST_LIMIT)


def fire(
    now: ExposureBlock,
    effects: Sequence[Effect],
    state: ReferenceState,
    mean: Floats,
    compared_with: Callable[[Floats], Floats],
) -> Masks:
    """Reset every pixel that is at its threshold until none is; returns which fired (P,)."""
    fired = np.zeros(mean.size, dtype=np.bool_)
    limit = compared_with(state.threshold)
    crossed = np.flatnonzero(state.charge >= limit)
    while crossed.size:
        fired[crossed] = True
        reset(now, effects, state, mean, limit[crossed], crossed)
        state.threshold[crossed] = draw_threshold(now.unit.kappa[crossed], state.rng)
        limit = compared_with(state.threshold)
        crossed = crossed[state.charge[crossed] >= limit[crossed]]
    return fired


def fire_in_turn(
    now: ExposureBlock,
    effects: Sequence[Effect],
    state: ReferenceState,
    mean: Floats,
    gained: Floats,
    law: drive.Comparators,
) -> Masks:
    """As `fire`, in the order of the moments at which pixels are at their references, which may move within the frame.

    Each spike kicks its neighbours at its moment (`Feedback`).  Charge is put on a grid on which sums are the same in
    any order.  The thresholds after a first reset are drawn for all pixels at once: levels of one pixel take as long to
    compute as those of all.

    Args:
        mean: expected charge of the frame (P,) [grains].
        gained: charge of the frame (P,) [grains], evenly over it.
        law: of the comparators, moving within the frame.
    """
    state.charge, gained = on_grid(state.charge), on_grid(gained)
    state.charge += gained
    kick = on_grid(sum(effect.feedback(now).kick_at_once for effect in effects) * GRAINS)
    at, limits_of = nodes(now, effects, state, law)
    limits, following = limits_of(state.threshold), draw_threshold(now.unit.kappa, state.rng)
    limits_that_follow = limits_of(following)
    moment, taken = np.full((2, mean.size), NEVER)
    last, fired = np.full(mean.size, -1.0), np.zeros(mean.size, dtype=np.bool_)
    turns: list[tuple[float, int]] = []

    def look(pixel: int, since: float) -> None:
        moment[pixel], of_pixel, charge = NEVER, limits[:, pixel].tolist(), float(state.charge[pixel])
        if charge < min(of_pixel):
            return
        more = float(gained[pixel])
        moment[pixel], taken[pixel] = first_crossing(charge - more, more, since, at[pixel // now.shape[1]], of_pixel)
        if moment[pixel] != NEVER:
            heappush(turns, (moment[pixel], pixel))

    for near in np.flatnonzero(state.charge >= limits.min(axis=0)):
        look(int(near), 0.0)
    while turns:
        u, pixel = heappop(turns)
        if u != moment[pixel]:
            continue
        if fired[pixel] and now.unit.kappa[pixel]:
            following[pixel] = draw_threshold(now.unit.kappa[[pixel]], state.rng)[0]
            limits_that_follow[:, pixel] = limits_of(following)[:, pixel]
        fired[pixel], last[pixel] = True, u
        reset(now, effects, state, mean, taken[pixel], np.array([pixel]))
        state.charge[pixel] = on_grid(state.charge[pixel])
        state.threshold[pixel], limits[:, pixel] = following[pixel], limits_that_follow[:, pixel]
        look(pixel, u)
        for other in neighbours(pixel, now.shape) if kick else ():
            state.charge[other] += kick
            planned = moment[other], taken[other]
            look(other, u)
            if moment[other] == u == last[other]:
                state.charge[other] -= kick
                moment[other], taken[other] = planned
    return fired


def nodes(
    now: ExposureBlock, effects: Sequence[Effect], state: ReferenceState, law: drive.Comparators
) -> tuple[list[list[float]], Callable[[Floats], Floats]]:
    """Moments of each row at which the references are known, n each, and levels (n, P) as a function of thresholds."""
    sway = law.sway
    assert sway is not None
    moves = [(sway.factor[0, :, k, None], sway.common[0, :, k, None]) for k in range(sway.at.shape[1])]
    at = np.broadcast_to(sway.at, (now.shape[0], sway.at.shape[1])).tolist()
    return at, lambda threshold: np.stack([compared_with(now, effects, state, law, *m, threshold) for m in moves])


def neighbours(pixel: int, shape: tuple[int, int]) -> list[int]:
    """The four pixels beside one; beyond the edge there are none."""
    row, column = divmod(pixel, shape[1])
    beside = ((row - 1, column), (row, column - 1), (row, column + 1), (row + 1, column))
    return [r * shape[1] + c for r, c in beside if 0 <= r < shape[0] and 0 <= c < shape[1]]


def reset(
    now: ExposureBlock,
    effects: Sequence[Effect],
    state: ReferenceState,
    mean: Floats,
    taken: Floats | float,
    pixels: NDArray[np.intp],
) -> None:
    """Take that charge [grains] from pixels that fire; a held node misses light."""
    residual = (state.charge[pixels] - taken) / GRAINS
    for effect in having("after_reset", effects):
        residual = effect.after_reset(residual, mean[pixels] / GRAINS, now)
        state.missed[pixels] += effect.feedback(now).lost(mean[pixels] / GRAINS) * GRAINS
    state.charge[pixels] = residual * GRAINS


def draw_threshold(kappa: Floats, rng: np.random.Generator) -> Floats:
    """Thresholds [grains] after a reset, paper (12): 1 + kappa n; exactly one without noise, and draws nothing."""
    if not np.any(kappa):
        return np.full(kappa.shape, float(GRAINS))
    return GRAINS * (1.0 + kappa * rng.standard_normal(kappa.shape))
