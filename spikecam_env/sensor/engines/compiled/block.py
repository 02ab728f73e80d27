"""The block kernel of the fast engine: every effect, a block of frames at a time.

The effects' hooks give once a block the charge that arrives and the motion of references (`drive`).  A compiled loop
(`bands`) then goes from frame to frame and applies the numbers of `Feedback` to spikes.

Noise is the jump kernel's: a pixel fires when its expected charge has advanced by Gamma(N, 1) / N, with the reset's
draw mixed in.  N counts the level of the reference at the reset, and not the light that falls while the node is held.
Later shifts delta of the reference, and of the charge at the frame's end (`kick`), come without shot noise: of a
spike's variance a share |delta|, 1 % where a reference moves by 1 % of the swing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor import drive
from spikecam_env.sensor.effects.base import Charge, Effect, ExposureBlock, Feedback, Few, having
from spikecam_env.sensor.engines.compiled import fast
from spikecam_env.sensor.engines.compiled.bands.arguments import (
    BlockFrames,
    BlockLight,
    BlockPixels,
    BlockReferences,
    SpikeLaw,
)
from spikecam_env.sensor.engines.compiled.bands.frames import advance, pieces_of_work
from spikecam_env.sensor.engines.compiled.queue import run_in_threads
from spikecam_env.sensor.engines.compiled.tile import ramp, ramp_charge
from spikecam_env.sensor.ground.quantile import MIN_ELECTRONS
from spikecam_env.sensor.light import GRAINS, Piece, Ramp, Segment, on_grid, pieces_of, rise_of
from spikecam_env.sensor.unit import Unit
from spikecam_env.types import Floats, Pictures, Spikes

_BLOCK = 1 << 22
"""Most pixel-steps of a block: an array of pixels and frames then takes 32 megabytes."""

_MOVING = 1 << 16
"""Most pixel-steps where light moves, which makes a dozen such arrays: half a megabyte each, which a cache holds and
the allocator keeps.  Fresh pages cost up to four times the arithmetic."""

_NODES = 1 << 20
"""Most nodes of a block with references that move within the frame: eight megabytes."""

_NO_SWAY = drive.Sway(np.empty((1, 0)), np.empty((1, 1, 0)), np.empty((1, 1, 0)))

_NO_FEW = Few(np.empty(0, np.intp), np.empty((1, 0)))

_FEWEST, _LONGEST = 8, 256
"""Fewest frames of a block, whatever the array, which share its overhead, and most: numbers of rows and single pixels
in each frame then stay in the cache."""


def missing(effects: Sequence[Effect]) -> list[str]:
    """Names of effects, or options of them, that this kernel does not carry."""
    return [e.name for e in effects if not e.is_compiled()] + fast.missing([e for e in effects if e.is_fixed()])


def missing_of(unit: Unit) -> list[str]:
    """Parts of a given unit's law that this kernel, and the jump kernel, do not carry."""
    certain_dark = unit.shot and not unit.dark_is_noisy
    few = unit.shot and float(unit.electrons.min()) < MIN_ELECTRONS
    return ["unit.dark_is_noisy=false"] * certain_dark + [f"unit.electrons below {MIN_ELECTRONS:g}"] * few


@dataclass(frozen=True)
class BlockLaw:
    """A unit in the loop's numbers, (P,) each."""

    gain: Pictures
    """[grains/frame]."""
    dark: Pictures
    """[grains/frame]."""
    per_electron: Floats
    """1/N, 0 without shot noise."""
    kappa_squared: Floats
    polynomial: tuple[np.float32, ...]
    """Law of a spike's charge."""

    def __deepcopy__(self, memo: dict[int, Any]) -> BlockLaw:
        return self  # never written to


