"""Figures of a page: the gap by recording, and the exhibits among the evidence."""

from __future__ import annotations

from collections.abc import Iterator

from spikecam_env.gap.report import plots
from spikecam_env.gap.report.cells import number
from spikecam_env.gap.report.exhibits import LEAST_Z, Exhibit, by_z, exhibits
from spikecam_env.gap.report.panels import PixelMaps
from spikecam_env.gap.report.sentence import gap_line
from spikecam_env.gap.result import CHANCE, Diagnosis
from spikecam_env.page import captioned, element, picture, table


def gap_section(d: Diagnosis) -> Iterator[str]:
    """The gap before and after, of every recording and of all that are held out."""
    if d.gap is None:
        return
    yield element("p", gap_line(d.gap))
    caption = (
        "Mean square distance of statistics from the model, in units of their noise. Orange: model as given; "
        "blue: patched; grey: floor, "
        + ("chance." if d.gap.floor == CHANCE else "two halves of the measurement, or the patterns of two units.")
    )
    use = {c.name: c.use for c in d.evidence.conditions} if d.evidence else {}
    held = [name for name in d.gap.by_recording if use.get(name, "holdout") == "holdout"]
    drawn = picture(plots.gap_bars(d.gap, held), "Gap by recording")
    yield f'<div class="single">{captioned(drawn, caption)}</div>'
    rows = [
        (name, use.get(name, ""), *(number(row.get(key)) for key in ("before", "after", "floor")))
        for name, row in d.gap.by_recording.items()
    ]
    rows.append(("all held out", "", *map(number, (d.gap.before, d.gap.after, d.gap.floor))))
    yield table(("recording", "use", "before", "after", "floor"), rows, numbers=(2, 3, 4))


def motion_section(d: Diagnosis) -> Iterator[str]:
    """What moves in recordings that are said to be static, as a picture of each; which pixels were kept."""
    if not d.motion:
        return
    kept = f"{100 * d.static_share:.3g} % of pixels are static in all of them"
    yield element("p", f"{kept}; only these were used." if d.verdict != "data" and d.static_only else f"{kept}.")
    yield '<div class="plots">'
    for m in d.motion:
        caption = (
            "Grey: mean rate; orange: windows of pixels whose counts change together, up to "
            f"{100 * m.contrast:.0f} % and {m.z:.0f} standard deviations."
        )
        yield captioned(picture(plots.motion_map(m.rate, m.moving, m.recording), "What moves", form="png"), caption)
    yield "</div>"


def evidence_section(d: Diagnosis) -> Iterator[str]:
    """Exhibits, those with the largest deviates first; the others folded away."""
    if d.evidence is None:
        return
    shown, folded = by_z(exhibits(d.evidence, d.patched.frame_rate_hz), d.statistics)
    yield legend(after=d.evidence.after is not None)
    if not shown:
        yield element(
            "p", f"Nowhere do measured and model differ by {LEAST_Z:g} standard deviations. These were compared:"
        )
        shown, folded = folded[:3], folded[3:]
    for exhibit in shown:
        yield from exhibit_parts(exhibit, d)
    if folded:
        also = f"Also compared, largest |z| below {LEAST_Z:g}: " + ", ".join(e.title.lower() for e in folded)
        yield f"<details>{element('summary', also)}"
        for exhibit in folded:
            yield from exhibit_parts(exhibit, d)
        yield "</details>"


def legend(*, after: bool) -> str:
    """What marks and colours stand for."""
    keys = [("measured", "●", "measured"), ("before", "■", "model before"), ("after", "▲", "model after"),
            ("band", "▮", "noise: two standard errors of measured less before")]  # fmt: skip
    shown = [
        f'<span class="key"><span class="{c}">{mark}</span> {text}</span>'
        for c, mark, text in keys
        if after or c != "after"
    ]
    return f'<p class="legend">{" ".join(shown)}</p>'


def exhibit_parts(exhibit: Exhibit, d: Diagnosis) -> Iterator[str]:
    """Title, caption, plots and maps."""
    yield f'<div class="exhibit" id="exhibit-{exhibit.name}">'
    yield element("h3", f"{exhibit.title} (largest |z| {exhibit.z(d.statistics):.1f})")
    yield element("p", exhibit.caption, class_="caption")
    yield '<div class="plots">'
    for panel in exhibit.panels:
        yield picture(plots.panel(panel), f"{panel.title}: measured, model before and after")
    yield "</div>"
    for maps in exhibit.maps:
        yield from maps_parts(maps)
    yield "</div>"


def maps_parts(maps: PixelMaps) -> Iterator[str]:
    """Measured, before and after in the same colours."""
    limits = plots.map_limits(maps.measured)
    yield element("p", f"{maps.title} [{maps.unit}]:", class_="caption")
    yield '<div class="maps">'
    for name, values in (("measured", maps.measured), ("model before", maps.before), ("model after", maps.after)):
        if values is not None:
            yield picture(plots.pixel_map(values, name, limits, maps.unit), f"{maps.title}, {name}")
    yield "</div>"
