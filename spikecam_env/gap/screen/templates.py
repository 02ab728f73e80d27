"""What each candidate does to the statistics bank, simulated beforehand on the standard design: to screen by.

    python -m spikecam_env.gap.screen.templates          rebuilds them (resumable)

A template is a direction, in noise, at a strength that shows clearly; as statistics bend where an effect is severe,
there are others of TIMES as much.  Screening (`screen`) scales the one that suits best to what was measured.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import resources
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from numpy.typing import NDArray
from tqdm import tqdm

from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.campaign.design import standard_design
from spikecam_env.gap.candidates.strength import bounded, with_effect
from spikecam_env.gap.candidates.table import CANDIDATES, NOISE_OF_A_RESET, candidate
from spikecam_env.gap.compare.prediction import Null, values_of
from spikecam_env.gap.fit.gauss_newton import at_settled_unit
from spikecam_env.gap.fit.predict import predict_by_twins, with_drawn_pattern
from spikecam_env.gap.statistics import Key
from spikecam_env.gap.twins.case import Case, case_of, twins
from spikecam_env.gap.twins.simulate import simulate
from spikecam_env.gap.unit.refit import unit_as_base, within
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.untrusted import Declared, Name, declared, numbers, parse_json, read_arrays
from spikecam_env.whole import whole_file

Array = NDArray[np.float64]

SHAPE, FRAMES, SEED = (64, 64), 8000, 20
MODEL = "scsim"
PEAK = 40.0
"""Templates are taken where the statistic of recordings to fit that shows the effect best is this many noises off."""

TIMES = (8.0, 50.0)
"""Times as strong that severe effects are simulated."""

REFITTED = 3
"""Twins that say what a model without the effect gives, refitted to a severe one."""

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


def load() -> Templates:
    """The shipped templates."""
    with resources.as_file(resources.files(__package__) / FILE) as path, np.load(path) as file:
        about = json.loads(str(file["about"]))
        shifts, noise = file["shift"].astype(np.float64), file["noise"].astype(np.float64)
    entries = tuple(Template(**e, shift=s) for e, s in zip(about["entries"], shifts, strict=True))
    return Templates(tuple(Key(*k) for k in about["keys"]), noise, about["levels"], about["kinds"], entries)


def build(folder: Path, *, jobs: int = 1, only: Sequence[str] | None = None) -> Templates:
    """Simulate every template; one small file an entry in `folder`, so that a build that was stopped goes on."""
    folder.mkdir(parents=True, exist_ok=True)
    case, model, null = standard_case(jobs)
    entries = []
    todo = [(n, p) for n in CATALOGUE if n in (only or CATALOGUE) for p in starts(n)]
    for name, parameters in tqdm(todo, "templates", unit="template"):
        label = "-".join([name, *(f"{k}={v:g}" for k, v in parameters.items() if k != CATALOGUE[name].strength)])
        weak = _kept(folder / f"{label}.npz", partial(simulated, case, model, null, name, parameters))
        entries.append(weak)
        strength = CATALOGUE[name].strength
        for times in TIMES:
            stronger = bounded(name, {**weak.parameters, strength: times * weak.parameters[strength]})
            if stronger != entries[-1].parameters:
                path = folder / f"{label}-x{times:g}.npz"
                entries.append(_kept(path, partial(severe, case, model, null, name, stronger, times)))
    levels = {c.name: c.level for c in case.conditions}
    kinds = {c.name: c.kind for c in case.conditions}
    return Templates(null.keys, null.noise, levels, kinds, tuple(entries))


def _kept(path: Path, make: Callable[[], Template]) -> Template:
    """The template in a file, made and written if there is none."""
    if not path.exists():
        entry = make()
        with whole_file(path) as beside, beside.open("wb") as file:
            np.savez(file, about=json.dumps(_about(entry)), shift=entry.shift)
    made = read_arrays(path, ("about", "shift"))
    about = declared(_About, parse_json(str(made["about"]), f"{path}: about"), f"{path}: about")
    return Template(about.name, about.parameters, numbers(made["shift"], "shift", str(path)), about.times, about.white)


class _About(Declared):
    """A template's file, but for its `shift`."""

    name: Name
    parameters: dict[str, float]
    times: float
    white: float


def _about(entry: Template) -> dict[str, Any]:
    return {"name": entry.name, "parameters": entry.parameters, "times": entry.times, "white": entry.white}


