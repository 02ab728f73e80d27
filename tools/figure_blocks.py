"""Figures about committed pages, as Markdown between markers: each is read from the page, none is typed by hand.

<!-- figures: wall -->
... what a function of this file makes of the page ...
<!-- end of figures -->
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from typing import Any

from spikecam_env.errors import InputError, unknown_name
from spikecam_env.gap.report.parameters_off import response_spread
from spikecam_env.gap.report.quantities import quantity, rough, three_digits
from spikecam_env.gap.report.words import bare, human, parameter_unit
from spikecam_env.gap.twins.fresh_units import SPREAD_PARAMETERS
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.sensor.unit import Unit
from spikecam_env.untrusted import parse_toml
from tools.code_width import commands
from tools.page_reading import Page, Part, Table, Text

MADE_BY = "python -m tools.pages"
"""The command that writes pages and blocks."""

_BLOCK = re.compile(r"(?P<first><!-- figures: (?P<name>[^>]*?) -->\n).*?(?P<last><!-- end of figures -->)", re.DOTALL)


def filled(text: str, blocks: Mapping[str, str]) -> str:
    """A document with its blocks written anew.  blocks: Markdown by name.

    Raises InputError for a block of another name, and for a marker without its end.
    """
    if text.count("<!-- figures:") != len(_BLOCK.findall(text)):
        raise InputError("a block of figures does not end: `<!-- end of figures -->` is missing")

    def written(found: re.Match[str]) -> str:
        if found["name"] not in blocks:
            raise unknown_name("block of figures", found["name"], blocks)
        return f"{found['first']}\n{blocks[found['name']]}\n\n{found['last']}"

    return _BLOCK.sub(written, text)


def page_block(page: Page) -> str:
    """All that a page says in numbers: verdict, sizes, gap, statistics, candidates, what could not be tested, notes."""
    return _joined(
        [
            f"*{page.about}; by {page.version}. Written by `{MADE_BY}`.*",
            "<!-- not run: needs the real recordings -->\n" + _fenced(commands(page.texts("reproduce", "pre")[0])),
            f"**{page.verdict}.** {page.sentence}",
            *_sizes(page),
            beside_measured(page),
            *map(markdown, page.sections.get("gap", ())),
            *map(markdown, page.sections.get("statistics", ())),
            *_candidates(page),
            _not_testable(page),
            *(f"Note: {text}." for text in page.texts("audit", "li")),
        ]
    )


def short_block(page: Page) -> str:
    """The verdict, how many statistics differ, and the gap: a paragraph."""
    compared = [text.partition(" z: ")[0] for text in page.texts("statistics", "p")]
    return " ".join(
        [
            f"**{page.verdict}.** {page.sentence}",
            *compared,
            *page.texts("gap", "p"),
            f"*{page.about}; by {page.version}.*",
        ]
    )


def beside_measured(page: Page) -> str:
    """Effects of the page's model that the published one has not, beside the same of the preset `measured`."""
    found = parse_toml("\n".join(page.texts("model", "pre")), "the page's model").get("effect", [])
    published, measured = (SensorModel.preset(name) for name in ("scsim", "measured"))
    known, others = ({e.name: e.parameters() for e in model.effects} for model in (published, measured))
    rows = [
        (f"{human(e['name'])}: {bare(e['name'], key)}", *_two_quantities(e, others.get(e["name"]), key))
        for e in found
        if e["name"] not in known
        for key in e
        if parameter_unit(e["name"], key)
    ]
    if not rows:
        return ""
    table = markdown(Table(("effect of the page's model", "page", "preset `measured`"), tuple(rows)))
    return f"Its model beside the preset `measured`, which `tools.fit_measured` fits to the same recordings:\n\n{table}"


def ladder_block(made: Mapping[str, Any]) -> str:
    """The rungs of a ladder (docs/ladder.json) beside the model that was simulated."""
    truth = SensorModel.preset(made["truth"])
    rows = [_rung(r, truth, made["first"], made["statistics"]) for r in made["rungs"]]
    table = Table(("rung", "gap", "statistics off", f"`{made['truth']}`", "tied with"), tuple(rows))
    return _joined([f"*By {made['version']}. Written by `{MADE_BY}`.*", markdown(table)])


def ladder_short_block(made: Mapping[str, Any]) -> str:
    """The rungs of a ladder in a sentence."""
    first, *rungs = made["rungs"]
    steps = [f"with {_strength(r)} {three_digits(r['gap'])}" for r in rungs]
    return (
        f"Held-out gap of `{made['first']}` {first['gap']:.2g}; {', '.join(steps)}, where {rungs[-1]['off']} of "
        f"{made['statistics']} statistics are off. *By {made['version']}.*"
    )


def markdown(part: Part) -> str:
    """A part of a page as Markdown."""
    if isinstance(part, Text):
        forms = {"h3": f"*{part.text}*", "pre": _fenced(part.text), "li": f"- {part.text}"}
        return forms.get(part.tag, part.text)
    head = part.head if any(part.head) else ("",) * len(part.rows[0])
    lines = [head, ("---",) * len(head), *part.rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines)


def _sizes(page: Page) -> Iterator[str]:
    """What the verdict means: sizes of effects and parameters, an experiment, what an unknown difference looks like.

    Of text the headings, with the paragraph below each, and lists.
    """
    above: Part = Text("", "")
    for part in page.sections["meaning"]:
        if isinstance(part, Table):
            yield markdown(part.without("meaning"))
        elif part.tag in ("h3", "li") or (isinstance(above, Text) and above.tag == "h3" and part.tag == "p"):
            yield markdown(part)
        above = part


def _candidates(page: Page) -> Iterator[str]:
    """Steps of the search, without the explanation."""
    for part in page.sections.get("candidates", ()):
        if isinstance(part, Table) or part.tag != "p":
            yield markdown(part)


def _not_testable(page: Page) -> str:
    names = [row[0] for table in page.tables("not-testable") for row in table.rows]
    return f"Not testable with these recordings ({len(names)}): {', '.join(names)}." if names else ""


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
    """An effect's strength in a model; in brackets, of what recordings tell as one number, all of it together."""
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


def _two_quantities(effect: Mapping[str, Any], other: Mapping[str, Any] | None, key: str) -> tuple[str, str]:
    unit = parameter_unit(effect["name"], key)
    return quantity(effect[key], unit), "none" if other is None else quantity(other[key], unit)


def _fenced(code: str) -> str:
    return f"```\n{code.strip()}\n```"


def _joined(parts: Sequence[str]) -> str:
    return "\n\n".join(filter(None, parts))
