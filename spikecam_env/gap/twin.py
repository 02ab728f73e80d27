"""The twin: the fitted unit simulated under a model, through the same conditions, and observed the same way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.observe import Observation, observe
from spikecam_env.gap.refit import BaseFit, unit_of
from spikecam_env.gap.world import Shown
from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor, Unit
from spikecam_env.streams import pack_frames

_BLOCK = 1024


def simulate(
    model: SensorModel,
    base: BaseFit,
    conditions: Sequence[Shown],
    shape: tuple[int, int],
    seed: int,
    takes: Sequence[int] | None = None,
) -> list[Observation]:
    """One simulated campaign of the unit `base` under `model`; another seed is other temporal noise and phases.

    takes: number of each recording, by default in order; the same number and seed give the same draws.
    """
    unit = unit_of(model, base, shape)
    return [
        observe(expose(model, unit, c, shape, seed, take), shape, film=c.moves)
        for take, c in zip(takes or range(len(conditions)), conditions, strict=True)
    ]


def expose(
    model: SensorModel, unit: Unit, condition: Shown, shape: tuple[int, int], seed: int, take: int
) -> NDArray[np.uint8]:
    """(F, P/8) bits of one recording in known light."""
    sensor = SpikeSensor(at_any_phase(model, seed, take), shape, seed, engine="auto", take=take, unit=unit)
    light = condition.light
    assert light is not None
    picture: Keyframes | NDArray[np.float32] = light.radiance[0] if not condition.moves else light
    parts = []
    for first in range(0, condition.frames, _BLOCK):
        parts.append(pack_frames(sensor.step(picture, min(_BLOCK, condition.frames - first))))
    return np.concatenate(parts)


def at_any_phase(model: SensorModel, seed: int, take: int) -> SensorModel:
    """The model with its waves at phases drawn for one recording: nobody starts a recording by the mains."""
    rng = np.random.default_rng([seed, take])
    for effect in model.effects:
        if "phase_cycles" in effect.parameters():
            model = model.with_effect(replace(effect, phase_cycles=float(rng.random())))  # type: ignore[call-arg]
    return model
