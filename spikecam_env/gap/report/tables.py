"""Tables of a page: all statistics, candidates, upper bounds, what could not be tested, notes."""

from __future__ import annotations

from collections.abc import Iterator

from spikecam_env.gap.report import plots
from spikecam_env.gap.report.cells import bullets, number, signed
from spikecam_env.gap.report.quantities import at_most, bounded_parameter, sizes
from spikecam_env.gap.report.words import human
from spikecam_env.gap.result import SIGNIFICANT, Diagnosis
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


def candidates_section(d: Diagnosis) -> Iterator[str]:
    """Candidates that were fitted, and what each left."""
    if not d.ranking:
        return
    yield element(
        "p",
        "Each candidate was fitted with the unit's own parameters free. Misfit: how far what it leaves is from noise; "
        "the smaller the better. The gate simulates the fitted model anew and looks at its worst group.",
    )
    rows = [
        (human(r.name), number(r.misfit_before), number(r.misfit), sizes(r.parameters, r.name),
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


def bounds_section(d: Diagnosis) -> Iterator[str]:
    """Upper bounds, where the meaning of the verdict has none."""
    if d.bounds and d.verdict != "none":
        yield element("p", "Effects that were looked for and not found are smaller than:")
        yield from bounds_tables(d)


def bounds_tables(d: Diagnosis) -> Iterator[str]:
    """Bounds of what shows too little to be found, and below them what these recordings put no bound to."""
    rows = [(human(b.name), bounded_parameter(b), f"< {at_most(b)}") for b in d.bounds]
    if rows:
        yield table(("effect", "parameter", "at most (95 %)"), rows, numbers=(2,), stack=True)
    if d.not_bounded:
        yield element("p", "Not bounded by these data; the right column would bound it:")
        yield table(("effect", "needs"), [(human(name), needs) for name, needs in d.not_bounded], stack=True)


def not_testable_section(d: Diagnosis) -> Iterator[str]:
    """Effects that these recordings cannot show."""
    if d.not_testable:
        yield element("p", "These recordings say nothing about the following; the right column would make it testable.")
        yield table(("effect", "needs"), [(human(name), needs) for name, needs in d.not_testable])


def notes_section(d: Diagnosis) -> Iterator[str]:
    """Notes on data and effort, where the meaning of the verdict has none."""
    if d.data and d.verdict != "data":
        yield bullets(d.data)
