"""Charge that arrives and references that move in a block of frames, whatever fires.

Computed here from the effects' hooks, once for all engines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from spikecam_env.sensor.effects.base import Charge, Effect, ExposureBlock, Stage, having
from spikecam_env.sensor.light import GRAINS, Piece
from spikecam_env.sensor.model import generator
from spikecam_env.types import Floats, Masks, Pictures

Memory = dict[str, Any]
"""State of each effect, by its name."""

_TOUCHES = 1e-9
"""A kink so near to the end of a part [frames] counts as at it: rounding would leave it on either side."""


@dataclass(frozen=True)
class Sway:
    """How the references move within F frames of H rows: linear between n nodes."""

    at: Floats
    """(H or 1, n) moments of the row's own frame, 0 .. 1, ascending; where a reference jumps, twice the same."""
    factor: Floats
    """(F or 1, H or 1, n), the frame's own factor included."""
    common: Floats
    """As factor [mV]."""


@dataclass(frozen=True)
class Comparators:
    """A pixel fires at threshold * factor + grains_per_mV * (common + field), in F frames of H rows and P pixels."""

    factor: Floats
    """(F, H), the least of each frame."""
    common: Floats
    """(F, H) [mV], the least of each frame."""
    field: Pictures
    """(F, P), or (1, P) where all frames are alike [mV]."""
    grains_per_mV: Floats
    """(P,)."""
    sway: Sway | None
    """How factor and common move within the frames; None where they do not."""


def begin(first: ExposureBlock, effects: Sequence[Effect], seed: int, unit_seed: int | None = None) -> Memory:
    """State of each effect at the first frame, each with generators of its own: no other effect changes its draws."""
    of_unit = seed if unit_seed is None else unit_seed
    return {
        e.name: e.begin(first, generator(of_unit, f"{e.name}: unit"), generator(seed, f"{e.name}: temporal"))
        for e in effects
    }


