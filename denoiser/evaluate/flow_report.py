"""The errors of optical flow as means, and as tables in Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from denoiser.evaluate.case import ScoredPictures
from denoiser.evaluate.rows import ROWS
from denoiser.evaluate.table_report import number
from denoiser.evaluate.table_summary import mean_and_spread

MEASURES = ("all", "moving")
"""Pixels whose errors are averaged."""
STILL = "no motion"
"""Name of the flow that is zero everywhere, of no row: the score to beat."""


def flow_groups(records: Sequence[ScoredPictures]) -> list[dict[str, Any]]:
    """Records by mean interval and speed.

    Args:
        records: of many scenes and seeds.

    Returns:
        Groups: interval, speed, scenes, seeds, and rows: a list of {row, picture, apart (frames of the flow), by_scene:
            scene -> {all, moving}, all, moving, all_spread, moving_spread}; errors in pixels, means over seeds and, of
            the last four, over scenes.
    """
    kinds = dict.fromkeys((r.interval, r.speed) for r in records)
    return [_group(*kind, [r for r in records if (r.interval, r.speed) == kind]) for kind in kinds]


def flow_report(result: dict[str, Any]) -> str:
    """The result of `flow.evaluate_flow` as tables to read, in Markdown."""
    settings = result["settings"]
    shapes = ", ".join(f"{rows} x {columns}" for rows, columns in settings["shapes"])
    pairs = ", ".join(f"{count} over {frames} frames" for frames, count in settings["pairs"].items())
    pans = "; ".join(f"gaze moving by {x:g}, {y:g} pixels a frame" for x, y in settings["pan"] if (x, y) != (0, 0))
    of = "; ".join(
        [shapes, f"{', '.join(map(str, settings['frames']))} frames", f"pairs: {pairs}", *filter(None, [pans])]
    )
    parts = [f"{result['title']}\n{of}"]
    for group in result["groups"]:
        for apart in dict.fromkeys(row["apart"] for row in group["rows"]):
            parts.append(_table(group, apart))
    if result["missing"]:
        parts.append("not there:\n" + "\n".join(f"  {name}: {why}" for name, why in result["missing"].items()))
    return "\n\n".join(parts) + "\n"


def _group(interval: float, speed: float, records: Sequence[ScoredPictures]) -> dict[str, Any]:
    names = dict.fromkeys((r.row, name) for r in records for name in r.pictures)
    rows = []
    for row, name in names:
        picture, _, apart = name.rpartition(", ")
        taken = [(r.scene, r.seed, r.pictures[name]) for r in records if r.row == row and name in r.pictures]
        found: dict[str, Any] = {"row": row, "picture": picture, "apart": int(apart)}
        found["by_scene"] = {
            scene: {m: mean_and_spread([(seed, s[m]) for its, seed, s in taken if its == scene])[0] for m in MEASURES}
            for scene in dict.fromkeys(scene for scene, _, _ in taken)
        }
        for measure in MEASURES:
            mean, spread = mean_and_spread([(seed, s[measure]) for _, seed, s in taken])
            found |= {measure: mean, f"{measure}_spread": spread}
        rows.append(found)
    scenes = list(dict.fromkeys(r.scene for r in records))
    return {
        "interval": interval,
        "speed": speed,
        "scenes": scenes,
        "seeds": len({r.seed for r in records}),
        "rows": rows,
    }


def _table(group: dict[str, Any], apart: int) -> str:
    light = f"mean interval {group['interval']:g} frames"
    speed = f", {group['speed']:g} pixels a frame" if group["speed"] else ""
    head = ["row", "picture", *group["scenes"], "mean"]
    lines = [f"**{light}{speed}: flow over {apart} frames**\n", _line(head), _line(["---"] * len(head))]
    for row in group["rows"]:
        if row["apart"] == apart:
            cells = [_cell(row["by_scene"].get(scene, {})) for scene in group["scenes"]]
            title = ROWS[row["row"]].title if row["row"] in ROWS else row["row"]
            shown = ["", STILL] if row["picture"] == STILL else [title, row["picture"]]
            lines.append(_line([*shown, *cells, _cell(row)]))
    return "\n".join(lines)


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _cell(score: dict[str, float | None]) -> str:
    """Errors of all pixels and of those that move; with the spread over seeds where there is one."""
    parts = []
    for measure in MEASURES:
        spread = score.get(f"{measure}_spread")
        parts.append(number(score.get(measure), 0, 3) + ("" if spread is None else f" +- {spread:.3f}"))
    return " ".join(parts)