@dataclass
class BlockState:
    """Pixels mid-stream."""

    law: BlockLaw
    charge: Floats
    """(P,) [grains]."""
    threshold: Floats
    """(P,) [grains]."""
    fired: NDArray[np.uint32]
    """(P,) spikes so far."""
    activity: Floats
    """(H,) share of a row that fired in the last frame."""
    crossing: Floats
    """(P,) time of the last crossing [frames]."""
    frame: int
    """Number of the next."""
    seeds: tuple[np.uint32, np.uint32]
    """With the numbers of a pixel and of its spike they fix every draw."""
    memory: drive.Memory


def start(
    first: ExposureBlock, effects: Sequence[Effect], phase: Floats, seed: int, unit_seed: int | None = None
) -> BlockState:
    """Pixels part-way through a cycle; arguments as for `reference.start`."""
    pixels = fast.start(first.unit, phase, seed)
    charge = np.floor(phase * GRAINS)
    per_electron = fast.per_electron(first.unit)
    return BlockState(
        BlockLaw(*first.unit.grains_per_frame, per_electron, first.unit.kappa**2, pixels.law.polynomial),
        charge,
        threshold=charge + pixels.remaining[: phase.size],
        fired=np.zeros(phase.size, dtype=np.uint32),
        activity=np.zeros(first.shape[0]),
        crossing=np.full(phase.size, -np.inf),
        frame=first.number,
        seeds=pixels.seeds,
        memory=drive.begin(first, effects, seed, unit_seed),
    )


def run(
    first: ExposureBlock,
    effects: Sequence[Effect],
    state: BlockState,
    segments: Iterable[Segment],
    spikes: Spikes,
    *,
    threads: int | None = None,
) -> Spikes:
    """Advance `state` over segments; writes their spikes to `spikes` (all frames, P) uint8, 0 or 1, and returns it.

    Args:
        threads: default NUMBA_NUM_THREADS.
    """
    done = 0
    longest = _longest(first, effects)
    for parts in _blocks(state.law, segments, longest):
        mean = _mean(parts)
        rise = _rise(parts) if drive.wants_rise(effects) else 0.0
        count = sum(part.count for part in parts)
        now = replace(first, number=state.frame, frames=count)
        _block(now, effects, state, (mean, rise, parts[0].light.pieces), spikes[done : done + count], threads)
        state.frame += count
        done += count
    return spikes


@dataclass(frozen=True)
class _Part:
    """Frames first .. first + count of a ramp of light."""

    light: Ramp
    first: int
    count: int


