"""The twin: the fitted unit simulated under a model, through the same conditions, and observed the same way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.observe.conditions import LABEL_ERROR, Condition
from spikecam_env.gap.observe.observation import ObservedRecording, observe
from spikecam_env.gap.unit.conversion import unit_from_refit
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor, Unit
from spikecam_env.sensor.light import GRAINS
from spikecam_env.streams import pack_frames

_BLOCK_FRAMES = 1024

FIRST_SEED = 17
"""Seed of a campaign's first twin; the others' follow."""


def simulate(
    model: SensorModel,
    base: BaseFit,
    conditions: Sequence[Condition],
    shape: tuple[int, int],
    seed: int,
    takes: Sequence[int] | None = None,
) -> list[ObservedRecording]:
    """One simulated campaign.

    Args:
        model: its effects.
        base: the unit.
        conditions: of the recordings.
        shape: (rows, columns).
        seed: of temporal noise and phases.
        takes: number of each recording, by default in order; the same number and seed give the same draws.
    """
    unit = unit_from_refit(model, base, shape)
    return [
        observe(
            expose(model, with_label_error(unit, seed, take), c, shape, seed, take),
            shape,
            film=c.moves,
            static=c.static,
        )
        for take, c in zip(takes or range(len(conditions)), conditions, strict=True)
    ]


def expose(
    model: SensorModel, unit: Unit, condition: Condition, shape: tuple[int, int], seed: int, take: int
) -> NDArray[np.uint8]:
    """(F, P/8) bits of one recording in known light."""
    # an edge inside a frame is off in that one alone: a search goes on
    sensor = SpikeSensor(
        with_random_phases(model, seed, take),
        shape,
        seed,
        engine="auto",
        take=take,
        unit=unit,
        threads=1,
        bent_light="allow",
    )
    light = condition.light
    assert light is not None
    picture: Keyframes | NDArray[np.float32] = light.radiance[0] if not condition.moves else light
    spikes = np.empty((min(_BLOCK_FRAMES, condition.frames), *shape), np.uint8)
    parts = []
    for first in range(0, condition.frames, _BLOCK_FRAMES):
        frames = min(_BLOCK_FRAMES, condition.frames - first)
        parts.append(pack_frames(sensor.step(picture, frames, out=spikes[:frames])))
    return np.concatenate(parts)


def with_label_error(unit: Unit, seed: int, take: int) -> Unit:
    """A unit of identical pixels with its light and dark level drawn within their errors, for one recording.

    Light is known to LABEL_ERROR, dark to half a grain.  Where all pixels fire at one rate and without noise, the beat
    with the read-out's clock shows 1e-5 of the rate: the rounding of the dark level, since the sensor counts charge in
    whole grains, and errors of labels.  Drawn, it is no law.

    Args:
        unit: any; one whose pixels differ stays as it is.
        seed: of the campaign.
        take: number of the recording.
    """
    if np.ptp(unit.gain) > 0:
        return unit
    rng = np.random.default_rng([seed, take, 4])
    grains = rng.uniform(-0.5, 0.5) if unit.dark.min() >= 1.0 / GRAINS else 0.0
    return replace(unit, gain=unit.gain * (1.0 + LABEL_ERROR * rng.standard_normal()), dark=unit.dark + grains / GRAINS)


def with_random_phases(model: SensorModel, seed: int, take: int) -> SensorModel:
    """The model with its waves at phases drawn for one recording: nobody starts a recording by the mains.

    Those of successive seeds are spread over the wave, two on opposite sides and four at right angles: of so few that
    were drawn at random, all may be the same, and their scatter nothing.

    Args:
        model: with or without waves.
        seed: of the campaign.
        take: number of the recording.
    """
    rng = np.random.default_rng(take)
    spread = int(f"{max(seed - FIRST_SEED, 0):064b}"[::-1], 2) / 2**64  # van der Corput's sequence
    for effect in model.effects:
        if "phase_cycles" in effect.parameters():
            phase = (float(rng.random()) + spread) % 1.0
            model = model.with_effect(replace(effect, phase_cycles=phase))  # type: ignore[call-arg]
    return model
