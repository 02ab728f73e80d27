"""A table's result as text."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from denoiser.evaluate.judge import COLUMNS, PLANE
from denoiser.evaluate.rows import ROWS

WIDTH = 41
"""Of the column of rows: the longest title with the size of its network."""


def report(result: dict[str, Any]) -> str:
    """The result of `evaluate_table` as tables to read."""
    of = _of(result["settings"]) if result["groups"] else "nothing to judge"
    parts = [f"{result['title']}\n{of}"]
    for group in result["groups"]:
        parts += [_pictures(group, result["rows"], result["parameters"]), *_measures(group, result["rows"])]
    if result["missing"]:
        parts.append("not there:\n" + "\n".join(f"  {name}: {why}" for name, why in result["missing"].items()))
    return "\n\n".join(parts) + "\n"


def number(value: float | None, width: int, digits: int) -> str:
    """A cell of a printed table."""
    return f"{'-':>{width}}" if value is None else f"{value:{width}.{digits}f}"


def _of(settings: dict[str, Any]) -> str:
    shapes = ", ".join(f"{rows} x {columns}" for rows, columns in settings["shapes"])
    frames = ", ".join(map(str, settings["frames"]))
    return f"{', '.join(settings['scenes'])}; {shapes}; {frames} frames; {_repeated(settings)}"


def _repeated(counted: dict[str, Any]) -> str:
    """The repetitions over which the spreads are."""
    return f"{counted['seeds']} instants" if counted["seeds_are_instants"] else f"seeds: {counted['seeds']}"


def _pictures(group: dict[str, Any], rows: Sequence[str], parameters: dict[str, int | None]) -> str:
    columns = [*COLUMNS, PLANE]
    titles = [*COLUMNS.values(), "rate plane"]
    by_niqe = any(s["niqe"] is not None for row in group["rows"].values() for s in row["pictures"].values())
    shown, head = (_niqe, "NIQE") if by_niqe else (_cell, "   dB  +-    SSIM   gap")
    lines = [
        _named(group),
        f"{'':{WIDTH}}" + "".join(f"| {title:^24}" for title in titles),
        f"{'':{WIDTH}}" + f"| {head:24}" * len(titles),
    ]
    for row in rows:
        scores = group["rows"].get(row, {}).get("pictures", {})
        size = parameters.get(row)
        title = ROWS[row].title + ("" if size is None else f", {size / 1e6:.2f} M")
        lines.append(f"{title:{WIDTH}}" + "".join(f"| {shown(scores.get(c)):24}" for c in columns).rstrip())
    return "\n".join(lines)


def _named(group: dict[str, Any]) -> str:
    light = [f"mean interval {group['interval']:g} frames"] if group["interval"] else []
    speed = [f"{group['speed']:g} pixels a frame"] if group["speed"] else []
    scenes = group["scenes"]
    return ", ".join([*light, *speed, scenes[0] if len(scenes) == 1 else f"{len(scenes)} scenes"])


def _measures(group: dict[str, Any], rows: Sequence[str]) -> list[str]:
    """Of rates against the light, of the rows that have any; nothing where no light is known."""
    found = {row: group["rows"][row] for row in rows if row in group["rows"]}
    if all(row["bias"] is None for row in found.values()):
        return []
    lines = [
        f"{'rates against the light':{WIDTH}}|  bias %    lag | all planes dB   SSIM | flicker  texture "
        "| mean dB  last dB  change % | dB by place in the pass"
    ]
    for row, m in found.items():
        size = None if m["bias"] is None else 100 * m["bias"]
        change = None if m["change"] is None else 100 * m["change"]
        places = " ".join(number(db, 4, 1) for db in m["db_by_place"])
        lines.append(
            f"{ROWS[row].title:{WIDTH}}| {number(size, 7, 2)} {number(m['lag'], 6, 2)} "
            f"| {number(m['mean_plane']['db'], 13, 2)} {number(m['mean_plane']['ssim'], 6, 3)} "
            f"| {number(m['flicker'], 7, 2)} {number(m['texture'], 8, 2)} "
            f"| {number(m['mean_db'], 7, 2)} {number(m['last_db'], 8, 2)} {number(change, 9, 2)} | {places}".rstrip()
        )
    return ["\n".join(lines)]


def _cell(score: dict[str, float | None] | None) -> str:
    if score is None or score["db"] is None:
        return f"{'-':>5}"
    gap = score.get("gap_closed")
    share = "" if gap is None else f"{100 * gap:4.0f} %"
    return f"{score['db']:5.2f} {number(score['db_spread'], 4, 2)} {number(score['ssim'], 5, 3)} {share}"


def _niqe(score: dict[str, float | None] | None) -> str:
    return f"{'-':>5}" if score is None else number(score["niqe"], 5, 2)
