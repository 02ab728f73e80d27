"""The remainder: what named effects leave beyond chance, where their law differs in details from the catalogue's.

It is judged where it is left, by group of statistics and recording: what was far off elsewhere makes it no smaller, so
that a strong effect hides no other.  What an effect outside of the catalogue leaves of its best stand-in is as large as
what was there in some of them; what the right name of a slightly different law leaves is small in all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.compare.distance import GATE, adjusted, normal_deviates
from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.result import Remainder
from spikecam_env.gap.statistics import Key

Array = NDArray[np.float64]

MOST_LEFT = 0.1
"""Largest deviate that a name may leave beyond chance, over the largest before in the same group of statistics of the
same recording; set on the trial's part `tune`."""


def explains(null: Null, before: Array, left: Array, predicted: Prediction) -> bool:
    """Whether residuals (S,) `left` of a prediction are chance, or little beside (S,) those of the null model."""
    return bool(np.all(np.abs(left) < MOST_LEFT * largest_there(null.keys, before), where=is_left(null, left, predicted)))


def is_left(null: Null, left: Array, predicted: Prediction) -> NDArray[np.bool_]:
    """(S,) which residuals of a prediction are beyond chance."""
    return np.asarray(adjusted(normal_deviates(null, left, predicted)) < GATE)


def largest_there(keys: Sequence[Key], rho: Array) -> Array:
    """(S,) largest deviate of the statistics of the same group of the same recording."""
    names = [(k.group, k.recording) for k in keys]
    largest: dict[tuple[str, str], float] = {}
    for name, deviate in zip(names, np.abs(rho), strict=True):
        largest[name] = max(largest.get(name, 0.0), float(deviate))
    return np.array([largest[name] for name in names])


def remainder_of(
    null: Null, before: Array, left: Array, predicted: Prediction, where: str = "", when: str = ""
) -> Remainder | None:
    """What residuals (S,) `left` of a prediction hold beyond chance, beside (S,) those of the null model; None where
    they are chance.  where, when: as of `Remainder`."""
    off = is_left(null, left, predicted)
    if not off.any():
        return None
    order = [j for j in np.argsort(-np.abs(left)) if off[j]]
    squares = np.where(off, left**2, 0.0)
    groups = {g: float(sum(squares[[k.group == g for k in null.keys]])) for g in dict.fromkeys(null.keys[j].group for j in order)}
    total = sum(groups.values())
    worst = null.keys[order[0]]
    return Remainder(
        noises=float(np.abs(left[order[0]])),
        share=beyond_chance(null, left) / max(beyond_chance(null, before), 1.0),
        worst=f"{worst.group}: {worst.name}",
        groups={g: s / total for g, s in sorted(groups.items(), key=lambda item: -item[1])},
        recordings=tuple(dict.fromkeys(null.keys[j].recording for j in order)),
        where=where,
        when=when,
    )


def beyond_chance(null: Null, rho: Array) -> float:
    """Sum of squares of residuals (S,) beyond what chance makes, at least 0; by the null's weights."""
    return max(float(np.sum(null.weight * (rho**2 - 1.0))), 0.0)
