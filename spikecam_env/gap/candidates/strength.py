"""A candidate in a model: its parameters within bounds, and strong enough to be seen by few twins."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.sensor.effects.base import build

TARGET_SIZE = 60.0
"""Noises by which a weak linear effect is simulated, within `MOST_EXTRAPOLATED`, and scaled down.  Statistics are in
proportion so far: benchmarks/in_proportion.py of version 0.1.0."""

MOST_EXTRAPOLATED = 4.0
"""Largest factor by which a strength, and the unit under it, are extrapolated at once.  Statistics are in proportion
so far: benchmarks/in_proportion.py of version 0.1.0."""


def with_effect(model: SensorModel, name: str, parameters: Mapping[str, float]) -> SensorModel:
    """The model with a candidate added."""
    return model.with_effect(build(CATALOGUE, name, dict(parameters)))


def bounded(name: str, parameters: Mapping[str, float]) -> dict[str, float]:
    """Parameters within the bounds of their effect, whole where they must be; booleans and texts stay."""
    out: dict[str, float] = {}
    for key, f in CATALOGUE[name].__dataclass_fields__.items():
        if key not in parameters:
            continue
        if isinstance(f.default, (bool, str)):
            out[key] = parameters[key]
            continue
        low, high = f.metadata["bounds"] or (-np.inf, np.inf)
        value = float(np.clip(parameters[key], low, high))
        out[key] = round(value) if isinstance(f.default, int) else value
    return out


def amplified(name: str, parameters: Mapping[str, float], size: float) -> tuple[dict[str, float], float]:
    """A weak effect at a strength that shows by the target size.

    Scaled down again, the scatter of twins is scaled with it: four times as strong is as good as sixteen times as many
    twins.

    Args:
        name: of the effect.
        parameters: at which it shows by `size`.
        size: in noises.

    Returns:
        (parameters, times as strong).
    """
    strength = candidate(name).strength
    linear = candidate(name).is_linear and parameters[strength] != 0
    times = float(np.clip(TARGET_SIZE / max(size, 1e-9), 1.0, MOST_EXTRAPOLATED)) if linear else 1.0
    stronger = bounded(name, {**parameters, strength: parameters[strength] * times})
    return stronger, stronger[strength] / parameters[strength] if times > 1.0 else 1.0
