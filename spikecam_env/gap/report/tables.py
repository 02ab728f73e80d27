"""Tables of a page: all statistics, candidates, upper bounds, what could not be tested, notes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

from spikecam_env.gap.report import plots
from spikecam_env.gap.report.cells import bullets, number, signed
from spikecam_env.gap.report.quantities import at_most, bounded_parameter, sizes
from spikecam_env.gap.report.words import group_meaning, human, listed
from spikecam_env.gap.result import SIGNIFICANT, Diagnosis, Ranked
from spikecam_env.page import captioned, element, picture, table

MOST_ROWS = 15
"""Statistics in the table of the largest differences."""


def statistics_section(d: Diagnosis) -> Iterator[str]:
    """Every statistic as a point, and the largest differences."""
    if not d.statistics:
        return
    found = sorted((s for s in d.statistics if s.p_adjusted < SIGNIFICANT), key=lambda s: -abs(s.z))
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
        (s.name, ", ".join(s.recordings), number(s.measured), number(s.before), number(s.after), signed(s.z),
         signed(s.z_after))
        for s in found[:MOST_ROWS]
    ]  # fmt: skip
    if rows:
        head = ("statistic", "recordings", "measured", "before", "after", "z before", "z after")
        title = "The largest differences" + (f" ({len(rows)} of {len(found)})" if len(found) > len(rows) else "")
        yield element("h3", title)
        yield table(head, rows, numbers=range(2, 7), optional=range(2, 5))
        groups = dict.fromkeys(s.group for s in found[:MOST_ROWS])
        yield table(("group", "what it measures"), [(g, group_meaning(g)) for g in groups], stack=True)


def candidates_section(d: Diagnosis) -> Iterator[str]:
    """Candidates that were fitted, and what each left."""
    if not d.ranking:
        return
    yield element(
        "p",
        "Candidates were fitted step by step, each with the unit's own parameters free. A step adds at most one of "
        "them; the next step starts from the remaining difference. Misfit is a sum of squares of that difference, in "
        "noise; within a step, smaller is better. Each step has its own simulations and so its own noise: its first "
        "misfit may differ from the last misfit of the step before.",
    )
    beside: list[str] = []
    for number_of, (before, tried) in enumerate(groupby(d.ranking, key=lambda r: r.misfit_before), start=1):
        rows = list(tried)
        added = f"with {listed(beside, 'and')}" if beside else "the model as given"
        yield element("h3", f"Step {number_of}: {added} (misfit {number(before)})")
        yield step_table(d, rows)
        beside += [human(r.name) for r in rows if r.accepted]


def step_table(d: Diagnosis, tried: Sequence[Ranked]) -> str:
    """The candidates of one step, and what became of each.  Of an unknown effect what is added is a patch."""
    added = "in the patch" if d.verdict == "unknown" else "accepted"
    rows = [
        (human(r.name), number(r.misfit), sizes(r.parameters, r.name),
         ": ".join(filter(None, (added if r.accepted else "rejected", r.reason))))
        for r in tried
    ]  # fmt: skip
    return table(
        ("candidate", "misfit", "best fit", "outcome"),
        rows,
        numbers=(1,),
        classes=["accepted" if r.accepted else "" for r in tried],
        stack=True,
    )


def bounds_section(d: Diagnosis) -> Iterator[str]:
    """Upper bounds, where the meaning of the verdict has none."""
    if d.bounds and d.verdict != "none":
        yield element("p", "Upper bounds of the effects that were not found:")
        yield from bounds_tables(d)


def bounds_tables(d: Diagnosis) -> Iterator[str]:
    """Bounds of what shows too little to be found, and below them what these recordings put no bound to."""
    rows = [(human(b.name), bounded_parameter(b), f"< {at_most(b)}") for b in d.bounds]
    if rows:
        yield table(("effect", "parameter", "at most (95 %)"), rows, numbers=(2,), stack=True)
    if d.not_bounded:
        yield element("p", "These recordings give no bound; the right column names what would give one:")
        yield table(("effect", "needs"), [(human(name), needs) for name, needs in d.not_bounded], stack=True)


def not_testable_section(d: Diagnosis) -> Iterator[str]:
    """Effects that these recordings cannot show."""
    if d.not_testable:
        yield element("p", "These recordings cannot show these effects; the right column names what would.")
        yield table(("effect", "needs"), [(human(name), needs) for name, needs in d.not_testable])


def notes_section(d: Diagnosis) -> Iterator[str]:
    """Notes on data and effort, where the meaning of the verdict has none."""
    if d.data and d.verdict != "data":
        yield bullets(d.data)
