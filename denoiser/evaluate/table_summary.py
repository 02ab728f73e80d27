"""Records of many scenes and seeds as means and spreads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from denoiser.evaluate.judge import RowResult, plain
from denoiser.evaluate.metrics import gap_closed

Mean = dict[str, float | None]


def groups(records: Sequence[RowResult]) -> list[dict[str, Any]]:
    """Records by mean interval and speed, each with the means of its rows.

    Args:
        records: of many scenes and seeds.

    Returns:
        Groups: interval, speed, scenes, seeds, and rows: row -> {pictures: column -> {db, db_spread, ssim, ssim_spread,
            niqe, gain_db, gain_ssim, gap_closed}, and the other measures of a `RowResult`, by name}.
    """
    kinds = dict.fromkeys((r.interval, r.speed) for r in records)
    return [_group(*kind, [r for r in records if (r.interval, r.speed) == kind]) for kind in kinds]


def mean_and_spread(values: Sequence[tuple[int, float | None]]) -> tuple[float | None, float | None]:
    """(seed, value) over scenes: the mean, and the standard deviation over seeds of the mean over scenes."""
    known = [(seed, v) for seed, v in values if v is not None]
    if not known:
        return None, None
    means = [float(np.mean([v for s, v in known if s == seed])) for seed in dict.fromkeys(s for s, _ in known)]
    spread = float(np.std(means, ddof=1)) if len(means) > 1 else None
    return plain(float(np.mean(means))), None if spread is None else plain(spread)


def _group(interval: float, speed: float, records: list[RowResult]) -> dict[str, Any]:
    rows: dict[str, Any] = {}
    for row in dict.fromkeys(r.row for r in records):
        rows[row] = _row([r for r in records if r.row == row])
    for found in rows.values():
        for column, score in found["pictures"].items():
            _compare(score, *(rows[r]["pictures"].get(column) if r in rows else None for r in ("noisy", "clean")))
    return {
        "interval": interval,
        "speed": speed,
        "scenes": list(dict.fromkeys(r.scene for r in records)),
        "seeds": len({r.seed for r in records}),
        "rows": rows,
    }


def _row(records: list[RowResult]) -> dict[str, Any]:
    columns = dict.fromkeys(c for r in records for c in r.pictures)
    return {
        "pictures": {column: _scores([(r.seed, r.pictures[column]) for r in records]) for column in columns},
        "mean_plane": _scores([(r.seed, r.mean_plane) for r in records if r.mean_plane is not None]),
        "db_by_place": _by_place(records),
        **{
            name: mean_and_spread([(r.seed, getattr(r, name)) for r in records])[0]
            for name in ("bias", "lag", "flicker", "texture", "mean_db", "last_db", "change")
        },
    }


def _scores(scores: list[tuple[int, Any]]) -> Mean:
    found: Mean = {}
    for name in ("db", "ssim", "niqe"):
        found[name], found[f"{name}_spread"] = mean_and_spread([(seed, getattr(s, name)) for seed, s in scores])
    return found


def _by_place(records: list[RowResult]) -> list[float | None]:
    lists = [(r.seed, r.db_by_place) for r in records if len(r.db_by_place) > 1]
    return [
        mean_and_spread([(s, places[i]) for s, places in lists])[0] for i in range(len(lists[0][1]) if lists else 0)
    ]


def _compare(score: Mean, noisy: Mean | None, clean: Mean | None) -> None:
    """Add the row's gain over noisy, and the share of the way to the clean twin."""
    if noisy is None or score["db"] is None or noisy["db"] is None or score["ssim"] is None or noisy["ssim"] is None:
        return
    score["gain_db"] = plain(score["db"] - noisy["db"])
    score["gain_ssim"] = plain(score["ssim"] - noisy["ssim"])
    if clean is not None and clean["db"] is not None:
        score["gap_closed"] = plain(gap_closed(noisy["db"], score["db"], clean["db"]))
