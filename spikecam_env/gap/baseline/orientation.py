"""Recordings upside down or mirrored, by their light and by the unit's fixed pattern."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.baseline.contradiction import Contradiction
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import Observation
from spikecam_env.gap.statistics.film import refitted_film
from spikecam_env.gap.twins.case import Case

Array = NDArray[np.float64]


def flipped(case: Case, suspect: set[str]) -> list[Contradiction]:
    """Recordings that fit their light and the unit's pattern upside down or mirrored."""
    found = []
    back, all_ = slice(None, None, -1), slice(None)
    turns = {"rows reversed": (back, all_), "columns reversed": (all_, back), "turned by 180 degrees": (back, back)}
    for i, (c, o) in enumerate(zip(case.conditions, case.observations, strict=True)):
        if c.light is None or o.times.count.sum() < 1000:
            continue
        if o.film is not None:
            seen = o.film.reshape(-1, *case.shape).astype(np.float64)
            expected = refitted_film(c, case.base).reshape(-1, *case.shape)
        else:
            seen = o.rate.reshape(1, *case.shape)
            others = [p.rate for j, p in enumerate(case.observations) if j != i and _lit(case.conditions[j], p)]
            if c.kind == "dark" or not others:
                continue
            expected = np.mean([r / r.mean() for r in others], axis=0).reshape(1, *case.shape)
        whole = (seen, expected), (seen.sum(axis=0)[None], expected.sum(axis=0)[None])  # in time, and its sum
        for name, (rows, columns) in turns.items():
            agree = [(_correlation(s[:, rows, columns], e), _correlation(s, e)) for s, e in whole]
            turned, right = max(agree, key=lambda a: a[0] - a[1])
            if turned > 0.2 and turned > right + 0.5 * (1.0 - max(right, 0.0)):
                text = f"{c.name}: {name}; so it agrees with the rest (correlation {turned:.2f}, as it is {right:.2f})"
                found.append(Contradiction("flipped", (c.name,), text))
                break
    return found


def _lit(condition: Condition, o: Observation) -> bool:
    return condition.kind == "flat" and o.times.count.sum() >= 1000


def _correlation(a: Array, b: Array) -> float:
    a, b = a - a.mean(), b - b.mean()
    return float((a * b).sum() / max(np.sqrt((a * a).sum() * (b * b).sum()), 1e-30))
