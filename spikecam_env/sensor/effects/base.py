"""What an effect is: a named deviation from the ideal pixel, with parameters, applied in physical order.

An effect is a frozen dataclass in a file of its own; it overrides the hooks that it needs and no others.
Once a camera:

    imprint      the fixed pattern, on the array in circuit units
    image        what optics do to a picture: linear, and the same at all times
    begin        what the effect remembers from frame to frame; by default a random generator of its own

and then every frame, in this order; of one hook, by stage (optics, photodiode, integration, threshold, reset, read-out)
and, within a stage, by name:

    collect      charge of the frame, from light and in the dark, before shot noise
    compare      what the comparator compares with
    after_reset  charge left on the pixels that fired
    spiked       charge of all pixels, when it is known which fired
    read_out     bits reported

Frame hooks are functions of their arguments: they change no array in place, and return the memory for the next frame.
Every strength has a neutral value at which each hook returns exactly what it was given, so that no bit changes.
An effect with `imprint` and `image` alone costs nothing a frame and is carried by every engine.
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
Spikes = NDArray[np.bool_]


class Stage(IntEnum):
    """Where in the pixel an effect acts; the order is the order of application."""

    OPTICS = 1
    PHOTODIODE = 2
    INTEGRATION = 3
    THRESHOLD = 4
    RESET = 5
    READOUT = 6


@dataclasses.dataclass(frozen=True)
class Exposure:
    """One frame of one camera: what a hook may know.

    number: absolute, from 0.  shape: (rows, columns).  unit: the firing law of every pixel.
    """

    number: int
    frame_rate_hz: float
    shape: tuple[int, int]
    unit: Unit

    @property
    def middle_s(self) -> float:
        """Time of the middle of the frame [s]."""
        return (self.number + 0.5) / self.frame_rate_hz

    def share_of_swing(self, voltage_mV: float) -> Array:
        """A voltage at the comparator as a share of each pixel's swing (H, W), that is, as charge in thresholds."""
        return (1e-3 * voltage_mV / self.unit.swing_V).reshape(self.shape)

    def charge_of(self, current_pA: float) -> Array:
        """Charge (H, W) that a current brings in a frame [thresholds]."""
        return (current_pA * 1e3 / self.frame_rate_hz / self.unit.threshold_fC).reshape(self.shape)


def parameter(default: Any, *, unit: str, bounds: tuple[float, float] | None = None, doc: str) -> Any:
    """Declare a parameter of an effect: its default, unit, allowed range and meaning."""
    return dataclasses.field(default=default, metadata={"unit": unit, "bounds": bounds, "doc": doc})


@dataclasses.dataclass(frozen=True)
class Effect:
    """Base of all effects; every hook here does nothing.  Arrays are (H, W); charge is in thresholds of each pixel.

    strength: the parameter that says how strong the effect is.  neutral: its value at which no bit changes.
    """

    stage: ClassVar[Stage]
    name: ClassVar[str] = "effect"
    strength: ClassVar[str]
    neutral: ClassVar[float] = 0.0

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
            if isinstance(f.default, int) and not number.is_integer():
                raise InputError(f"{self.name}.{f.name} = {value!r} must be a whole number")

    @classmethod
    def neutralised(cls) -> Effect:
        """This effect at the strength that changes no bit."""
        return cls(**{cls.strength: cls.neutral})

    @classmethod
    def overrides(cls, hook: str) -> bool:
        """Whether this effect has a hook of its own of that name."""
        return getattr(cls, hook) is not getattr(Effect, hook)

    @classmethod
    def is_fixed(cls) -> bool:
        """Whether this effect does nothing from frame to frame, so that every engine carries it."""
        return not any(cls.overrides(hook) for hook in FRAME_HOOKS)

    def parameters(self) -> dict[str, Any]:
        """Parameter values by name."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        """Leave the fixed pattern (and constant strengths) on the array."""
        return pixels

    def image(self, radiance: NDArray[np.float32]) -> NDArray[np.float32]:
        """The picture (H, W) that reaches the pixels; linear in `radiance`."""
        return radiance

    def begin(self, first: Exposure, rng: np.random.Generator) -> Any:
        """What the effect remembers at frame 0; picklable.  `rng` is this effect's alone."""
        return rng

    def collect(self, light: Array, dark: Array, now: Exposure, memory: Any) -> tuple[Array, Array, Any]:
        """Charge expected in this frame from light (at most two thresholds) and in the dark, and the memory."""
        return light, dark, memory

    def compare(self, threshold: Array, now: Exposure, memory: Any) -> tuple[Array, Any]:
        """What the comparator compares the charge with in this frame, and the memory."""
        return threshold, memory

    def after_reset(self, residual: Array, rate: Array, now: Exposure) -> Array:
        """Charge left on the pixels that fired (n,), given what is over their threshold and their charge a frame."""
        return residual

    def spiked(self, charge: Array, spikes: Spikes, rate: Array, now: Exposure, memory: Any) -> tuple[Array, Any]:
        """Charge at the end of the frame, given who fired in it and the charge a frame, and the memory."""
        return charge, memory

    def read_out(self, spikes: Spikes, now: Exposure, memory: Any) -> tuple[Spikes, Any]:
        """The bits reported, and the memory."""
        return spikes, memory


FRAME_HOOKS = ("begin", "collect", "compare", "after_reset", "spiked", "read_out")


def neighbour_sum(values: Array) -> Array:
    """Sum over each pixel's four neighbours (H, W); beyond the edge there is nothing."""
    total = np.zeros_like(values)
    total[1:] += values[:-1]
    total[:-1] += values[1:]
    total[:, 1:] += values[:, :-1]
    total[:, :-1] += values[:, 1:]
    return total


def build(catalogue: dict[str, type[Effect]], name: str, parameters: dict[str, Any]) -> Effect:
    """Make an effect from its name and parameters; raises InputError for a name or parameter that is not there."""
    if name not in catalogue:
        raise unknown_name("effect", name, catalogue)
    allowed = {f.name for f in dataclasses.fields(catalogue[name])}
    for key in parameters:
        if key not in allowed:
            raise unknown_name(f"parameter of {name}", key, allowed)
    return catalogue[name](**parameters)
