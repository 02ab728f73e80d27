"""The report of a diagnosis: one HTML file for an engineer who did not write it (`report.html.jinja`).

The verdict comes first, in a sentence, and its meaning.  Its reasons follow: gap, evidence, statistics and candidates.
The patched model comes last, and how to make the page again.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from spikecam_env.gap.report import plots, quantities, reproduce, table_rows, words
from spikecam_env.gap.report.exhibits import LEAST_Z, by_z, exhibits
from spikecam_env.gap.report.panels import shape_of
from spikecam_env.gap.report.sentence import NOT_SIMULATED, gap_line, heading
from spikecam_env.gap.result import CHANCE, Diagnosis
from spikecam_env.page import TEMPLATES, picture
from spikecam_env.whole import write_text_whole

LEAST_SHOWN = 3
"""Exhibits that are shown where measured and model differ nowhere."""


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
    """The whole page; arguments as of `write_report`."""
    d = diagnosis
    used = use_of_recordings(d)
    made = exhibits(d.evidence, d.patched.frame_rate_hz) if d.evidence else []
    shown, folded = by_z(made, d.statistics)
    context: dict[str, Any] = {
        "d": d,
        "name": Path(d.campaign).name,
        "title": f"Diagnosis of {Path(d.campaign).name}",
        "heading": heading(d),
        "about": about(d),
        "used": used,
        "held": [name for name in (d.gap.by_recording if d.gap else ()) if used.get(name, "holdout") == "holdout"],
        "commands": "\n".join(filter(None, (campaign_command, reproduce.command_of(d)))),
        "bounds_command": simulated_bounds_command(d),
        "notes": [str.__str__(note) for note in d.data],
        "shown": shown or folded[:LEAST_SHOWN],
        "folded": folded if shown else folded[LEAST_SHOWN:],
        "nothing_shown": not shown,
        "patched": any(s.after != s.before for s in d.statistics),
        "CHANCE": CHANCE,
        "LEAST_Z": LEAST_Z,
        "gap_line": gap_line,
        "picture": picture,
    }
    modules = {"plots": plots, "quantities": quantities, "reproduce": reproduce, "rows": table_rows, "words": words}
    return TEMPLATES.get_template("gap/report/report.html.jinja").render(context, **modules)


def simulated_bounds_command(d: Diagnosis) -> str:
    """The command that simulates upper bounds; empty where they are simulated, or something was found."""
    not_simulated = d.bounds_kind in NOT_SIMULATED and NOT_SIMULATED[d.bounds_kind] in d.data
    return reproduce.command_of(replace(d, bounds_kind="simulated")) if not_simulated else ""


def about(d: Diagnosis) -> str:
    """The recordings, their model, and their number."""
    said = f"Recordings of {Path(d.campaign).name} against the model {d.model_name}"
    shape = shape_of(d.evidence) if d.evidence else None
    if not d.evidence or not shape:
        return said
    number, held = len(d.evidence.conditions), sum(c.use == "holdout" for c in d.evidence.conditions)
    return (
        f"{said}: {shape[0]} × {shape[1]} pixels at {d.patched.frame_rate_hz:g} Hz, {number} recordings, "
        f"{held} of them held out"
    )


def use_of_recordings(d: Diagnosis) -> dict[str, str]:
    """By the name of a recording: `fit` or `holdout`."""
    return {c.name: c.use for c in d.evidence.conditions} if d.evidence else {}
