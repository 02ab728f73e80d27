"""Templates of the standard case: shipped, kept in the user's cache folder, or simulated when they are first needed.

A candidate without a shipped template, such as a user's own effect, or one whose law is another than the shipped
template's, is simulated on the standard case: the same camera, recordings and seeds whatever is being diagnosed.  So
an answer does not depend on the cache.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

from tqdm import tqdm

from spikecam_env.cache_folder import cache_folder
from spikecam_env.campaign.design import standard_design
from spikecam_env.errors import InputError
from spikecam_env.gap.candidates.strength import bounded
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.fit import standard_case
from spikecam_env.gap.fit.simulated_templates import bank_of, severe_template, simulated_template, template_parameters
from spikecam_env.gap.screen.templates import (
    SEVERE,
    Template,
    Templates,
    read_templates,
    rounded,
    save_templates,
    shipped_templates,
)
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.twins.workers import sums_in_one_order
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.sensor.effect_law import law_digest
from spikecam_env.version import __version__
from spikecam_env.whole import made_folder

Standard = tuple[Case, SensorModel, Null]
Step = Callable[[str], None]

_IN_MEMORY: dict[str, Templates] = {}
"""By key, where there is no folder to keep them in; and so that a file is read once a process."""


def templates_of(names: Sequence[str], *, jobs: int = 1, progress: bool = False) -> Templates:
    """The shipped templates, with those of candidates in `names` that have none of their present law.

    Args:
        jobs: threads, which change no bit.
        progress: show a bar where something has to be simulated.
    """
    shipped = shipped_templates()
    lacking = {name: key_of(name) for name in names if is_lacking(name, shipped)}
    new = [name for name, key in lacking.items() if _kept(key, name) is None]
    for name, made in simulated_of(new, jobs=jobs, progress=progress):
        _keep(made, lacking[name])
    return shipped.with_those_of([_IN_MEMORY[key] for key in lacking.values()])


def is_lacking(name: str, shipped: Templates) -> bool:
    """Whether a candidate that is screened by templates has none, or one of another law than it is now."""
    return bool(template_parameters(name)) and shipped.laws.get(name) != law_digest(CATALOGUE[name])


@sums_in_one_order
def simulated_of(names: Sequence[str], *, jobs: int = 1, progress: bool = False) -> list[tuple[str, Templates]]:
    """Templates of each, weak and severe, simulated on the standard case."""
    if not names:
        return []
    steps = 1 + sum(len(template_parameters(name)) * (1 + len(SEVERE)) for name in names)
    with tqdm(total=steps, desc="templates", unit="template", disable=not progress) as bar:
        standard = standard_case.standard_case(jobs)
        bar.update()
        made = []
        for name in names:
            bar.set_description(f"templates of {name}")
            entries = []
            for entry in entries_of(standard, name):
                entries.append(entry)
                bar.update()
            made.append((name, templates_on(standard, entries, (name,))))
    return made


def entries_of(
    standard: Standard, name: str, kept: Callable[[str, Callable[[], Template]], Template] = lambda label, make: make()
) -> Iterator[Template]:
    """A candidate's templates: of each shape a weak one, then severe ones, as far as its bounds let it be stronger.

    Args:
        standard: the standard case.
        kept: called with the label of each and the function that makes it; returns the template.
    """
    strength = CATALOGUE[name].strength
    for start in template_parameters(name):
        label = "-".join([name, *(f"{k}={v:g}" for k, v in start.items() if k != strength)])
        last = weak = kept(label, partial(simulated_template, *standard, name, start))
        yield weak
        for times in SEVERE:
            stronger = bounded(name, {**weak.parameters, strength: times * weak.parameters[strength]})
            if stronger == last.parameters:
                continue
            last = kept(f"{label}-x{times:g}", partial(severe_template, *standard, name, stronger, times))
            yield last


def templates_on(standard: Standard, entries: Sequence[Template], names: Sequence[str]) -> Templates:
    """Entries that were simulated on the standard case as a bank, with the present laws of the candidates."""
    case, _, null = standard
    return bank_of(case, null, entries, {c.name: c.kind for c in case.conditions}, names)


def key_of(name: str) -> str:
    """A digest of a candidate's law, the standard camera, its recordings and the version: the key of its templates."""
    depends = (
        law_digest(CATALOGUE[name]),
        SensorModel.preset(standard_case.MODEL).toml(),
        repr(standard_design()),
        (standard_case.SHAPE, standard_case.FRAMES, standard_case.SEED),
        __version__,
    )
    return hashlib.sha256(json.dumps(depends).encode()).hexdigest()


def _kept(key: str, name: str) -> Templates | None:
    """Templates in memory or in the cache; a file that is damaged, or of something else, counts as none."""
    path = _path(key)
    if key not in _IN_MEMORY and path is not None:
        with suppress(InputError):
            stored = read_templates(path)
            if stored.laws == {name: law_digest(CATALOGUE[name])}:
                _IN_MEMORY[key] = stored
    return _IN_MEMORY.get(key)


def _keep(made: Templates, key: str) -> None:
    """Keep templates in memory, and in the cache where it can be written to."""
    _IN_MEMORY[key] = rounded(made)
    path = _path(key)
    if path is not None:
        with suppress(InputError), made_folder(path.parent, "templates"):
            save_templates(made, path)


def _path(key: str) -> Path | None:
    folder = cache_folder("templates")
    return None if folder is None else folder / f"{key[:32]}.npz"