def _longest(first: ExposureBlock, effects: Sequence[Effect]) -> int:
    """Frames of a block at most, whatever the light."""
    return max(min(_LONGEST, _NODES // (first.shape[0] * (drive.parts(first, effects) + 1))), 1)


def _blocks(law: BlockLaw, segments: Iterable[Segment], longest: int) -> Iterator[list[_Part]]:
    """Parts that make a block: light that moves, or the same light that stays."""
    block: list[_Part] = []
    frames = 0
    for part in _parts(law, segments, longest):
        if block and (frames + part.count > _most(part.light, longest) or not _alike(block[-1].light, part.light)):
            yield block
            block, frames = [], 0
        block.append(part)
        frames += part.count
    if block:
        yield block


def _most(light: Ramp, longest: int) -> int:
    """Frames of a block in such light, at most."""
    return min(max(_FEWEST, (_BLOCK if light.steady else _MOVING) // light.level.size), longest)


def _parts(law: BlockLaw, segments: Iterable[Segment], longest: int) -> Iterator[_Part]:
    last, light = None, None
    for s in segments:
        if last is None or light is None or s.length != last.length or not _same_light(s, last):
            ends = fast.compilable(s.radiance0), fast.compilable(s.radiance1)
            light = Ramp(*ramp(*ends, law.gain, law.dark, s.length))
            light = replace(light, own_rise=rise_of(s, law.gain), pieces=pieces_of(s, law.gain))
        last = s
        most = _most(light, longest)
        for done in range(0, s.count, most):
            yield _Part(light, s.first + done, min(most, s.count - done))


def _same_light(one: Segment, other: Segment) -> bool:
    return one.radiance0 is other.radiance0 and one.radiance1 is other.radiance1


def _alike(one: Ramp, other: Ramp) -> bool:
    if one.pieces or other.pieces:
        return False
    if one is other or not (one.steady or other.steady):
        return True
    return one.steady and other.steady and np.array_equal(one.level, other.level)


def _block(
    now: ExposureBlock,
    effects: Sequence[Effect],
    state: BlockState,
    charge: tuple[Floats, Floats | float, Sequence[Piece]],
    spikes: Spikes,
    threads: int | None,
) -> None:
    light, dark = drive.expected_charge(now, effects, state.memory, *charge)
    law = drive.comparators(now, effects, state.memory)
    sway = law.sway or _NO_SWAY
    feedback = _sum([e.feedback(now) for e in effects])
    light = light if light.few is None else Charge(light.values)
    few = dark.few or _NO_FEW
    work = (
        BlockLight(
            _pixels(light),
            _pixels(dark),
            _rows(light.factor, now),
            _rows(dark.factor, now),
            few.pixels,
            _plain(few.charge),
        ),
        BlockReferences(
            _plain(law.factor),
            _plain(law.common),
            law.field,
            law.grains_per_mV,
            *(_plain(nodes) for nodes in (sway.at, sway.factor, sway.common)),
        ),
        SpikeLaw(feedback, state.law.per_electron, state.law.kappa_squared, state.law.polynomial, *state.seeds),
        BlockPixels(state.charge, state.threshold, state.fired, state.activity, state.crossing),
        BlockFrames(now.number, now.shape[1], spikes),
    )
    pieces = pieces_of_work(*now.shape, feedback)
    run_in_threads(advance, work, pieces, spikes.size, threads)
    if having("read_out", effects):
        fired = spikes.view(np.bool_).reshape(-1, *now.shape)
        spikes[:] = drive.read_out(now, effects, state.memory, fired).reshape(spikes.shape)


def _mean(parts: Sequence[_Part]) -> Floats:
    """Charge of the light law (count, P) [thresholds], or (1, P) in steady light."""
    light = parts[0].light
    if light.steady:
        return light.level[None] / GRAINS
    mean = np.empty((sum(p.count for p in parts), light.level.size))
    done = 0
    for p in parts:
        ramp_charge(p.light.level, p.light.curve, p.light.rest, p.first, mean[done : done + p.count])
        done += p.count
    return mean


def _rise(parts: Sequence[_Part]) -> Floats:
    """Rise of that charge within a frame, as `_mean`."""
    if parts[0].light.steady:
        return np.zeros((1, parts[0].light.level.size))
    return np.repeat([p.light.rise / GRAINS for p in parts], [p.count for p in parts], axis=0)


def _pixels(charge: Charge) -> Floats:
    return np.ascontiguousarray(charge.pixels).reshape(len(charge.pixels), -1)


def _rows(factor: Floats | float, now: ExposureBlock) -> Floats:
    return _plain(np.broadcast_to(factor, (now.frames, now.shape[0], 1))[:, :, 0])


def _plain(values: Floats) -> Floats:
    """The values in C order and writeable: numba compiles `advance` anew for a read-only array."""
    return np.require(values, requirements=("C", "W"))


def _sum(feedbacks: Sequence[Feedback]) -> Feedback:
    """One law of several, as the loop takes it: losses, kicks and droops add, shares kept multiply; floats all.

    Its kick at once is in grains, on their grid.
    """
    root = rate = kick = left = droop = at_once = 0.0
    kept = left_tau = 1.0
    for one in feedbacks:
        root, rate, kept = root + one.lost_per_root_rate, rate + one.lost_per_rate, kept * one.kept
        kick, droop, at_once = kick + one.kick, droop + one.droop, at_once + one.kick_at_once
        left, left_tau = left + one.left, one.left_tau if one.left else left_tau
    at_once = on_grid(at_once * GRAINS) if at_once else 0.0
    return Feedback(*map(float, (root, rate, kept, kick, left, left_tau, droop, at_once)))
