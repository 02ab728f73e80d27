"""Recordings upside down or mirrored, by their light and by the unit's fixed pattern."""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.check.contradiction import Contradiction
from spikecam_env.gap.statistics.film import refitted_film
from spikecam_env.gap.twins.case import Case
from spikecam_env.types import Floats

_BACK, _ALL = slice(None, None, -1), slice(None)
ORIENTATIONS = {
    "rows reversed": (_BACK, _ALL),
    "columns reversed": (_ALL, _BACK),
    "turned by 180 degrees": (_BACK, _BACK),
}

LEAST_SPIKES = 1000
"""Spikes of a recording whose orientation says something."""

LEAST_CORRELATION = 0.2
"""Correlation with its light of a recording that was turned, once corrected."""

GAIN = 0.5
"""Share of the correlation's lack to 1 that a turn gains."""


def flipped(case: Case, suspect: set[str]) -> list[Contradiction]:
    """Recordings that fit their light and the unit's pattern upside down or mirrored."""
    contradictions = []
    for i, c in enumerate(case.conditions):
        pictures = _seen_and_expected(case, i)
        turn = _better_turn(*pictures) if pictures else None
        if turn:
            name, turned, right = turn
            text = f"{c.name}: {name} (correlation with its light {right:.2f}, once corrected {turned:.2f})"
            contradictions.append(Contradiction("flipped", (c.name,), text))
    return contradictions


def _seen_and_expected(case: Case, i: int) -> tuple[Floats, Floats] | None:
    """(film, film of the refitted unit) of a recording, (n, H, W) each, or (rates, rates of the other flats)."""
    c, o = case.conditions[i], case.observations[i]
    if c.light is None or o.times.count.sum() < LEAST_SPIKES:
        return None
    if o.film is not None:
        seen = o.film.reshape(-1, *case.shape).astype(np.float64)
        return seen, refitted_film(c, case.base).reshape(-1, *case.shape)
    others = [
        p.rate
        for j, p in enumerate(case.observations)
        if j != i and case.conditions[j].kind == "flat" and p.times.count.sum() >= LEAST_SPIKES
    ]
    if c.kind == "dark" or not others:
        return None
    expected = np.mean([r / r.mean() for r in others], axis=0)
    return o.rate.reshape(1, *case.shape), expected.reshape(1, *case.shape)


def _better_turn(seen: Floats, expected: Floats) -> tuple[str, float, float] | None:
    """(turn, correlation turned, correlation as it is) of the first turn that agrees better, in time or summed: by no
    little correlation, and with more than half of the way to 1."""
    whole = (seen, expected), (seen.sum(axis=0)[None], expected.sum(axis=0)[None])
    for name, (rows, columns) in ORIENTATIONS.items():
        agree = [(_correlation(s[:, rows, columns], e), _correlation(s, e)) for s, e in whole]
        turned, right = max(agree, key=lambda a: a[0] - a[1])
        if turned > LEAST_CORRELATION and turned > right + GAIN * (1.0 - max(right, 0.0)):
            return name, turned, right
    return None


def _correlation(a: Floats, b: Floats) -> float:
    a, b = a - a.mean(), b - b.mean()
    return float((a * b).sum() / max(np.sqrt((a * a).sum() * (b * b).sum()), 1e-30))