def save(templates: Templates, path: Path) -> None:
    """Write them whole, in half precision."""
    about: dict[str, Any] = {
        "keys": templates.keys,
        "levels": templates.levels,
        "kinds": templates.kinds,
        "entries": [_about(e) for e in templates.entries],
    }
    shift = np.clip([e.shift for e in templates.entries], -6e4, 6e4).astype(np.float16)
    with whole_file(path) as beside, beside.open("wb") as file:
        np.savez_compressed(file, about=json.dumps(about), shift=shift, noise=templates.noise.astype(np.float32))


def standard_case(
    jobs: int = 1, seed: int = SEED, count: int = 12, preset: str = MODEL
) -> tuple[Case, SensorModel, Null]:
    """A unit of a preset in the standard design, as a measurement, and what its model predicts."""
    from spikecam_env.gap.observe.conditions import planned

    model = SensorModel.preset(preset)
    conditions = planned(standard_design(), SHAPE, FRAMES)
    unit = model.draw_unit(SHAPE, seed)
    base = unit_as_base(unit)
    case = case_of(SHAPE, conditions, simulate(model, base, conditions, SHAPE, seed), seed, jobs)
    return case, model, model_null(case, model, count)


def starts(name: str) -> list[dict[str, float]]:
    """Parameters to take templates at: the default strength, every combination of shapes."""
    if name in NOISE_OF_A_RESET:
        return []
    shapes = candidate(name).shapes
    default = {CATALOGUE[name].strength: CATALOGUE[name]().parameters()[CATALOGUE[name].strength]}
    extra = {k: CATALOGUE[name]().parameters()[k] for k in candidate(name).fitted}
    return [{**extra, **default, **dict(zip(shapes, values, strict=True))} for values in product(*shapes.values())]


def simulated(case: Case, model: SensorModel, null: Null, name: str, parameters: Mapping[str, float]) -> Template:
    """A candidate's template on a campaign, at a strength where it shows clearly."""
    strength = CATALOGUE[name].strength
    power = candidate(name).power
    to_fit = case.to_fit(null.keys)
    now = bounded(name, parameters)
    shift = _shift(case, model, null, name, now)
    for _ in range(4):
        peak = float(np.abs(shift[to_fit]).max())
        if 0.5 * PEAK < peak < 2.5 * PEAK:
            break
        factor = np.clip((PEAK / max(peak - 3.0, 0.3)) ** (1 / power), 1e-3, 30.0)
        then = bounded(name, {**now, strength: now[strength] * factor})
        if then == now:
            break
        now = then
        shift = _shift(case, model, null, name, now)
    return Template(name, now, shift)


def severe(
    case: Case, model: SensorModel, null: Null, name: str, parameters: Mapping[str, float], times: float
) -> Template:
    """A candidate's template where the unit's own refit is led astray: its campaign as if it were a measurement."""
    there = with_effect(model, name, parameters)
    if candidate(name).is_pattern:
        return Template(name, dict(parameters), _shift(case, model, null, name, parameters), times)
    seed = case.seed * 1000 + 7
    made = simulate(there, within(there, case.base), case.conditions, case.shape, seed)
    seen = case.of(case.conditions, made)
    without = twins(seen, model, within(model, seen.base), range(REFITTED))
    mean = np.mean([values_of(t.bank, null.keys) for t in without], axis=0)
    shift = np.nan_to_num((values_of(seen.bank, null.keys) - mean) / null.noise)
    of_pattern = np.array([k.group == "pattern" for k in null.keys])
    white = float(min(case.base.white / seen.base.white, 1.0))
    return Template(name, dict(parameters), np.where(of_pattern, 0.0, shift), times, white)


def _shift(
    case: Case,
    model: SensorModel,
    null: Null,
    name: str,
    parameters: Mapping[str, float],
) -> Array:
    """(S,) change of the statistics, in noise, that a candidate makes: by units drawn, or by a twin whose unit has
    settled, since a refit takes up what bends rates, and saturation would show a unit too bright by as much."""
    there = with_effect(model, name, parameters)
    if candidate(name).is_pattern:
        made = with_drawn_pattern(case, there, null, null.prediction)
    else:
        probe = partial(predict_by_twins, case, null=null, count=1)
        made, _ = at_settled_unit(probe, null, there, within(there, case.base), [])
    return np.nan_to_num((made.mean - null.mean) / null.noise)


def rebuild(out: tyro.conf.Positional[Path] = Path("out/templates")) -> None:
    """Simulate every candidate's template; those in the folder `out` are kept."""
    made = build(out)
    save(made, Path(__file__).with_name(FILE))
    print(f"{len(made.entries)} templates of {len(CANDIDATES)} candidates, {len(made.keys)} statistics")


if __name__ == "__main__":
    tyro.cli(rebuild)
