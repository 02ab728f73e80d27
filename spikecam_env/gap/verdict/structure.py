"""What a discrepancy that no candidate explains looks like: the first questions an engineer would ask."""

from __future__ import annotations

from typing import Any

import numpy as np

from spikecam_env.gap.compare.distance import CLEAR, HEAVY
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.verdict.where_and_when import when, where
from spikecam_env.types import Floats

COMMON_SHARE = 0.3
"""Of all that is off, what statistics of many pixels have where a difference is common to them."""

LEAST_LEVELS = 3
"""Flats on which a statistic has to be clearly off for its power of the level."""

_MEMORY = ("step", "moving")
_COMMON = ("spectrum", "rows", "neighbours")


def structure(case: Case, null: Null, off: Floats) -> dict[str, Any]:
    """Its description, as in `unknown` of diagnosis.json.

    off: (S,) measured less predicted, in noise, under the null model.
    """
    kind = {c.name: c.kind for c in case.conditions}
    level = {c.name: c.level for c in case.conditions}
    seen = np.abs(off) > CLEAR
    weight = {g: 0.0 for g in dict.fromkeys(k.group for k in null.keys)}
    for k, o in zip(null.keys, off, strict=True):
        weight[k.group] += float(np.log1p(o**2 / HEAVY))
    order = sorted(weight, key=lambda g: -weight[g])
    keys = [k for k, s in zip(null.keys, seen, strict=True) if s]
    dark = any(kind[k.recording] == "dark" and k.group != "rates" for k in keys)
    lit = any(kind[k.recording] not in ("dark",) for k in keys)
    common = sum(weight[g] for g in _COMMON if g in weight)
    total = max(sum(weight.values()), 1e-9)
    return {
        "light": "in the dark and in the light" if dark and lit else "in the dark" if dark else "in the light",
        "level_exponent": level_exponent(null, off, kind, level),
        "extent": "common to many pixels" if common > COMMON_SHARE * total else "pixel by pixel",
        "time_scale_s": None,
        "history": any(k.group in _MEMORY and k.name not in ("level", "square", "row", "column") for k in keys),
        "neighbours": any(k.group == "neighbours" for k in keys),
        "clock": any(k.group == "clock" and not k.name.endswith("between") for k in keys),
        "where": where(case) or None,
        "when": when(case) or None,
        "worst_group": order[0] if order else None,
        "groups": {g: weight[g] / total for g in order[:4]},
    }


def level_exponent(null: Null, off: Floats, kind: dict[str, str], level: dict[str, float]) -> float | None:
    """Slope of log |statistic| on log level over the flats, of the statistic that is seen on most of them, the
    first of several."""
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
