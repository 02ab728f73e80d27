"""Figures of committed diagnoses as Markdown between markers: each is read from the files beside the page.

<!-- figures: wall -->
... Markdown that a function of this file makes ...
<!-- end of figures -->
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from spikecam_env.errors import InputError, unknown_name
from spikecam_env.gap.report import table_rows, words
from spikecam_env.gap.report.parameters_off import response_spread
from spikecam_env.gap.report.quantities import quantity, rough, three_digits
from spikecam_env.gap.report.reproduce import command_of
from spikecam_env.gap.report.sentence import gap_line, heading
from spikecam_env.gap.report.words import bare, human, parameter_unit
from spikecam_env.gap.twins.fresh_units import SPREAD_PARAMETERS
from spikecam_env.sensor import CATALOGUE, Effect, SensorModel
from spikecam_env.sensor.unit import Unit
from tools.code_width import commands
from tools.stated_diagnosis import StatedDiagnosis

MADE_BY = "python -m tools.pages"
"""The command that writes pages and blocks."""

_BLOCK = re.compile(r"(?P<first><!-- figures: (?P<name>[^>]*?) -->\n).*?(?P<last><!-- end of figures -->)", re.DOTALL)


def filled(text: str, blocks: Mapping[str, str]) -> str:
    """A document with its blocks written anew.

    Args:
        text: the document.
        blocks: Markdown by name.

    Raises:
        InputError: for a block of another name, and for a marker without its end.
    """
    if text.count("<!-- figures:") != len(_BLOCK.findall(text)):
        raise InputError("a block of figures does not end: `<!-- end of figures -->` is missing")

    def written(found: re.Match[str]) -> str:
        if found["name"] not in blocks:
            raise unknown_name("block of figures", found["name"], blocks)
        return f"{found['first']}\n{blocks[found['name']]}\n\n{found['last']}"

    return _BLOCK.sub(written, text)


def diagnosis_block(s: StatedDiagnosis) -> str:
    """A diagnosis in numbers: verdict, sizes, gap, statistics, candidates, effects that it could not test, notes."""
    code = commands(f"{s.campaign_command}\n{command_of(s.diagnosis)}").strip()
    text = _TEMPLATES.get_template("diagnosis.md.jinja").render(s=s, d=s.diagnosis, commands=code)
    return re.sub(r"\n{3,}", "\n\n", text).strip()


def short_block(s: StatedDiagnosis) -> str:
    """The verdict, how many statistics differ, and the gap: a paragraph."""
    d = s.diagnosis
    compared = table_rows.compared(d) if d.statistics else ""
    gap = gap_line(d.gap) if d.gap else ""
    parts = (f"**{heading(d)}.** {d.sentence}", compared, gap, f"*{s.about}; by {s.version}.*")
    return " ".join(filter(None, parts))


def beside_measured(model: SensorModel) -> table_rows.Rows:
    """Effects of a page's model that the published one has not, beside the same of the preset `measured`."""
    published, measured = (SensorModel.preset(name) for name in ("scsim", "measured"))
    known, others = ({e.name: e.parameters() for e in other.effects} for other in (published, measured))
    return [
        (f"{human(e.name)}: {bare(e.name, key)}", *_two_quantities(e, others.get(e.name), key))
        for e in model.effects
        if e.name not in known
        for key in e.parameters()
        if parameter_unit(e.name, key)
    ]


def ladder_block(made: Mapping[str, Any]) -> str:
    """The rungs of a ladder (docs/ladder.json) beside the model that was simulated."""
    truth = SensorModel.preset(made["truth"])
    climbed = [_rung(r, truth, made["first"], made["statistics"]) for r in made["rungs"]]
    head = ("rung", "gap", "statistics off", f"`{made['truth']}`", "tied with")
    return f"*By {made['version']}. Written by `{MADE_BY}`.*\n\n{table(head, climbed)}"


def ladder_short_block(made: Mapping[str, Any]) -> str:
    """The rungs of a ladder in a sentence."""
    first, *rungs = made["rungs"]
    steps = [f"with {_strength(r)} {three_digits(r['gap'])}" for r in rungs]
    return (
        f"Held-out gap of `{made['first']}` {first['gap']:.2g}; {', '.join(steps)}, where {rungs[-1]['off']} of "
        f"{made['statistics']} statistics are off. *By {made['version']}.*"
    )


def table(head: Sequence[str], lines: Sequence[Sequence[str]], columns: int | None = None) -> str:
    """A table as Markdown, of its first columns; nothing without rows."""
    whole = [head, ("---",) * len(head), *(line[:columns] for line in lines)] if lines else []
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in whole)


def _rung(rung: Mapping[str, Any], truth: SensorModel, first: str, statistics: int) -> tuple[str, ...]:
    gap = three_digits(rung["gap"]) if rung["gap"] < 1e5 else f"{rung['gap']:.1e}"
    if not rung["added"]:
        return f"`{first}`", gap, f"{rung['off']} of {statistics}", "", ""
    also = ", ".join(human(name) for name in rung["also"])
    return f"+ {_strength(rung)}", gap, str(rung["off"]), true_strength(truth, rung["added"]), also


def _strength(rung: Mapping[str, Any]) -> str:
    name = rung["added"]
    key = CATALOGUE[name].strength
    return f"{human(name)} {quantity(rung['parameters'][key], parameter_unit(name, key), rung['sd'])}"


def true_strength(model: SensorModel, name: str) -> str:
    """An effect's strength in a model; in brackets the sum of strengths that recordings show only together."""
    has = {e.name: e.parameters()[CATALOGUE[e.name].strength] for e in model.effects if CATALOGUE[e.name].strength}
    unit = parameter_unit(name, CATALOGUE[name].strength)
    said = rough(has[name], unit) if name in has else "none"
    if name in SPREAD_PARAMETERS["gain"]:
        spreads = {n: v for n, v in has.items() if n in SPREAD_PARAMETERS["gain"]}
        return f"{said} (all spreads of the response {rough(response_spread(spreads, model.circuit), unit)})"
    if name == "shot_noise":
        pixel = noisy_pixel(model)
        noise = float(1.0 / pixel.electrons[0] + pixel.kappa[0] ** 2)
        return f"{said} (with the noise of the reset {rough(1.0 / noise, unit)})"
    return said


def noisy_pixel(model: SensorModel) -> Unit:
    """The nominal pixel of a model, without its spreads."""
    spreads = [e.name for e in model.effects if e.name in SPREAD_PARAMETERS["gain"]]
    return reduce(SensorModel.without, spreads, model).draw_unit((1, 1), 0)


def _two_quantities(effect: Effect, other: Mapping[str, Any] | None, key: str) -> tuple[str, str]:
    unit = parameter_unit(effect.name, key)
    return quantity(effect.parameters()[key], unit), "none" if other is None else quantity(other[key], unit)


_TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parent), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
)  # not escaped: Markdown of our own figures
_TEMPLATES.filters["human"] = human
_TEMPLATES.globals.update(MADE_BY=MADE_BY, beside_measured=beside_measured, gap_line=gap_line, heading=heading,
                          rows=table_rows, table=table, words=words)  # fmt: skip
