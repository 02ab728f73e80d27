"""Templates: the change of the statistics bank that each candidate makes, to screen by.

A template is a direction, in noise, at a strength that shows clearly.  Statistics are not in proportion where an effect
is severe, so there are others of SEVERE times as much; screening (`screen`) scales the one that fits best.  The shipped
ones are of the standard design, by `python -m tools.build_templates`; `fit/standard_templates.py` simulates others.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spikecam_env.errors import InputError
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.sensor import CATALOGUE
from spikecam_env.types import Floats
from spikecam_env.untrusted import Declared, declared, numbers, parse_json, read_arrays
from spikecam_env.whole import whole_file

SEVERE = (8.0, 50.0)
"""Times as strong as the weakest of its shape that a template is of where an effect is severe."""

FILE = "templates.npz"


@dataclass(frozen=True)
class Template:
    """The change of the statistics by one candidate."""

    name: str
    parameters: dict[str, float]
    shift: Floats
    """(S,) change, in noise, at these parameters."""
    times: float = 1.0
    """The strength, over the weakest of its shape."""
    white: float = 1.0
    """s^2 of the unit, over its refit: a severe noise is first taken for the unit's own."""

    @property
    def shape(self) -> tuple[str, frozenset[Any]]:
        """Name and all parameters but the strength."""
        strength = CATALOGUE[self.name].strength
        return self.name, frozenset((key, value) for key, value in self.parameters.items() if key != strength)


@dataclass(frozen=True)
class Templates:
    """Templates of one design."""

    keys: tuple[StatisticKey, ...]
    """(S,) of the design's statistics."""
    noise: Floats
    """(S,) in which a shift is measured."""
    mean: Floats
    """(S,) mean of the null model, which shifts are from."""
    shape: tuple[int, int]
    """(rows, columns) of its array."""
    frames: dict[str, int]
    """Length of its recordings by name."""
    levels: dict[str, float]
    """Radiance of its recordings by name."""
    kinds: dict[str, str]
    """Kind of its recordings by name."""
    entries: tuple[Template, ...]
    laws: dict[str, str] = field(default_factory=dict)
    """Digests of the effects that were simulated, by name (`sensor/effect_law.py`)."""

    @property
    def weakest(self) -> tuple[Template, ...]:
        """Those whose statistics are in proportion to the strength, and to less."""
        return tuple(e for e in self.entries if e.times == 1.0)

    def with_those_of(self, others: Iterable[Templates]) -> Templates:
        """These, with the effects of others in place of their own, in the order of the catalogue and in this noise; a
        statistic that others lack does not change."""
        laws = {name: law for more in others for name, law in more.laws.items()}
        new = [replace(e, shift=self._in_this_noise(more, e.shift)) for more in others for e in more.entries]
        kept = [e for e in self.entries if e.name not in laws]
        order = {name: i for i, name in enumerate(CATALOGUE)}
        entries = sorted([*kept, *new], key=lambda e: order.get(e.name, len(order)))
        return replace(self, entries=tuple(entries), laws={**self.laws, **laws})

    def _in_this_noise(self, other: Templates, shift: Floats) -> Floats:
        if other.keys == self.keys and np.array_equal(other.noise, self.noise):
            return shift
        change = dict(zip(other.keys, shift * other.noise, strict=True))
        return np.array([change.get(key, 0.0) for key in self.keys]) / self.noise


class _Entry(Declared):
    """A template without its shift."""

    name: str
    parameters: dict[str, float]
    times: float
    white: float


class _About(Declared):
    """The part of a file of templates beside arrays."""

    keys: list[Annotated[list[str], Field(min_length=3, max_length=3)]]
    shape: Annotated[list[Annotated[int, Field(gt=0)]], Field(min_length=2, max_length=2)]
    frames: dict[str, Annotated[int, Field(gt=0)]]
    levels: dict[str, float]
    kinds: dict[str, str]
    laws: dict[str, str]
    entries: list[_Entry]


def shipped_templates() -> Templates:
    """The shipped templates, of the standard design."""
    with resources.as_file(resources.files(__package__) / FILE) as path:
        return read_templates(path)


def read_templates(path: Path) -> Templates:
    """Templates as `save_templates` writes them.

    Raises:
        InputError: for any other file.
    """
    arrays = read_arrays(path, ("about", "shift", "noise", "mean"))
    about = declared(_About, parse_json(str(arrays["about"]), str(path)), str(path))
    shifts = numbers(arrays["shift"], "shift", str(path)).astype(np.float64)
    noise, mean = (numbers(arrays[of], of, str(path)).astype(np.float64) for of in ("noise", "mean"))
    if shifts.shape != (len(about.entries), len(about.keys)) or {noise.shape, mean.shape} != {(len(about.keys),)}:
        sizes = f"shift {shifts.shape}, noise {noise.shape} and mean {mean.shape}"
        raise InputError(f"{path}: {sizes} do not fit its entries and keys")
    entries = (Template(**dict(e), shift=shift) for e, shift in zip(about.entries, shifts, strict=True))
    return Templates(
        tuple(StatisticKey(*k) for k in about.keys),
        noise,
        mean,
        (about.shape[0], about.shape[1]),
        about.frames,
        about.levels,
        about.kinds,
        tuple(entries),
        about.laws,
    )


def save_templates(templates: Templates, path: Path) -> None:
    """Write them whole, as they are when they are `rounded`."""
    about: dict[str, Any] = {
        "keys": templates.keys,
        "shape": templates.shape,
        "frames": templates.frames,
        "levels": templates.levels,
        "kinds": templates.kinds,
        "laws": templates.laws,
        "entries": [{k: v for k, v in vars(e).items() if k != "shift"} for e in templates.entries],
    }
    shift = np.array([_halved(e.shift) for e in templates.entries]).reshape(-1, len(templates.keys))
    noise, mean = (of.astype(np.float32) for of in (templates.noise, templates.mean))
    with whole_file(path) as beside, beside.open("wb") as file:
        np.savez_compressed(file, about=json.dumps(about), shift=shift, noise=noise, mean=mean)


def rounded(templates: Templates) -> Templates:
    """Templates as they are read again: shifts in half precision, noise and mean in single."""
    entries = tuple(replace(e, shift=_halved(e.shift).astype(np.float64)) for e in templates.entries)
    noise, mean = (of.astype(np.float32).astype(np.float64) for of in (templates.noise, templates.mean))
    return replace(templates, noise=noise, mean=mean, entries=entries)


def _halved(shift: Floats) -> NDArray[np.float16]:
    return np.clip(shift, -6e4, 6e4).astype(np.float16)
