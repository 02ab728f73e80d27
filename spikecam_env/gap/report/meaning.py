"""What a verdict means: the section that opens a page."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from spikecam_env.gap.report.cells import bullets, number, percent, value_in_words
from spikecam_env.gap.report.parameters_off import parameters_off
from spikecam_env.gap.report.quantities import interval, quantity
from spikecam_env.gap.report.reproduce import command_of
from spikecam_env.gap.report.sentence import NO_BOUNDS
from spikecam_env.gap.report.tables import bounds_tables
from spikecam_env.gap.report.words import bare, equation_of, human, meaning_of, parameter_unit, sheet
from spikecam_env.gap.result import Diagnosis, Estimate, NamedEffect, Remainder
from spikecam_env.page import element, table


def meaning_section(d: Diagnosis) -> Iterator[str]:
    """The verdict explained, and what to do with it."""
    yield from _OPENINGS[d.verdict](d)
    if d.verdict != "parameter" and d.parameters:
        yield element("p", "Parameters of the model's own effects are off as well:")
        yield parameters_table(d)


def none_meaning(d: Diagnosis) -> Iterator[str]:
    """Nothing found: upper bounds, or the command that adds them."""
    bounds_follow = "; these are the upper bounds:" if d.bounds or d.not_bounded else "."
    yield element(
        "p",
        "With this unit's own response, dark level and noise fitted, no statistic differs from the model by more than "
        f"chance. Weaker effects may be present{bounds_follow}",
    )
    yield from bounds_tables(d)
    if NO_BOUNDS in d.data:
        yield element("p", "This command adds the upper bounds of weaker effects:")
        yield element("pre", command_of(replace(d, with_bounds=True)))


def named_meaning(d: Diagnosis) -> Iterator[str]:
    """A card an effect."""
    said = f"The model {d.model_name}, fitted to this unit, does not reproduce these recordings."
    if d.statistics:
        before, after = max(abs(s.z) for s in d.statistics), max(abs(s.z_after) for s in d.statistics)
        said += (
            f" With what is named here, the largest of {len(d.statistics)} deviations falls from |z| {before:.1f} "
            f"to {after:.1f}."
        )
    yield element("p", said)
    for effect in d.effects:
        yield from effect_card(effect)
    if d.remainder:
        yield from remainder_card(d.remainder)


def remainder_card(left: Remainder) -> Iterator[str]:
    """The remainder beside the named effects, and how to read it."""
    yield '<div class="do">'
    yield element("h3", "Remainder")
    yield element(
        "p",
        "The named effects explain nearly all of the difference in every group of statistics. The remainder is more "
        "than chance, but small: the law of this camera differs in details from the catalogue's, or a much weaker "
        "effect hides beside it. Parameters may be off by more than their errors; the patched model holds for light "
        "like that of these recordings.",
    )
    rows = [
        ("Largest deviation, in noise", f"{left.noises:.1f} ({human(left.worst)})"),
        ("Share of the sum of squares", percent(left.share)),
        ("Groups of statistics, by share", "; ".join(f"{human(g)} {percent(s)}" for g, s in left.groups.items())),
        ("Recordings, the furthest off first", ", ".join(left.recordings)),
        ("Where", left.where or "no part of the array stands out"),
        ("When", left.when or "no part of the recordings stands out"),
    ]
    yield table(("", ""), rows)
    yield "</div>"


def class_meaning(d: Diagnosis) -> Iterator[str]:
    """The tied effects, and the experiment that separates them."""
    class_ = d.class_ or {}
    yield element(
        "p", "Something is missing from the model, and several effects explain it equally well in these recordings:"
    )
    for name in class_.get("members", ()):
        yield from effect_summary(str(name))
    if class_.get("experiment"):
        yield '<div class="do">'
        yield element("h3", "The experiment that separates them")
        yield element("p", str(class_["experiment"]))
        yield "</div>"
    for effect in d.effects:
        yield from effect_card(effect)


def unknown_meaning(d: Diagnosis) -> Iterator[str]:
    """The structure of the discrepancy."""
    about = d.unknown or {}
    one = "no single candidate" if "not_looked_for" in about else "no candidate"
    yield element(
        "p",
        f"The recordings and the model differ by more than chance, and {one} of the catalogue, once fitted, leaves "
        "nothing but noise. The difference has this structure:",
    )
    yield structure_table(about)
    yield element(
        "p",
        "The patched model below makes the gap smaller by an empirical correction. It describes; it claims no physics "
        "and may not hold for light that these recordings do not have.",
        class_="warn",
    )
    for effect in d.effects:
        yield from effect_card(effect)


def parameter_meaning(d: Diagnosis) -> Iterator[str]:
    """Strengths as measured and as the model has them."""
    yield element(
        "p",
        "No effect is missing. An effect of the model has another strength in this camera; the patched model has the "
        "fitted value.",
    )
    yield parameters_table(d)


def data_meaning(d: Diagnosis) -> Iterator[str]:
    """The contradictions."""
    yield element(
        "p",
        "These recordings contradict the labels of their campaign. A comparison with a model would blame the camera "
        "for that. Correct the following and diagnose again:",
    )
    yield bullets(d.data)


_OPENINGS: dict[str, Callable[[Diagnosis], Iterator[str]]] = {
    "none": none_meaning,
    "named": named_meaning,
    "class": class_meaning,
    "unknown": unknown_meaning,
    "parameter": parameter_meaning,
    "data": data_meaning,
}


def effect_card(effect: NamedEffect) -> Iterator[str]:
    """An effect that was found: its law, its size, and its alternatives."""
    yield '<div class="card">'
    yield from effect_summary(effect.name)
    rows = [parameter_row(effect.name, name, e) for name, e in effect.parameters.items()]
    if rows:
        yield table(("parameter", "value ± sd", "90 % interval", "meaning"), rows, numbers=(1, 2), stack=True)
    others = "; ".join(f"{human(n)} {percent(c) if c > 1e-3 else 'below 0.1 %'}" for n, c in effect.alternatives)
    family = f"Family: {human(effect.family)}. Confidence in the name: {percent(effect.confidence)}."
    yield element("p", family + (f" Alternatives: {others}." if others else ""))
    yield "</div>"


def effect_summary(name: str) -> Iterator[str]:
    """An effect as the catalogue describes it."""
    found = sheet(name)
    if not found:
        yield element("h3", human(name).capitalize())
    else:
        title, _, said = found.summary.partition(": ")
        yield element("h3", title)
        yield element("p", said[:1].upper() + said[1:])
        yield element("pre", equation_of(name))
        if "Seen in" in found.sections:
            yield element("p", f"Seen in: {found.sections['Seen in']}")


def parameter_row(effect: str, name: str, e: Estimate) -> tuple[str, ...]:
    """Name, value with error, 90 % interval, meaning."""
    unit = parameter_unit(effect, name)
    return bare(effect, name), quantity(e.value, unit, e.sd), interval(e, unit), meaning_of(effect, name)


def parameters_table(d: Diagnosis) -> str:
    """A row a number that is off: as measured, and as the model has it."""
    rows = [
        (f"{r.name}: {r.parameter}", quantity(r.measured, r.unit), quantity(r.nominal, r.unit), number(r.ratio),
         r.meaning)
        for r in parameters_off(d.parameters, d.patched.circuit)
    ]  # fmt: skip
    return table(("parameter", "measured", "in the model", "ratio", "meaning"), rows, numbers=(1, 2, 3), stack=True)


def structure_table(unknown: dict[str, Any]) -> str:
    """`unknown` of diagnosis.json, in words."""
    rows = [(_STRUCTURE.get(key, human(key)), _in_words(key, value)) for key, value in unknown.items()]
    return table(("", ""), rows)


def _in_words(key: str, value: Any) -> str:
    if key == "groups":
        return ", ".join(f"{human(group)} {percent(share)}" for group, share in value.items())
    if key == "left":
        return percent(value)
    if key == "best_candidate" and value:
        return human(value)
    return value_in_words(value)


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
    "not_looked_for": "Not searched for",
    "effort": "--effort that includes it",
    "worst_group": "Group of statistics that is off most",
    "groups": "Share of the deviation, by group of statistics",
    "patch": "Content of the patched model",
    "left": "Remaining share of the mean square",
    "found": "Effects that help",
    "worst": "Largest remaining deviations, in noise",
}
