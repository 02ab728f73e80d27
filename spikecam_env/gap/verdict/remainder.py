"""The remainder: what named effects leave beyond chance, where their law differs in details from the catalogue's.

It is judged where it is left, by group of statistics and recording: what was far off elsewhere makes it no smaller, so
that a strong effect hides no other.  What a mechanism outside of the catalogue leaves of its best stand-in is as large
as what was there in some of them; what the right name of a slightly different law leaves is small in all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.compare.distance import GATE, adjusted, normal_deviates, residual
from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.result import Remainder
from spikecam_env.gap.statistics import Key

Array = NDArray[np.float64]

MOST_LEFT = 0.2
"""Largest distance that a name may leave beyond chance, over the largest before in the same group of statistics of the
same recording; set on the trial's part `tune`."""


def explains(null: Null, values: Array, predicted: Prediction) -> bool:
    """Whether a prediction leaves chance of measured statistics (S,), or little beside what the null model leaves."""
    there = largest_there(null.keys, distance(null, values, null.mean))
    little = np.abs(distance(null, values, predicted.mean)) < MOST_LEFT * there
    return bool(np.all(little, where=is_left(null, values, predicted)))


def remainder_of(null: Null, values: Array, predicted: Prediction, where: str = "", when: str = "") -> Remainder | None:
    """What a prediction leaves of measured statistics (S,) beyond chance; None where it leaves none.  where, when: as
    of `Remainder`."""
    off = is_left(null, values, predicted)
    if not off.any():
        return None
    left = np.where(off, np.abs(residual(null, values, predicted)), 0.0)
    keys = [null.keys[j] for j in np.argsort(-left, kind="stable")[: int(off.sum())]]
    groups = {
        g: float(np.sum(left[[k.group == g for k in null.keys]] ** 2)) for g in dict.fromkeys(k.group for k in keys)
    }
    before, after = (beyond_chance(null, distance(null, values, mean)) for mean in (null.mean, predicted.mean))
    return Remainder(
        noises=float(left.max()),
        share=after / max(before, 1.0),
        worst=f"{keys[0].group}: {keys[0].name}",
        groups={g: s / sum(groups.values()) for g, s in sorted(groups.items(), key=lambda item: -item[1])},
        recordings=tuple(dict.fromkeys(k.recording for k in keys)),
        where=where,
        when=when,
    )


def is_left(null: Null, values: Array, predicted: Prediction) -> NDArray[np.bool_]:
    """(S,) which of measured statistics a prediction leaves off, beyond chance and what laws are known to at all."""
    return np.asarray(adjusted(normal_deviates(null, residual(null, values, predicted), predicted)) < GATE)


def distance(null: Null, values: Array, mean: Array) -> Array:
    """(S,) measured less predicted, in the noise of the null model; 0 where unknown.  Not in that of the prediction:
    its law is taken to be good to a share of what it changes, and what it leaves would look small beside that."""
    return np.nan_to_num((values - mean) / null.noise)


def largest_there(keys: Sequence[Key], distances: Array) -> Array:
    """(S,) the largest of (S,) distances in the same group of the same recording."""
    places = [(k.group, k.recording) for k in keys]
    largest = dict.fromkeys(places, 0.0)
    for place, d in zip(places, np.abs(distances), strict=True):
        largest[place] = max(largest[place], float(d))
    return np.array([largest[place] for place in places])


def beyond_chance(null: Null, distances: Array) -> float:
    """Sum of squares of distances (S,) beyond what chance makes, at least 0; by the null's weights."""
    return max(float(np.sum(null.weight * (distances**2 - 1.0))), 0.0)
