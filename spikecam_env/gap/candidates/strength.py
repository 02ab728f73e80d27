"""A candidate in a model: its parameters within bounds, and strong enough to be seen by few twins."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from spikecam_env.gap.candidates.table import candidate, is_pattern
from spikecam_env.gap.unit.indirect_inference import MOST_EXTRAPOLATED
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.sensor.effects.base import build

AS_LOUD = 60.0
"""Noises that a weak effect is simulated to show at best, MOST_EXTRAPOLATED times as strong at most.  Scaled down, what
twins scatter by chance is scaled with it: four times as strong is as good as sixteen times as many."""


def with_effect(model: SensorModel, name: str, parameters: Mapping[str, float]) -> SensorModel:
    """The model with a candidate added."""
    return model.with_effect(build(CATALOGUE, name, dict(parameters)))


def bounded(name: str, parameters: Mapping[str, float]) -> dict[str, float]:
    """Parameters within what their effect allows, whole where they must be."""
    out = {}
    for key, f in CATALOGUE[name].__dataclass_fields__.items():
        if key not in parameters:
            continue
        low, high = f.metadata["bounds"] or (-np.inf, np.inf)
        value = float(np.clip(parameters[key], low, high))
        out[key] = round(value) if isinstance(f.default, int) and not isinstance(f.default, bool) else value
    return out


def may_be_negative(name: str) -> bool:
    strength = CATALOGUE[name].strength
    bounds = CATALOGUE[name].__dataclass_fields__[strength].metadata["bounds"]
    return bool(bounds and bounds[0] < 0)


def is_linear(name: str) -> bool:
    """Whether statistics go in proportion to an effect's strength for long: noise goes by its square, and its bands and
    lateness are logarithms, which are not."""
    what = candidate(name)
    return what.power == 1.0 and not (what.mixed or what.wanders or is_pattern(name))


def as_loud(name: str, parameters: Mapping[str, float], size: float) -> tuple[dict[str, float], float]:
    """(parameters, times as much) of an effect that shows by `size` noises: a weak one is made to show by AS_LOUD."""
    strength = candidate(name).fitted[0]
    linear = is_linear(name) and parameters[strength] != 0
    times = float(np.clip(AS_LOUD / max(size, 1e-9), 1.0, MOST_EXTRAPOLATED)) if linear else 1.0
    louder = bounded(name, {**parameters, strength: parameters[strength] * times})
    return louder, louder[strength] / parameters[strength] if times > 1.0 else 1.0
