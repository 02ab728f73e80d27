"""The report of a diagnosis: one HTML file for an engineer who did not write it.

From the answer to its reasons: the verdict in a sentence, what it means, the gap before and after, the evidence,
candidates, what could not be tested, the patched model, and how to make the page again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from spikecam_env.gap.report import figures, meaning, reproduce, tables
from spikecam_env.gap.report.panels import shape_of
from spikecam_env.gap.report.style import STYLE
from spikecam_env.gap.report.words import HEADINGS, WITH_REMAINDER
from spikecam_env.gap.result import Diagnosis
from spikecam_env.page import element, page
from spikecam_env.whole import write_text_whole


def write_report(diagnosis: Diagnosis, path: str | Path, campaign_command: str = "") -> None:
    """Write a diagnosis as one HTML page, which needs no other file; it appears whole.

    Args:
        diagnosis: as `diagnose` returns it.
        path: of the page.
        campaign_command: the command that made the campaign, shown beside the one that made the page.

    Example:
        >>> flats = [Dark(), *(Flat(radiance=level) for level in (0.1, 0.3))]
        >>> campaign = write_campaign("camera", "scsim", shape=(8, 8), frames=400, recordings=flats)
        >>> diagnosis = diagnose(campaign, "scsim", candidates=["dead_time"], twin_count=6, progress=False)
        >>> write_report(diagnosis, "report.html")
    """
    write_text_whole(path, report(diagnosis, campaign_command))


def report(diagnosis: Diagnosis, campaign_command: str = "") -> str:
    """The whole page.  campaign_command: what made the campaign, to be shown with the command that made the page."""
    d = diagnosis
    reproduced = ("reproduce", "How to reproduce this page", list(reproduce.reproduce_section(d, campaign_command)))
    sections = [*((anchor, title, list(make(d))) for anchor, title, make in _SECTIONS), reproduced]
    present = [(anchor, title, parts) for anchor, title, parts in sections if parts]
    links = " · ".join(f'<a href="#{anchor}">{element("span", title)}</a>' for anchor, title, _ in present)
    parts = [
        f'<header class="verdict {d.verdict}">',
        element("p", WITH_REMAINDER if d.remainder else HEADINGS[d.verdict], class_="badge"),
        element("h1", d.sentence),
        element("p", subject(d), class_="subject"),
        "</header>",
        f"<nav>{links}</nav>",
    ]
    for anchor, title, inside in present:
        parts += [f'<section id="{anchor}">', element("h2", title), *inside, "</section>"]
    return page(f"Diagnosis of {Path(d.campaign).name}", parts, STYLE)


def subject(d: Diagnosis) -> str:
    """What was compared with what, how long that took, and by which version of the code."""
    said = f"Recordings of {Path(d.campaign).name} against the model {d.model_name}"
    shape = shape_of(d.evidence) if d.evidence else None
    if d.evidence and shape:
        shown = d.evidence.conditions
        held = sum(c.use == "holdout" for c in shown)
        said += (
            f": {shape[0]} × {shape[1]} pixels at {d.patched.frame_rate_hz:g} Hz, {len(shown)} recordings, "
            f"{held} of them held out"
        )
    return f"{said}. {sum(d.stages.values()):.0f} s, {reproduce.version_of_code()}."


_SECTIONS: tuple[tuple[str, str, Callable[[Diagnosis], Iterator[str]]], ...] = (
    ("meaning", "What it means", meaning.meaning_section),
    ("motion", "Where it moves", figures.motion_section),
    ("gap", "The gap, before and after", figures.gap_section),
    ("evidence", "Evidence", figures.evidence_section),
    ("statistics", "All statistics", tables.statistics_section),
    ("candidates", "Candidates", tables.candidates_section),
    ("bounds", "Upper bounds", tables.bounds_section),
    ("not-testable", "What could not be tested", tables.not_testable_section),
    ("audit", "Notes on the data", tables.notes_section),
    ("model", "The model", reproduce.model_section),
)
