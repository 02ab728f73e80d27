"""What an effect is: a named deviation from the ideal pixel, with parameters, applied in physical order.

An effect is a frozen dataclass in a file of its own; it overrides the hooks of its stage and nothing else.
The model applies effects by stage: optics, photodiode, integration, threshold, reset, read-out.
"""

from __future__ import annotations

import dataclasses
import math
import re
from enum import IntEnum
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError, unknown_name
from spikecam_env.sensor.unit import PixelArray, Unit

Array = NDArray[np.float64]


class Stage(IntEnum):
    """Where in the pixel an effect acts; the order is the order of application."""

    OPTICS = 1
    PHOTODIODE = 2
    INTEGRATION = 3
    THRESHOLD = 4
    RESET = 5
    READOUT = 6


def parameter(default: Any, *, unit: str, bounds: tuple[float, float] | None = None, doc: str) -> Any:
    """Declare a parameter of an effect: its default, unit, allowed range and meaning."""
    return dataclasses.field(default=default, metadata={"unit": unit, "bounds": bounds, "doc": doc})


@dataclasses.dataclass(frozen=True)
class Effect:
    """Base of all effects.  Every hook here does nothing; hooks after `imprint` get (H*W,) float64."""

    stage: ClassVar[Stage]
    name: ClassVar[str] = "effect"

    def __init_subclass__(cls) -> None:
        cls.name = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", cls.__name__).lower()

    def __post_init__(self) -> None:
        for f in dataclasses.fields(self):
            value, bounds = getattr(self, f.name), f.metadata["bounds"]
            if bounds is None:
                continue
            try:
                number = float(value)
            except (TypeError, ValueError):
                number = math.nan
            if not bounds[0] <= number <= bounds[1]:
                raise InputError(
                    f"{self.name}.{f.name} = {value!r} is outside {bounds[0]:g} .. {bounds[1]:g} {f.metadata['unit']}"
                )

    def parameters(self) -> dict[str, Any]:
        """Parameter values by name."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        """Any stage: leave the fixed pattern (and constant strengths) on the array, once a camera."""
        return pixels

    def frame_threshold(self, threshold: Array, unit: Unit, rng: np.random.Generator) -> Array:
        """Threshold: what the comparator compares with in this frame [thresholds]."""
        return threshold

    def after_reset(self, residual: Array, rate: Array, frame_rate_hz: float) -> Array:
        """Reset: charge left after a reset, given the charge over threshold and the rate a frame [thresholds]."""
        return residual


def build(catalogue: dict[str, type[Effect]], name: str, parameters: dict[str, Any]) -> Effect:
    """Make an effect from its name and parameters; raises InputError for a name or parameter that is not there."""
    if name not in catalogue:
        raise unknown_name("effect", name, catalogue)
    allowed = {f.name for f in dataclasses.fields(catalogue[name])}
    for key in parameters:
        if key not in allowed:
            raise unknown_name(f"parameter of {name}", key, allowed)
    return catalogue[name](**parameters)
