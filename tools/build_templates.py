"""The shipped templates: the effect of each candidate on the statistics of the standard design, by simulation.

    python -m tools.build_templates out/templates                                 all of them, into the package
    python -m tools.build_templates out/templates --rebuild crosstalk dead_time   these; all others as they are shipped
    python -m tools.build_templates out/templates --only dead_time                into the folder alone

A template is one small file in the folder, named by the effect's law too.  Files in the folder are kept, so that a
stopped build goes on.  Weak ones and severe ones: see `screen/templates.py`.  Shipped templates belong to a law and a
null model; after a change of the null model all have to be rebuilt.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import tyro
from tqdm import tqdm

from spikecam_env.errors import InputError, unknown_name
from spikecam_env.gap.fit.simulated_templates import template_parameters
from spikecam_env.gap.fit.standard_case import standard_case
from spikecam_env.gap.fit.standard_templates import Standard, entries_of, is_lacking, templates_on
from spikecam_env.gap.screen import templates as screened
from spikecam_env.gap.screen.templates import SEVERE, Template, Templates, save_templates, shipped_templates
from spikecam_env.sensor import CATALOGUE
from spikecam_env.sensor.effect_law import law_digest
from spikecam_env.untrusted import Declared, Name, declared, numbers, parse_json, read_arrays
from spikecam_env.whole import check_file, made_folder, whole_file

SHIPPED = Path(screened.__file__).with_name(screened.FILE)

SAME_NOISE = 1e-3
"""Relative difference of the null model's noise that another machine's rounding leaves, at most: 5e-5 was seen.  Twins
of another law differ by some per cent."""


def build(folder: Path, standard: Standard, names: Sequence[str]) -> Templates:
    """Simulate the templates of candidates on the standard case; one file each in `folder`."""
    entries: list[Template] = []
    total = sum(len(template_parameters(name)) * (1 + len(SEVERE)) for name in names)
    with tqdm(total=total, desc="templates", unit="template") as bar:
        for name in names:
            law = law_digest(CATALOGUE[name])[:8]
            kept = lambda label, make, law=law: _kept(folder / f"{label}-{law}.npz", make)  # noqa: E731
            for entry in entries_of(standard, name, kept):
                entries.append(entry)
                bar.update()
    return templates_on(standard, entries, names)


def merged(shipped: Templates, made: Templates) -> Templates:
    """The shipped templates with those of some candidates made anew.

    Raises:
        InputError: the null model has changed, so that the shipped templates do not belong beside these.
    """
    new, gone = set(made.keys) - set(shipped.keys), set(shipped.keys) - set(made.keys)
    if made.keys != shipped.keys:
        raise InputError(f"statistics have changed ({len(new)} new, {len(gone)} gone); rebuild all templates")
    off = float(np.abs(made.noise / shipped.noise - 1).max())
    if not off < SAME_NOISE:
        raise InputError(f"the noise of the null model has changed, by {off:.1e} at most; rebuild all templates")
    return shipped.with_those_of([made])


def accepted(shipped: Templates, names: Sequence[str]) -> Templates:
    """The shipped templates, said to be of the present laws of these candidates."""
    here = {entry.name for entry in shipped.entries}
    laws = {name: law_digest(CATALOGUE[name]) for name in names if name in here}
    return Templates(**{**vars(shipped), "laws": {**shipped.laws, **laws}})


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
        about = {key: value for key, value in vars(entry).items() if key != "shift"}
        with whole_file(path) as beside, beside.open("wb") as file:
            np.savez(file, about=json.dumps(about), shift=entry.shift)
    kept = read_arrays(path, ("about", "shift"))
    is_of = declared(_About, parse_json(str(kept["about"]), f"{path}: about"), f"{path}: about")
    return Template(**dict(is_of), shift=numbers(kept["shift"], "shift", str(path)))


def main(
    out: tyro.conf.Positional[Path] = Path("out/templates"),
    only: tuple[str, ...] = (),
    rebuild: tuple[str, ...] = (),
    same_law: tuple[str, ...] = (),
    jobs: int = 1,
) -> None:
    """Simulate every candidate's templates and write them into the package.

    Args:
        out: a folder of one file a template; existing files are kept.
        only: candidates to simulate into the folder; the package's file stays as it is.
        rebuild: candidates to simulate; of all others the package's templates are kept.
        same_law: candidates whose code has changed but not their law: their templates are kept, and taken to be of it.
        jobs: threads, which change no bit.
    """
    for name in (*only, *rebuild, *same_law):
        if name not in CATALOGUE:
            raise unknown_name("candidate", name, CATALOGUE)
    some = rebuild or same_law
    if not only:
        check_file(SHIPPED)
    with made_folder(out, "templates") as folder:
        if some and not only:
            made = accepted(shipped_templates(), same_law)
            made = merged(made, build(folder, standard_case(jobs), rebuild)) if rebuild else made
        else:
            made = build(folder, standard_case(jobs), only or tuple(CATALOGUE))
    if not only:
        save_templates(made, SHIPPED)
    candidates = len({entry.name for entry in made.entries})
    print(f"{len(made.entries)} templates of {candidates} candidates, {len(made.keys)} statistics")
    stale = [] if only else [name for name in CATALOGUE if is_lacking(name, made)]
    if stale:
        print(f"of another law than now: {', '.join(stale)}; give them to --rebuild")


if __name__ == "__main__":
    tyro.cli(main)
