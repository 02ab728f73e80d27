"""The shipped templates: what each candidate does to the statistics of the standard design, by simulation.

    python -m tools.build_templates out/templates                      all of them, into the package; resumable
    python -m tools.build_templates out/templates --only dead_time     into the folder alone

A template is one small file in the folder, and what is there is kept: a build that was stopped goes on, and a new
effect's are added to those of the others.  Weak ones and severe ones: see `screen/templates.py`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import tyro
from tqdm import tqdm

from spikecam_env.errors import unknown_name
from spikecam_env.gap.candidates.strength import bounded, with_effect
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.prediction import Null, values_of
from spikecam_env.gap.fit.simulated_templates import simulated_shift, simulated_template, template_parameters
from spikecam_env.gap.screen import templates as screened
from spikecam_env.gap.screen.templates import SEVERE, Template, Templates, about_template, save_templates
from spikecam_env.gap.twins.case import Case, twins
from spikecam_env.gap.twins.simulate import simulate
from spikecam_env.gap.unit.refit import constrained_refit
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.untrusted import Declared, Name, declared, numbers, parse_json, read_arrays
from spikecam_env.whole import check_file, made_folder, whole_file
from tools.standard_case import standard_case

SHIPPED = Path(screened.__file__).with_name(screened.FILE)

REFITTED = 3
"""Twins that say what a model without the effect gives, refitted to a severe one."""


def build(folder: Path, *, jobs: int = 1, only: Sequence[str] = ()) -> Templates:
    """Simulate the templates of all candidates, or of those in `only`; one file each in `folder`.

    Errors: InputError for a name that is not in the catalogue.
    """
    for name in only:
        if name not in CATALOGUE:
            raise unknown_name("candidate", name, CATALOGUE)
    case, model, null = standard_case(jobs)
    entries = []
    todo = [(n, p) for n in CATALOGUE if n in (only or CATALOGUE) for p in template_parameters(n)]
    for name, parameters in tqdm(todo, "templates", unit="template"):
        label = "-".join([name, *(f"{k}={v:g}" for k, v in parameters.items() if k != CATALOGUE[name].strength)])
        weak = _kept(folder / f"{label}.npz", partial(simulated_template, case, model, null, name, parameters))
        entries.append(weak)
        strength = CATALOGUE[name].strength
        for times in SEVERE:
            stronger = bounded(name, {**weak.parameters, strength: times * weak.parameters[strength]})
            if stronger != entries[-1].parameters:
                path = folder / f"{label}-x{times:g}.npz"
                entries.append(_kept(path, partial(severe_template, case, model, null, name, stronger, times)))
    levels = {c.name: c.level for c in case.conditions}
    kinds = {c.name: c.kind for c in case.conditions}
    return Templates(null.keys, null.noise, levels, kinds, tuple(entries))


def severe_template(
    case: Case, model: SensorModel, null: Null, name: str, parameters: Mapping[str, float], times: float
) -> Template:
    """A candidate's template where the unit's own refit is biased: its campaign as if it were a measurement."""
    there = with_effect(model, name, parameters)
    if candidate(name).is_pattern:
        return Template(name, dict(parameters), simulated_shift(case, model, null, name, parameters), times)
    seed = case.seed * 1000 + 7
    made = simulate(there, constrained_refit(there, case.base), case.conditions, case.shape, seed)
    seen = case.of(case.conditions, made)
    without = twins(seen, model, constrained_refit(model, seen.base), range(REFITTED))
    mean = np.mean([values_of(t.bank, null.keys) for t in without], axis=0)
    shift = np.nan_to_num((values_of(seen.bank, null.keys) - mean) / null.noise)
    of_pattern = np.array([k.group == "pattern" for k in null.keys])
    white = float(min(case.base.white / seen.base.white, 1.0))
    return Template(name, dict(parameters), np.where(of_pattern, 0.0, shift), times, white)


class _About(Declared):
    """A template's file, but for its `shift`."""

    name: Name
    parameters: dict[str, float]
    times: float
    white: float


def _kept(path: Path, make: Callable[[], Template]) -> Template:
    """The template in a file, made and written if there is none."""
    if not path.exists():
        entry = make()
        with whole_file(path) as beside, beside.open("wb") as file:
            np.savez(file, about=json.dumps(about_template(entry)), shift=entry.shift)
    made = read_arrays(path, ("about", "shift"))
    about = declared(_About, parse_json(str(made["about"]), f"{path}: about"), f"{path}: about")
    return Template(about.name, about.parameters, numbers(made["shift"], "shift", str(path)), about.times, about.white)


def main(out: tyro.conf.Positional[Path] = Path("out/templates"), only: tuple[str, ...] = (), jobs: int = 1) -> None:
    """Simulate every candidate's templates and write them into the package.

    Args:
        out: a folder of one file a template; what is there is kept.
        only: candidates to simulate into the folder; the package's file stays as it is.
        jobs: threads, which change no bit.
    """
    with made_folder(out, "templates") as folder:
        if only:
            made = build(folder, jobs=jobs, only=only)
        else:
            check_file(SHIPPED)
            made = build(folder, jobs=jobs)
            save_templates(made, SHIPPED)
    names = {entry.name for entry in made.entries}
    print(f"{len(made.entries)} templates of {len(names)} candidates, {len(made.keys)} statistics")


if __name__ == "__main__":
    tyro.cli(main)
