"""A hidden mechanism: a name, its laws, the parameters it is drawn with, and where it takes hold.

    camera    once a unit: its arrays
    light     once a recording: light on the pixels, key by key (linear optics)
    physics   once a recording: fields of `integrator.Physics`
    bits      once a recording: the reported spikes

Each takes the parameters and a generator of its own.  A recording's generator differs from recording to recording.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tests.hidden_world.integrator import Physics
from tests.hidden_world.light import Light
from tests.hidden_world.unit import Camera

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Parameters: TypeAlias = dict[str, float]
Rng: TypeAlias = np.random.Generator
Bits: TypeAlias = NDArray[np.uint8]
OnCamera: TypeAlias = Callable[[Camera, Parameters, Rng], Camera]
OnLight: TypeAlias = Callable[[Light, tuple[int, int], Parameters], Light]
OnPhysics: TypeAlias = Callable[[Physics, Camera, int, Parameters, Rng], None]
OnBits: TypeAlias = Callable[[Bits, Parameters, Rng], Bits]


@dataclass(frozen=True)
class Law:
    """One form that a mechanism may have.  law: one line.

    shape: draws every parameter but the strength; of a far law without one, that of the near.  source: of a far law,
    where it is from.
    """

    name: str
    law: str
    shape: Callable[[Rng], Parameters] | None = None
    camera: OnCamera | None = None
    light: OnLight | None = None
    physics: OnPhysics | None = None
    bits: OnBits | None = None
    source: str = ""


@dataclass(frozen=True)
class Mechanism(Law):
    """A mechanism by its name in limits.toml.  It is its own near law, `far` are others.  signs: of its strength."""

    far: tuple[Law, ...] = ()
    signs: tuple[float, ...] = (1.0,)

    def by(self, law: str) -> Law:
        """Its near law for "", else the far one of this name; raises KeyError if there is none."""
        return {"": self, **{other.name: other for other in self.far}}[law]

    def drawn(self, law: str, rng: Rng) -> Parameters:
        """Every parameter but the strength, by one of its laws."""
        shape = self.by(law).shape or self.shape
        return shape(rng) if shape else {}


@dataclass(frozen=True)
class Hidden:
    """A mechanism in a camera: its parameters, and where and when it acts.

    times_limit: strength over the detection limit.  rows, columns: pixels it acts in (None: all).  since: share of a
    recording after which it acts.  law: name of a far one, empty for the near.
    """

    name: str
    parameters: Parameters
    times_limit: float
    rows: tuple[int, int] | None = None
    columns: tuple[int, int] | None = None
    since: float = 0.0
    law: str = ""


@dataclass(frozen=True)
class Limit:
    """A mechanism's entry in limits.toml.

    most: as far as a camera that anybody uses would go.  poor: that of a poor one, where it is thousands of limits.
    power: of the strength, by which its sign grows, in noises: 2 of noise beside other noise, 0.5 of rare events.
    """

    parameter: str
    limit: float
    way: str = "more"
    most: float = field(default=float("inf"))
    poor: float = 0.0
    power: float = 1.0

    def strength(self, times: float) -> float:
        """The parameter at so many times the limit."""
        return self.limit / times if self.way == "less" else min(self.limit * times, self.most)

    def louder(self, share: float) -> float:
        """Factor on a strength that shows as well in this share of the data: noise falls by the root of the data."""
        factor = float(share ** (-0.5 / self.power))
        return 1.0 / factor if self.way == "less" else factor

    @property
    def furthest(self) -> float:
        """Strength over the limit beyond which `strength` stays the same."""
        return self.most / self.limit


@cache
def limits() -> dict[str, Limit]:
    """Detection limits by mechanism."""
    with (Path(__file__).parent / "limits.toml").open("rb") as file:
        return {name: Limit(**entry) for name, entry in tomllib.load(file).items()}


def draw(mechanism: Mechanism, times_limit: float, rng: Rng, law: str = "") -> Hidden:
    """The mechanism at a strength by one of its laws, its other parameters drawn."""
    limit = limits()[mechanism.name]
    strength = limit.strength(times_limit) * _sign(mechanism.signs, rng)
    parameters = {limit.parameter: float(strength), **mechanism.drawn(law, rng)}
    return Hidden(mechanism.name, parameters, float(times_limit), law=law)


def with_less_data(hidden: Hidden, share: float) -> Hidden:
    """As many detection limits strong in a share of the data, as far as the mechanism goes."""
    limit = limits()[hidden.name]
    strength = hidden.parameters[limit.parameter]
    most = limit.poor or limit.most
    louder = float(np.copysign(min(abs(strength) * limit.louder(share), max(most, abs(strength))), strength))
    return replace(hidden, parameters={**hidden.parameters, limit.parameter: louder})


def _sign(signs: tuple[float, ...], rng: Rng) -> float:
    """One of them; nothing is drawn where there is one only."""
    return signs[0] if len(signs) == 1 else float(rng.choice(signs))
