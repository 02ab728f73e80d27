"""The page of benchmarks: a table a bench and a point a version, from files of `spikecam bench NAME --out FILE`.

    docs/benchmarks/VERSION/NAME.json        {"machine": text, "rows": [{...}]} or {"rows": {title: [{...}]}}

Text and whole numbers of a row name the measurement; its numbers with a point are figures.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "benchmarks"
SHOWN = re.compile(r"^x |/s$")
"""Figures that are shown: ratios, and rates a second."""
WIDTH, HEIGHT, EDGE = 120, 28, 5
"""Of the drawing of a row [px]."""
Figures = dict[tuple[str, str], dict[str, float]]
"""(measurement, figure) -> version -> value."""


def page(folder: Path = FOLDER) -> str:
    """Markdown: a section a bench; a sentence where nothing has been measured."""
    versions = sorted((f.name for f in folder.glob("*") if f.is_dir()), key=_in_order)
    benches = sorted({file.stem for version in versions for file in (folder / version).glob("*.json")})
    if not benches:
        return "No version has been measured yet.\n"
    return "\n".join(line for bench in benches for line in _section(folder, bench, versions))


def _section(folder: Path, bench: str, versions: list[str]) -> Iterator[str]:
    found = {v: json.loads((folder / v / f"{bench}.json").read_text(encoding="utf-8"))
             for v in versions if (folder / v / f"{bench}.json").is_file()}  # fmt: skip
    yield from (f"## {bench}", "", f"`spikecam bench {bench}`", "")
    yield from (f"| measured | figure | {' | '.join(found)} | |", f"|---|---|{'---|' * len(found)}---|")
    for (what, figure), values in figures(found).items():
        cells = (three_digits(values[v]) if v in values else "" for v in found)
        yield f"| {what} | {figure} | {' | '.join(cells)} | {drawing([values.get(v) for v in found])} |"
    yield from ("", *(f"- {version}: {data['machine']}" for version, data in found.items()), "")


def three_digits(value: float) -> str:
    """A figure to three digits, with a space between thousands."""
    return f"{float(f'{value:.3g}'):,.10g}".replace(",", " ")


def figures(found: dict[str, dict[str, Any]]) -> Figures:
    """All figures that are shown, in the order in which they first appear."""
    all_of: Figures = {}
    for version, data in found.items():
        rows = data["rows"]
        for title, part in rows.items() if isinstance(rows, dict) else [("", rows)]:
            for row in part:
                words = [str(value) if isinstance(value, str) else f"{value} {key}" for key, value in row.items()
                         if isinstance(value, (str, int))]  # fmt: skip
                what = ", ".join(filter(None, [title, *words]))
                for key, value in row.items():
                    if isinstance(value, float) and SHOWN.search(key):
                        all_of.setdefault((what, key), {})[version] = value
    return all_of


def drawing(values: list[float | None]) -> str:
    """A point a version from 0 up, as SVG in the colour of the text; nothing below two versions."""
    known = [value for value in values if value is not None]
    if len(known) < 2:
        return ""
    step, top = (WIDTH - 2 * EDGE) / (len(values) - 1), max(known) or 1.0
    points = [(EDGE + i * step, HEIGHT - EDGE - value / top * (HEIGHT - 2 * EDGE))
              for i, value in enumerate(values) if value is not None]  # fmt: skip
    dots = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5"/>' for x, y in points)
    return f'<svg width="{WIDTH}" height="{HEIGHT}" fill="currentColor" role="img" aria-label="by version">{dots}</svg>'


def _in_order(version: str) -> list[int]:
    return [int(part) for part in re.findall(r"\d+", version)]
