"""The report of a diagnosis: one HTML file for an engineer who did not write it.

From the answer to its reasons: the verdict in a sentence, what it means, the gap before and after, the evidence,
candidates, what could not be tested, the patched model, and how to make the page again.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from spikecam_env.gap.report import plots
from spikecam_env.gap.report.evidence import Maps, shape_of
from spikecam_env.gap.report.exhibits import LOUD, Exhibit, by_loudness, exhibits
from spikecam_env.gap.report.words import (
    CONFIDENCE,
    VERDICTS,
    at_most,
    bare,
    bounded_parameter,
    gap_line,
    human,
    law,
    meaning_of,
    quantity,
    sheet,
    sizes,
    unit_of,
)
from spikecam_env.gap.result import Diagnosis, Estimate, NamedEffect
from spikecam_env.gap.twins.budget import CAMPAIGNS
from spikecam_env.page import captioned, element, page, picture, table
from spikecam_env.sensor import CATALOGUE
from spikecam_env.version import __version__
from spikecam_env.whole import write_text_whole


def write_report(diagnosis: Diagnosis, path: str | Path) -> None:
    """Write the page; it appears whole.  Needs nothing beside it."""
    write_text_whole(path, report(diagnosis))


def report(diagnosis: Diagnosis) -> str:
    """The whole page."""
    d = diagnosis
    sections = [(anchor, title, list(make(d))) for anchor, title, make in _SECTIONS]
    present = [(anchor, title, parts) for anchor, title, parts in sections if parts]
    links = " · ".join(f'<a href="#{anchor}">{element("span", title)}</a>' for anchor, title, _ in present)
    parts = [
        f'<header class="verdict {d.verdict}">',
        element("p", VERDICTS[d.verdict], class_="badge"),
        element("h1", d.sentence),
        element("p", _subject(d), class_="subject"),
        "</header>",
        f"<nav>{links}</nav>",
    ]
    for anchor, title, inside in present:
        parts += [f'<section id="{anchor}">', element("h2", title), *inside, "</section>"]
    return page(f"Diagnosis of {Path(d.campaign).name}", parts, _STYLE)


def _subject(d: Diagnosis) -> str:
    said = f"Recordings of {Path(d.campaign).name} against the model {d.model_name}"
    shape = shape_of(d.evidence) if d.evidence else None
    if d.evidence and shape:
        shown = d.evidence.conditions
        held = sum(c.use == "holdout" for c in shown)
        said += (
            f": {shape[0]} × {shape[1]} pixels at {d.patched.frame_rate_hz:g} Hz, {len(shown)} recordings, "
            f"{held} of them held out"
        )
    return f"{said}. {sum(d.stages.values()):.0f} s, spikecam-env {__version__}."


# --- what it means


def _meaning(d: Diagnosis) -> Iterator[str]:
    yield from _OPENINGS[d.verdict](d)
    if d.verdict != "parameter" and d.parameters:
        yield element("p", "Parameters of effects that the model has, off as well:")
        yield _parameters_off(d)


def _opening_none(d: Diagnosis) -> Iterator[str]:
    yield element(
        "p",
        "After this unit's own response, dark level and noise were fitted, no statistic of the bank differs from the "
        "model by more than chance explains. Effects may still be there, below what these recordings can show:",
    )
    yield from _bounds_tables(d)


def _opening_named(d: Diagnosis) -> Iterator[str]:
    said = f"The model {d.model_name}, fitted to this unit, does not make these recordings."
    if d.statistics:
        before, after = max(abs(s.z) for s in d.statistics), max(abs(s.z_after) for s in d.statistics)
        said += (
            f" With what is named here, the largest of {len(d.statistics)} deviations falls from |z| {before:.1f} "
            f"to {after:.1f}."
        )
    yield element("p", said)
    for effect in d.effects:
        yield from _effect_card(effect)


def _opening_class(d: Diagnosis) -> Iterator[str]:
    class_ = d.class_ or {}
    yield element(
        "p", "Something is missing from the model, and several effects explain it equally well in these recordings:"
    )
    for name in class_.get("members", ()):
        yield from _effect_summary(str(name))
    if class_.get("experiment"):
        yield '<div class="do">'
        yield element("h3", "The experiment that would tell")
        yield element("p", str(class_["experiment"]))
        yield "</div>"
    for effect in d.effects:
        yield from _effect_card(effect)


def _opening_unknown(d: Diagnosis) -> Iterator[str]:
    about = d.unknown or {}
    one = "no single candidate" if "not_looked_for" in about else "no candidate"
    yield element(
        "p",
        f"The recordings and the model differ by more than chance, and {one} of the catalogue leaves the noise "
        "alone once it is fitted. What the difference looks like:",
    )
    yield _structure_table(about)
    yield element(
        "p",
        "The patched model below makes the gap smaller by an empirical correction. It describes; it claims no physics "
        "and may not hold for light that these recordings do not have.",
        class_="warn",
    )
    for effect in d.effects:
        yield from _effect_card(effect)


def _opening_parameter(d: Diagnosis) -> Iterator[str]:
    yield element(
        "p",
        "No effect is missing. An effect that the model has is there with another strength; the patched model has the "
        "fitted value.",
    )
    yield _parameters_off(d)


def _opening_data(d: Diagnosis) -> Iterator[str]:
    yield element(
        "p",
        "These recordings disagree with what their campaign says of them, so a comparison with a model would blame the "
        "camera for it. Correct the following and diagnose again:",
    )
    yield _list(d.data)


_OPENINGS: dict[str, Callable[[Diagnosis], Iterator[str]]] = {
    "none": _opening_none,
    "named": _opening_named,
    "class": _opening_class,
    "unknown": _opening_unknown,
    "parameter": _opening_parameter,
    "data": _opening_data,
}


def _effect_card(effect: NamedEffect) -> Iterator[str]:
    yield '<div class="card">'
    yield from _effect_summary(effect.name)
    rows = [_parameter_row(effect.name, name, e) for name, e in effect.parameters.items()]
    if rows:
        yield table(("parameter", "value ± sd", "90 % interval", "meaning"), rows, numbers=(1, 2), stack=True)
    others = "; ".join(f"{human(n)} {_percent(c) if c > 1e-3 else 'below 0.1 %'}" for n, c in effect.alternatives)
    told = f"Family: {human(effect.family)}. Confidence in the name: {_percent(effect.confidence)}."
    yield element("p", told + (f" Instead of it: {others}." if others else ""))
    yield "</div>"


def _effect_summary(name: str) -> Iterator[str]:
    found = sheet(name)
    if not found:
        yield element("h3", human(name).capitalize())
    else:
        title, _, said = found.summary.partition(": ")
        yield element("h3", title)
        yield element("p", said[:1].upper() + said[1:])
        yield element("pre", law(name))
        if "Seen in" in found.sections:
            yield element("p", f"Seen in: {found.sections['Seen in']}")


def _parameter_row(effect: str, name: str, e: Estimate) -> tuple[str, ...]:
    unit = unit_of(effect, name)
    half = CONFIDENCE * e.sd
    interval = f"{quantity(e.value - half, unit)} … {quantity(e.value + half, unit)}" if half > 0 else "–"
    return bare(effect, name), quantity(e.value, unit, e.sd), interval, meaning_of(effect, name)


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.01 else f"{100 * share:.1g} %"


def _parameters_off(d: Diagnosis) -> str:
    """One row an effect: its strength as measured, and as the model has it."""
    rows = []
    for name, row in d.parameters.items():
        key = CATALOGUE[name].strength
        what, unit = f"{human(name)}: {bare(name, key)}", unit_of(name, key)
        values = (quantity(row["measured"], unit), quantity(row["nominal"], unit))
        rows.append((what, *values, _number(row["ratio"]), meaning_of(name, key)))
    return table(("parameter", "measured", "in the model", "ratio", "meaning"), rows, numbers=(1, 2, 3), stack=True)


def _structure_table(unknown: dict[str, Any]) -> str:
    rows = [(_STRUCTURE.get(key, human(key)), _value(value)) for key, value in unknown.items()]
    return table(("", ""), rows)


_STRUCTURE = {
    "light": "Light or dark",
    "level_exponent": "Grows with the level to the power of",
    "extent": "Local or common",
    "time_scale_s": "Time scale [s]",
    "time_scale_us": "Time scale [us]",
    "time_scale_frames": "Time scale [frames]",
    "history": "Depends on earlier spikes",
    "neighbours": "Depends on neighbours",
    "clock": "Differs where intervals are whole numbers of frames",
    "where": "Where",
    "when": "When",
    "best_candidate": "Nearest candidate",
    "not_looked_for": "Not looked for",
    "effort": "--effort that looks for it",
    "worst_group": "Statistics that are off most",
    "groups": "Share of what is off, by statistics",
    "patch": "What the patched model holds",
}


def _value(value: Any) -> str:
    if value is None:
        return "not seen"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, dict):
        return "; ".join(f"{human(str(k))} {_value(v)}" for k, v in value.items())
    if isinstance(value, (list, tuple, set)):
        return ", ".join(_value(v) for v in value)
    return _number(value)


def _number(value: Any) -> str:
    if isinstance(value, (float, np.floating)):
        number = float(value)
        return f"{number:.4g}" if abs(number) < 1e4 else f"{number:,.0f}".replace(",", "\u202f")
    return "–" if value is None else str(value)


def _bounds_tables(d: Diagnosis) -> Iterator[str]:
    """Bounds of what shows too little to be found, and below them what these recordings put no bound to."""
    rows = [(human(b.name), bounded_parameter(b), f"< {at_most(b)}") for b in d.bounds]
    if rows:
        yield table(("effect", "parameter", "at most (95 %)"), rows, numbers=(2,), stack=True)
    if d.not_bounded:
        yield element("p", "Not bounded by these data; the right column would bound it:")
        yield table(("effect", "needs"), [(human(name), needs) for name, needs in d.not_bounded], stack=True)


# --- the gap


def _gap(d: Diagnosis) -> Iterator[str]:
    if d.gap is None:
        return
    yield element("p", gap_line(d.gap))
    caption = (
        "Mean square distance of statistics from the model, in units of their noise. Orange: model as given; "
        "blue: patched; grey: floor, "
        + ("chance." if d.gap.floor == 1.0 else "two halves of the measurement, or the patterns of two units.")
    )
    use = {c.name: c.use for c in d.evidence.conditions} if d.evidence else {}
    held = [name for name in d.gap.by_recording if use.get(name, "holdout") == "holdout"]
    drawn = picture(plots.gap_bars(d.gap, held), "Gap by recording")
    yield f'<div class="single">{captioned(drawn, caption)}</div>'
    rows = [
        (name, use.get(name, ""), *(_number(row.get(key)) for key in ("before", "after", "floor")))
        for name, row in d.gap.by_recording.items()
    ]
    rows.append(("all held out", "", *map(_number, (d.gap.before, d.gap.after, d.gap.floor))))
    yield table(("recording", "use", "before", "after", "floor"), rows, numbers=(2, 3, 4))


# --- evidence


def _evidence(d: Diagnosis) -> Iterator[str]:
    if d.evidence is None:
        return
    loud, quiet = by_loudness(exhibits(d.evidence, d.patched.frame_rate_hz), d.statistics)
    yield _legend(after=d.evidence.after is not None)
    if not loud:
        yield element("p", f"Nowhere do measured and model differ by {LOUD:g} standard deviations. What was looked at:")
        loud, quiet = quiet[:3], quiet[3:]
    for exhibit in loud:
        yield from _exhibit(exhibit, d)
    if quiet:
        also = f"Also looked at, largest |z| below {LOUD:g}: " + ", ".join(e.title.lower() for e in quiet)
        yield f"<details>{element('summary', also)}"
        for exhibit in quiet:
            yield from _exhibit(exhibit, d)
        yield "</details>"


def _legend(*, after: bool) -> str:
    keys = [("measured", "●", "measured"), ("before", "■", "model before"), ("after", "▲", "model after"),
            ("band", "▮", "noise: two standard errors of measured less before")]  # fmt: skip
    shown = [
        f'<span class="key"><span class="{c}">{mark}</span> {text}</span>'
        for c, mark, text in keys
        if after or c != "after"
    ]
    return f'<p class="legend">{" ".join(shown)}</p>'


def _exhibit(exhibit: Exhibit, d: Diagnosis) -> Iterator[str]:
    yield f'<div class="exhibit" id="exhibit-{exhibit.name}">'
    yield element("h3", f"{exhibit.title} (largest |z| {exhibit.z(d.statistics):.1f})")
    yield element("p", exhibit.caption, class_="caption")
    yield '<div class="plots">'
    for panel in exhibit.panels:
        yield picture(plots.panel(panel), f"{panel.title}: measured, model before and after")
    yield "</div>"
    for maps in exhibit.maps:
        yield from _maps(maps)
    yield "</div>"


def _maps(maps: Maps) -> Iterator[str]:
    limits = plots.map_limits(maps.measured)
    yield element("p", f"{maps.title}:", class_="caption")
    yield '<div class="maps">'
    for name, values in (("measured", maps.measured), ("model before", maps.before), ("model after", maps.after)):
        if values is not None:
            yield picture(plots.pixel_map(values, name, limits), f"{maps.title}, {name}")
    yield "</div>"


# --- bank, candidates, what was not tested


def _bank(d: Diagnosis) -> Iterator[str]:
    if not d.statistics:
        return
    found = sorted((s for s in d.statistics if s.p_adjusted < 0.05), key=lambda s: -abs(s.z))
    yield element(
        "p",
        f"{len(d.statistics)} statistics were compared, {len(found)} of them differ from the model as given (p < 0.05 "
        "after correction for their number). z: measured less model, in standard deviations of one campaign.",
    )
    patched = any(s.after != s.before for s in d.statistics)
    caption = "Every statistic by group. Orange squares: model before; "
    caption += ("blue triangles: after. " if patched else "") + "Grey: within 3."
    yield f'<div class="single">{captioned(picture(plots.strip(d.statistics), "z by group"), caption)}</div>'
    rows = [
        (s.name, ", ".join(s.recordings), _number(s.measured), _number(s.before), _number(s.after), _signed(s.z),
         _signed(s.z_after))
        for s in found[:15]
    ]  # fmt: skip
    if rows:
        head = ("statistic", "recordings", "measured", "before", "after", "z before", "z after")
        title = "The largest differences" + (f" ({len(rows)} of {len(found)})" if len(found) > len(rows) else "")
        yield element("h3", title)
        yield table(head, rows, numbers=range(2, 7), optional=range(2, 5))


def _signed(z: float) -> str:
    return f"{z:+.1f}".replace("-", "−")


def _candidates(d: Diagnosis) -> Iterator[str]:
    if not d.ranking:
        return
    yield element(
        "p",
        "Each candidate was fitted with the unit's own parameters free. Misfit: how far what it leaves is from noise; "
        "the smaller the better. The gate simulates the fitted model anew and looks at its worst group.",
    )
    rows = [
        (human(r.name), _number(r.misfit_before), _number(r.misfit), sizes(r.parameters, r.name),
         ": ".join(filter(None, ("accepted" if r.accepted else "rejected", r.reason))))
        for r in d.ranking
    ]  # fmt: skip
    classes = ["accepted" if r.accepted else "" for r in d.ranking]
    yield table(
        ("candidate", "misfit before", "misfit", "best fit", "outcome"),
        rows,
        numbers=(1, 2),
        classes=classes,
        stack=True,
    )


def _bounds(d: Diagnosis) -> Iterator[str]:
    if d.bounds and d.verdict != "none":
        yield element("p", "Effects that were looked for and not found are smaller than:")
        yield from _bounds_tables(d)


def _untested(d: Diagnosis) -> Iterator[str]:
    if d.not_testable:
        yield element("p", "These recordings say nothing about the following; the right column would make it testable.")
        yield table(("effect", "needs"), [(human(name), needs) for name, needs in d.not_testable])


def _audit(d: Diagnosis) -> Iterator[str]:
    if d.data and d.verdict != "data":
        yield _list(d.data)


def _list(lines: Sequence[str]) -> str:
    return f"<ul>{''.join(element('li', line) for line in lines)}</ul>"


# --- the model, and the page again


def _model(d: Diagnosis) -> Iterator[str]:
    added = "The model as it was given" if d.verdict in ("none", "data") else "The model with what was found"
    yield element("p", f"{added}: model.toml beside this page. It loads wherever a model is asked for.")
    yield element("pre", d.patched.toml().strip())


def _reproduce(d: Diagnosis) -> Iterator[str]:
    yield element("pre", command_of(d))
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("numpy", "scipy", "numba", "matplotlib"))
    yield element(
        "p",
        f"Seed {d.seed}: the same seed gives the same result. spikecam-env {__version__}, Python "
        f"{platform.python_version()}, {versions}.",
    )
    rows = [(name, f"{seconds:.1f}") for name, seconds in d.stages.items()]
    yield table(("stage", "seconds"), [*rows, ("all", f"{sum(d.stages.values()):.1f}")], numbers=(1,))
    if d.simulated:
        yield element("p", f"{d.simulated} recordings were simulated to find this.")


def command_of(d: Diagnosis) -> str:
    """The command that makes this diagnosis again."""
    words = ["spikecam diagnose", d.campaign, f"--model {d.model_name}", "--out DIR", f"--seed {d.seed}"]
    if d.candidates is not None:
        words.append(f"--candidates {' '.join(d.candidates)}")
    if d.exclude:
        words.append(f"--exclude {' '.join(d.exclude)}")
    if d.effort != CAMPAIGNS:
        words.append(f"--effort {d.effort:g}")
    return " ".join(words)


_SECTIONS: tuple[tuple[str, str, Callable[[Diagnosis], Iterator[str]]], ...] = (
    ("meaning", "What it means", _meaning),
    ("gap", "The gap, before and after", _gap),
    ("evidence", "Evidence", _evidence),
    ("statistics", "All statistics", _bank),
    ("candidates", "Candidates", _candidates),
    ("bounds", "Upper bounds", _bounds),
    ("not-testable", "What could not be tested", _untested),
    ("audit", "Notes on the data", _audit),
    ("model", "The model", _model),
    ("reproduce", "How to reproduce this page", _reproduce),
)

_STYLE = f"""
body {{ max-width: 1240px }}
header.verdict {{ border-left: 6px solid #888; padding: .2em 0 .2em 1em; margin-bottom: 1em }}
header.none {{ border-color: #009E73 }} header.named {{ border-color: #0072B2 }}
header.class, header.parameter {{ border-color: #56B4E9 }}
header.unknown {{ border-color: #CC79A7 }} header.data {{ border-color: #E69F00 }}
.badge {{ text-transform: uppercase; letter-spacing: .06em; font-size: .8em; font-weight: 600; color: #555; margin: 0 }}
h1 {{ margin: .2em 0; max-width: 46em }} .subject {{ color: #555; margin: .3em 0 }}
p, ul, .card, .do {{ max-width: 60em }}
nav {{ font-size: .9em; color: #777; margin: 1em 0 }} a {{ color: #0059a3 }}
.card, .do {{ border: 1px solid #ddd; border-radius: 6px; padding: .2em 1.2em .6em; margin: 1em 0 }}
.do {{ background: #eef6fb; border-color: #bcdcf0 }}
.caption, .legend {{ color: #444 }} .legend {{ font-size: .95em }}
.key {{ display: inline-block; margin-right: 1em }}
.measured {{ color: {plots.MEASURED} }} .before {{ color: {plots.BEFORE} }} .after {{ color: {plots.AFTER} }}
.band {{ color: #bbb }}
.plots {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 380px), 1fr)); gap: 1em;
          align-items: start }}
.maps {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 165px), 1fr)); gap: .5em }}
.plots img, .maps img, .single img {{ width: 100%; height: auto; display: block }}
.single {{ max-width: 540px }} .maps {{ max-width: 900px }}
tr.accepted td {{ background: #eef6fb }} td:last-child, th:last-child {{ padding-right: 0 }}
summary {{ cursor: pointer; color: #0059a3; margin: 1em 0 }}
pre {{ white-space: pre-wrap; overflow-wrap: anywhere }}
section {{ scroll-margin-top: 1em }}
@media (max-width: 600px) {{ body {{ margin: 1em auto; padding: 0 .8em }} h1 {{ font-size: 1.25em }}
  .card, .do {{ padding: .1em .8em .5em }} .wide table {{ font-size: .92em }} }}
@media print {{ nav {{ display: none }} .exhibit {{ break-inside: avoid }} }}
"""
