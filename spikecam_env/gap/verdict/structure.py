"""The description of a discrepancy that no candidate explains: the first questions an engineer would ask."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from spikecam_env.gap.compare.distance import CLEAR, HEAVY
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.verdict.where_and_when import when, where
from spikecam_env.types import Floats

COMMON_SHARE = 0.3
"""Share of all deviations that statistics of many pixels have where a difference is common to them."""

LEAST_LEVELS = 3
"""Flats on which a statistic has to be clearly off for its power of the level."""

_MEMORY = ("step", "moving")
_COMMON = ("spectrum", "rows", "neighbours")


def structure(case: Case, null: Null, off: Floats) -> dict[str, Any]:
    """The description of a discrepancy, as in `unknown` of diagnosis.json.

    Args:
        off: (S,) measured less predicted, in noise, under the null model.
    """
    kind = {c.name: c.kind for c in case.conditions}
    level = {c.name: c.level for c in case.conditions}
    weight = weight_by_group(null, off)
    order = sorted(weight, key=lambda g: -weight[g])
    total = max(sum(weight.values()), 1e-9)
    clear = np.abs(off) > CLEAR
    keys = [k for k, is_clear in zip(null.keys, clear, strict=True) if is_clear]
    return {
        "light": light_of(keys, kind),
        "level_exponent": level_exponent(null, off, kind, level),
        "extent": "common to many pixels" if is_common(weight) else "pixel by pixel",
        "time_scale_s": None,
        **marks_of(keys),
        "where": where(case) or None,
        "when": when(case) or None,
        "worst_group": order[0] if order else None,
        "groups": {g: weight[g] / total for g in order[:4]},
    }


def weight_by_group(null: Null, off: Floats) -> dict[str, float]:
    """Sum of the logarithmic loss of distances (S,) in noise, by group of statistics."""
    weight = {g: 0.0 for g in dict.fromkeys(k.group for k in null.keys)}
    for k, o in zip(null.keys, off, strict=True):
        weight[k.group] += float(np.log1p(o**2 / HEAVY))
    return weight


def is_common(weight: Mapping[str, float]) -> bool:
    """Whether a difference is common to many pixels, by its weight in each group of statistics."""
    return sum(weight.get(g, 0.0) for g in _COMMON) > COMMON_SHARE * max(sum(weight.values()), 1e-9)


def light_of(keys: Sequence[StatisticKey], kind: Mapping[str, str]) -> str:
    """Whether statistics are off in the dark, in the light, or in both; kind: of each recording."""
    dark = any(kind[k.recording] == "dark" and k.group != "rates" for k in keys)
    lit = any(kind[k.recording] != "dark" for k in keys)
    return "in the dark and in the light" if dark and lit else "in the dark" if dark else "in the light"


def marks_of(keys: Sequence[StatisticKey]) -> dict[str, bool]:
    """Whether statistics that are off show a memory, a coupling of neighbours, or the array's clock."""
    return {
        "history": any(k.group in _MEMORY and k.name not in ("level", "square", "row", "column") for k in keys),
        "neighbours": any(k.group == "neighbours" for k in keys),
        "clock": any(k.group == "clock" and not k.name.endswith("between") for k in keys),
    }


def level_exponent(null: Null, off: Floats, kind: dict[str, str], level: dict[str, float]) -> float | None:
    """Slope of log |statistic| on log level over the flats, of the statistic that is clearly off on most of them.

    Args:
        off: (S,) distances, in noise.
        kind: kind of each recording.
        level: level of each recording.

    Returns:
        The slope, of the first of several such statistics; None below `LEAST_LEVELS` flats.
    """
    best: tuple[float, float] | None = None
    for group, name in dict.fromkeys((k.group, k.name) for k in null.keys):
        points = [
            (level[k.recording], abs(o) * n)
            for k, o, n in zip(null.keys, off, null.noise, strict=True)
            if (k.group, k.name) == (group, name) and kind[k.recording] == "flat" and abs(o) > CLEAR
        ]
        if len(points) < LEAST_LEVELS:
            continue
        x, y = np.log(np.array(points)).T
        weight = float(len(points)) + float(np.std(x))
        if best is None or weight > best[0]:
            best = weight, float(np.polyfit(x, y, 1)[0])
    return None if best is None else round(best[1], 2)