def expected_charge(
    now: ExposureBlock,
    effects: Sequence[Effect],
    memory: Memory,
    mean: Floats,
    rise: Floats | float = 0.0,
    pieces: Sequence[Piece] = (),
) -> tuple[Charge, Charge]:
    """Charge of the frames from light and in the dark.

    The dark part is computed where an effect changes charge or where dark charge is free of noise.

    Args:
        mean: charge by the light law (F or 1, P) [thresholds].
        rise: of that law within each frame, as mean, where `wants_rise`.
        pieces: of the light of one frame that bends within it, where `wants_pieces`.

    Returns:
        Charge from light, and in the dark.
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
        if pieces and acts_on_pieces(effect):
            light, memory[effect.name], pieces = _collect_by_pieces(
                effect, light, dark, now, memory[effect.name], pieces
            )
        else:
            before = light
            if pieces and effect.wants_rise and effect.overrides("lead"):
                light = _as_read(light, effect.lead(now), pieces)
            light, dark, memory[effect.name] = effect.collect(light, dark, now, memory[effect.name])
            if pieces and light is not before:
                pieces = _in_proportion(pieces, before.values[0], light.values[0])
    return light, dark


def _collect_by_pieces(
    effect: Effect, light: Charge, dark: Charge, now: ExposureBlock, memory: Any, pieces: Sequence[Piece]
) -> tuple[Charge, Any, list[Piece]]:
    """The light of one frame after an effect that acts on its pieces, one after another.

    Changes are added to mean and rise of the frame, so that unchanged light keeps its bits.
    """
    mean, rise, after = light.values, np.broadcast_to(light.rises, light.values.shape), []
    for start, length, x, d in pieces:
        given = Charge(x.reshape(1, *now.shape), 1.0, d.reshape(1, *now.shape))
        made, _, memory = effect.collect(given, dark, now.piece(start, length), memory)
        more, steeper = made.values - given.values, made.rises - given.rises
        arm = start + 0.5 * length - 0.5
        mean = mean + length * more
        rise = rise + 12.0 * length * (arm * more + length / 12.0 * steeper)
        after.append(Piece(start, length, made.values.reshape(-1), np.broadcast_to(made.rises, more.shape).reshape(-1)))
    return Charge(mean, 1.0, rise), memory, after


def _in_proportion(pieces: Sequence[Piece], before: Floats, after: Floats) -> list[Piece]:
    """Pieces of a frame whose charge (H, W) an effect has changed as a whole."""
    share = np.divide(after, before, out=np.ones_like(before), where=before > 0.0).reshape(-1)
    return [piece._replace(mean=piece.mean * share, rise=piece.rise * share) for piece in pieces]


def _as_read(light: Charge, lead: Floats | float, pieces: Sequence[Piece]) -> Charge:
    """Light of one frame whose rows are read `lead` (H, 1) before its end, or a frame and so much less.

    Its rise is that of the straight line of which as much comes after the read-out.
    """
    values = light.values
    early = lead - (np.asarray(lead) > 1.0)
    late = np.zeros_like(values)
    for start, length, x, d in pieces:
        begin = np.clip(1.0 - early, start, start + length)
        inside = start + length - begin
        arm = 0.5 * (begin - start)  # from the middle of the piece to the middle of its later part
        late += inside * (x.reshape(values.shape) + d.reshape(values.shape) * (arm / length))
    flat = early * (1.0 - early)
    rise = np.divide(2.0 * (late - early * values), flat, out=np.zeros_like(values), where=flat + 0.0 * values > 0.0)
    return Charge(values, 1.0, rise)


def wants_rise(effects: Sequence[Effect]) -> bool:
    """Whether an effect asks how light changes within a frame."""
    return any(effect.wants_rise for effect in effects)


def wants_pieces(effects: Sequence[Effect]) -> bool:
    """Whether an effect asks for the pieces of a frame whose light bends."""
    return any(acts_on_pieces(effect) or effect.overrides("lead") for effect in effects)


def acts_on_pieces(effect: Effect) -> bool:
    """Whether an effect acts on light piece by piece; one of the read-out, which sets where frames end, does not."""
    return effect.wants_rise and effect.stage < Stage.READOUT


def parts(first: ExposureBlock, effects: Sequence[Effect]) -> int:
    """Parts of a frame between the nodes of `Sway`; 0 where no reference moves and nobody is kicked within a frame."""
    kicked = any(effect.feedback(first).kick_at_once for effect in effects)
    return max((effect.parts(first.frame_rate_hz) for effect in effects), default=0) or int(kicked)


def lead(first: ExposureBlock, effects: Sequence[Effect]) -> Floats:
    """Time from each row's read-out to the end of the array's frame (H, 1) [frames]: at u its clock is at u - lead."""
    return np.zeros((first.shape[0], 1)) + sum(effect.lead(first) for effect in effects)


def comparators(now: ExposureBlock, effects: Sequence[Effect], memory: Memory) -> Comparators:
    """How the references move in the frames; updates `memory`."""
    whole = (now.frames, now.shape[0])
    factor, common = np.ones((1, 1, 1)), np.zeros((1, 1, 1))
    fields: list[Pictures] = []
    for effect in having("compare", effects):
        shift, memory[effect.name] = effect.compare(now, memory[effect.name])
        factor = factor * shift.factor
        millivolts = np.asarray(shift.millivolts)
        if millivolts.shape[-1:] in ((), (1,)):
            common = common + millivolts
        else:
            fields.append(millivolts.astype(np.float32, copy=False))
    sway = _sway(now, effects, factor, common)
    if sway is not None:
        factor, common = sway.factor.min(axis=2, keepdims=True), sway.common.min(axis=2, keepdims=True)
    pixels = now.shape[0] * now.shape[1]
    field = reduce(np.add, fields) if fields else np.zeros((1, pixels), dtype=np.float32)
    grains_per_mV = GRAINS * (1e-3 / now.unit.swing_V)
    factor, common = (np.broadcast_to(rows, (*whole, 1))[:, :, 0] for rows in (factor, common))
    return Comparators(factor, common, field.reshape(-1, pixels), grains_per_mV, sway)


def movement(now: ExposureBlock, effect: Effect) -> tuple[Floats, Floats]:
    """Variation and range (H or 1, 1) of the reference that an effect moves within frame `now` [thresholds]."""
    sway = _sway(now, [effect], np.ones((1, 1, 1)), np.zeros((1, 1, 1)))
    if sway is None:
        return np.zeros((1, 1)), np.zeros((1, 1))
    level = sway.factor[0] + sway.common[0] * (1e-3 / now.unit.swing_V.min())
    return abs(np.diff(level, axis=1)).sum(axis=1, keepdims=True), np.ptp(level, axis=1, keepdims=True)


def _sway(now: ExposureBlock, effects: Sequence[Effect], factor: Floats, common: Floats) -> Sway | None:
    """How the references move within the frames besides factor and common (F or 1, H or 1, 1), which hold for each."""
    count = parts(now, effects)
    if count == 0:
        return None
    swaying = [effect for effect in effects if effect.parts(now.frame_rate_hz)]
    early = lead(now, effects)
    at = _nodes(count, [kink for effect in swaying for kink in effect.kinks(now)], early)
    early = early if early.any() else np.zeros((1, 1))
    phase, beside = at - early, _beside(at, 1.0 / count) - early
    for effect in swaying:
        shift = effect.sway(now, phase, beside)
        factor, common = factor * shift.factor, common + shift.millivolts
    nodes = at.shape[1]
    return Sway(at, *(np.broadcast_to(wave, (*wave.shape[:2], nodes)) for wave in (factor, common)))


def _nodes(parts: int, kinks: Sequence[float], early: Floats) -> Floats:
    """Ends of the parts of a frame, and twice each kink, (H or 1, n) ascending."""
    ends = np.arange(parts + 1)[None] / parts
    if not kinks:
        return ends
    early = early if early.any() else np.zeros((1, 1))
    moments = (np.array(kinks)[None] + early) % 1.0
    near = np.round(moments * parts) / parts
    moments = np.where(np.abs(moments - near) < _TOUCHES, near % 1.0, moments)
    return np.sort(np.concatenate([np.repeat(ends, len(moments), axis=0), moments, moments], axis=1), axis=1)


def _beside(at: Floats, part: float) -> Floats:
    """A moment beside each node, on the side on which it is of several nodes at the same moment."""
    middles = 0.5 * (at[:, 1:] + at[:, :-1])
    left = np.concatenate([at[:, :1] - 0.5 * part, middles], axis=1)
    right = np.concatenate([middles, middles[:, -1:]], axis=1)
    last = np.concatenate([at[:, 1:] > at[:, :-1], np.zeros((len(at), 1), dtype=np.bool_)], axis=1)
    return np.where(last, right, left)


def read_out(now: ExposureBlock, effects: Sequence[Effect], memory: Memory, spikes: Masks) -> Masks:
    """The bits reported (F, H, W) of those that fired; updates `memory`."""
    for effect in having("read_out", effects):
        spikes, memory[effect.name] = effect.read_out(spikes, now, memory[effect.name])
    return spikes
