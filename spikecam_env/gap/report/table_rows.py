"""Rows of a report's tables, as text: HTML lays them out as a page, Markdown in the docs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

from spikecam_env.gap.report.parameters_off import parameters_off
from spikecam_env.gap.report.quantities import (
    at_most,
    bounded_parameter,
    interval,
    number,
    percent,
    quantity,
    signed,
    sizes,
)
from spikecam_env.gap.report.words import bare, group_meaning, human, listed, meaning_of, parameter_unit
from spikecam_env.gap.result import (
    EXPLAINS_NEARLY_ALL,
    LARGEST,
    SIGNIFICANT,
    Diagnosis,
    NamedEffect,
    Remainder,
    Statistic,
)

Rows = list[tuple[str, ...]]
MOST_ROWS = 15
"""Statistics in the table of the largest differences."""


class StepRow(NamedTuple):
    """One step of the search."""

    title: str
    rows: Rows
    """Candidate, misfit, best fit, outcome."""
    classes: list[str]
    """Of each row: "accepted", or empty."""


def parameter_rows(effect: NamedEffect) -> Rows:
    """Name, value with error, 90 % interval, meaning."""
    units = {name: parameter_unit(effect.name, name) for name in effect.parameters}
    return [
        (bare(effect.name, name), quantity(e.value, units[name], e.sd), interval(e, units[name]),
         meaning_of(effect.name, name))
        for name, e in effect.parameters.items()
    ]  # fmt: skip


def off_rows(d: Diagnosis) -> Rows:
    """Parameters that are off: name, measured, in the model, ratio, meaning."""
    return [
        (f"{r.name}: {r.parameter}", quantity(r.measured, r.unit), quantity(r.nominal, r.unit), number(r.ratio),
         r.meaning)
        for r in parameters_off(d.parameters, d.patched.circuit)
    ]  # fmt: skip


REMAINDER = {
    EXPLAINS_NEARLY_ALL: (
        "The named effects explain nearly all of the difference. What is left is more than chance, but small: the law "
        "of this camera differs in detail from the catalogue's, or a much weaker effect hides beside it. Parameters "
        "may be off by more than their errors; the patched model holds for light like that of these recordings."
    ),
    LARGEST: (
        "The named effects are there: no other candidate explains as much, and they leave little where they act. They "
        "do not explain the whole difference. Something else is there, of which this table shows the place; the "
        "patched model may have stand-ins for it, which claim no physics."
    ),
}
"""How to read a remainder, by the degree of the explanation."""


def remainder_rows(left: Remainder) -> Rows:
    """The difference beside the named effects: its size, its statistics, its place."""
    return [
        ("Largest deviation, in noise", f"{left.noises:.1f} ({human(left.worst)})"),
        ("Share of the sum of squares", percent(left.share)),
        ("Groups of statistics, by share", "; ".join(f"{human(g)} {percent(s)}" for g, s in left.groups.items())),
        ("Recordings, the furthest off first", ", ".join(left.recordings)),
        ("Its look", ", ".join(left.looks)),
        ("Where", left.where or "no part of the array stands out"),
        ("When", left.when or "no part of the recordings stands out"),
    ]


def gap_rows(d: Diagnosis, use: Mapping[str, str]) -> Rows:
    """Recording, use, before, after, floor; `use` by the name of a recording."""
    if d.gap is None:
        return []
    parts = [(name, use.get(name, ""), row) for name, row in d.gap.by_recording.items()]
    whole = ("all held out", "", {"before": d.gap.before, "after": d.gap.after, "floor": d.gap.floor})
    return [
        (name, used, *(number(row.get(key)) for key in ("before", "after", "floor")))
        for name, used, row in [*parts, whole]
    ]


def differing(d: Diagnosis) -> list[Statistic]:
    """Statistics that differ from the model as given, the largest difference first."""
    return sorted((s for s in d.statistics if s.p_adjusted < SIGNIFICANT), key=lambda s: -abs(s.z))


def compared(d: Diagnosis) -> str:
    """How many statistics were compared, and how many of them differ."""
    return (
        f"{len(d.statistics)} statistics were compared, {len(differing(d))} of them differ from the model as given "
        f"(p < {SIGNIFICANT:g} after correction for their number)."
    )


def title_of_differences(d: Diagnosis) -> str:
    """Above `difference_rows`."""
    count = len(differing(d))
    return "The largest differences" + (f" ({MOST_ROWS} of {count})" if count > MOST_ROWS else "")


def difference_rows(d: Diagnosis) -> Rows:
    """The largest differences: statistic, recordings, measured, before, after, z before, z after."""
    return [
        (s.name, ", ".join(s.recordings), number(s.measured), number(s.before), number(s.after), signed(s.z),
         signed(s.z_after))
        for s in differing(d)[:MOST_ROWS]
    ]  # fmt: skip


def group_rows(d: Diagnosis) -> Rows:
    """Groups of the largest differences, and their meaning."""
    return [(g, group_meaning(g)) for g in dict.fromkeys(s.group for s in differing(d)[:MOST_ROWS])]


def steps(d: Diagnosis) -> Iterator[StepRow]:
    """The search, step by step.  Candidates for an unknown effect are parts of a patch."""
    added = "in the patch" if d.verdict == "unknown" else "accepted"
    beside: list[str] = []
    for step, (before, tried) in enumerate(groupby(d.ranking, key=lambda r: r.misfit_before), start=1):
        ranked = list(tried)
        start = f"with {listed(beside, 'and')}" if beside else "the model as given"
        rows: Rows = [
            (human(r.name), number(r.misfit), sizes(r.parameters, r.name),
             ": ".join(filter(None, (added if r.accepted else "rejected", r.reason))))
            for r in ranked
        ]  # fmt: skip
        yield StepRow(
            f"Step {step}: {start} (misfit {number(before)})", rows, ["accepted" if r.accepted else "" for r in ranked]
        )
        beside += [human(r.name) for r in ranked if r.accepted]


def bound_rows(d: Diagnosis) -> Rows:
    """Upper bounds: effect, parameter, at most."""
    return [(human(b.name), bounded_parameter(b), f"< {at_most(b)}") for b in d.bounds]


def needs(effects: Sequence[tuple[str, str]]) -> Rows:
    """Effects, and the recordings that would show them."""
    return [(human(name), needed) for name, needed in effects]


def stage_rows(d: Diagnosis) -> Rows:
    """Seconds by stage."""
    return [(name, f"{seconds:.1f}") for name, seconds in [*d.stages.items(), ("all", sum(d.stages.values()))]]


def structure_rows(unknown: Mapping[str, Any] | None) -> Rows:
    """`unknown` of diagnosis.json, in words."""
    return [(STRUCTURE.get(key, human(key)), _in_words(key, value)) for key, value in (unknown or {}).items()]


def _in_words(key: str, value: Any) -> str:
    if key == "groups":
        return ", ".join(f"{human(group)} {percent(share)}" for group, share in value.items())
    if key == "best_candidate" and value:
        return human(value)
    return _value(value)


def _value(value: Any) -> str:
    if value is None:
        return "not seen"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, dict):
        return "; ".join(f"{human(str(k))} {_value(v)}" for k, v in value.items())
    if isinstance(value, (list, tuple, set)):
        return ", ".join(_value(v) for v in value)
    return number(value)


STRUCTURE = {
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
}
"""Keys of `Diagnosis.unknown` in words."""
