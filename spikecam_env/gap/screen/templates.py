"""Templates: the change of the statistics bank that each candidate makes, to screen by.

A template is a direction, in noise, at a strength that shows clearly.  Statistics are not in proportion where an effect
is severe, so there are others of SEVERE times as much; screening (`screen`) scales the one that fits best.  The shipped
ones are of the standard design, by `python -m tools.build_templates`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.statistics import Key
from spikecam_env.sensor import CATALOGUE
from spikecam_env.whole import whole_file

Array = NDArray[np.float64]

SEVERE = (8.0, 50.0)
"""Times as strong as the weakest of its shape that a template is of where an effect is severe."""

FILE = "templates.npz"


@dataclass(frozen=True)
class Template:
    """parameters: at which `shift` (S,), in noise, was simulated.  times: the strength, over the weakest of its shape.

    white: s^2 of the unit, over what it is refitted as: a severe noise is first taken for the unit's own.
    """

    name: str
    parameters: dict[str, float]
    shift: Array
    times: float = 1.0
    white: float = 1.0

    @property
    def shape(self) -> tuple[str, frozenset[Any]]:
        """Name and all parameters but the strength."""
        strength = CATALOGUE[self.name].strength
        return self.name, frozenset((key, value) for key, value in self.parameters.items() if key != strength)


@dataclass(frozen=True)
class Templates:
    """keys: (S,) of the standard design's statistics; noise: (S,) theirs, of which `shift` is so many.

    levels: radiance of its recordings by name; kinds: of them.
    """

    keys: tuple[Key, ...]
    noise: Array
    levels: dict[str, float]
    kinds: dict[str, str]
    entries: tuple[Template, ...]

    @property
    def weakest(self) -> tuple[Template, ...]:
        """Those whose statistics are in proportion to the strength, and to less."""
        return tuple(e for e in self.entries if e.times == 1.0)


def shipped_templates() -> Templates:
    """The shipped templates, of the standard design."""
    with resources.as_file(resources.files(__package__) / FILE) as path, np.load(path) as file:
        about = json.loads(str(file["about"]))
        shifts, noise = file["shift"].astype(np.float64), file["noise"].astype(np.float64)
    entries = tuple(Template(**e, shift=s) for e, s in zip(about["entries"], shifts, strict=True))
    return Templates(tuple(Key(*k) for k in about["keys"]), noise, about["levels"], about["kinds"], entries)


def save_templates(templates: Templates, path: Path) -> None:
    """Write them whole, as `shipped_templates` reads them: shifts in half precision."""
    about: dict[str, Any] = {
        "keys": templates.keys,
        "levels": templates.levels,
        "kinds": templates.kinds,
        "entries": [about_template(e) for e in templates.entries],
    }
    shift = np.clip([e.shift for e in templates.entries], -6e4, 6e4).astype(np.float16)
    with whole_file(path) as beside, beside.open("wb") as file:
        np.savez_compressed(file, about=json.dumps(about), shift=shift, noise=templates.noise.astype(np.float32))


def about_template(entry: Template) -> dict[str, Any]:
    """A template as JSON has it, but for its `shift`."""
    return {"name": entry.name, "parameters": entry.parameters, "times": entry.times, "white": entry.white}
