"""The remainder: the distance that named effects leave beyond chance, where their law differs from the catalogue's.

It is judged in total, and by group of statistics and recording.  So a strong effect hides no other one elsewhere.  The
best stand-in of a mechanism outside of the catalogue may take 99.9 % of the sum of squares.  Yet it leaves some group
of some recording unchanged.  The right name of a slightly different law does not.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.compare.distance import adjusted, in_noise, loss, normal_deviates, residual
from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.result import Remainder
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.types import Floats


def explains(null: Null, values: Floats, predicted: Prediction) -> bool:
    """Whether a prediction leaves nothing of measured statistics (S,) but chance, or a remainder.

    A remainder is a small share of the null model's distance in total (`most_left`), and in every group of every
    recording (`most_left_there`).  Both are in the noise of the null model: the noise of the prediction contains a
    share of its change, and would make the remainder look small.

    Args:
        values: (S,) measured statistics.
    """
    off, limits = is_left(null, values, predicted), null.settings.concluding
    before, after = (in_noise(null, values, mean) for mean in (null.mean, predicted.mean))
    at_first = sums_by_place(null.keys, before**2 - 1.0)
    little = sums_by_place(null.keys, np.where(off, after**2, 0.0)) <= limits.most_left_there * np.maximum(
        at_first, 1.0
    )
    deviance = [robust_beyond_chance(null, rho) for rho in (before, residual(null, values, predicted))]
    return bool(not off.any() or (np.all(little) and deviance[1] < limits.most_left * deviance[0]))


def remainder_of(
    null: Null, values: Floats, predicted: Prediction, where: str = "", when: str = ""
) -> Remainder | None:
    """The remainder of a prediction; None where it leaves no more than chance.

    Args:
        values: (S,) measured statistics.
        where: part of the array, for `Remainder`.
        when: part of the time, for `Remainder`.
    """
    off = is_left(null, values, predicted)
    if not off.any():
        return None
    left = np.where(off, np.abs(residual(null, values, predicted)), 0.0)
    keys = [null.keys[j] for j in np.argsort(-left, kind="stable")[: int(off.sum())]]
    groups = {
        g: float(np.sum(left[[k.group == g for k in null.keys]] ** 2)) for g in dict.fromkeys(k.group for k in keys)
    }
    before, after = (beyond_chance(null, in_noise(null, values, mean)) for mean in (null.mean, predicted.mean))
    return Remainder(
        noises=float(left.max()),
        share=after / max(before, 1.0),
        worst=f"{keys[0].group}: {keys[0].name}",
        groups={g: s / sum(groups.values()) for g, s in sorted(groups.items(), key=lambda item: -item[1])},
        recordings=tuple(dict.fromkeys(k.recording for k in keys)),
        where=where,
        when=when,
    )


def is_left(null: Null, values: Floats, predicted: Prediction) -> NDArray[np.bool_]:
    """(S,) whether a statistic is off the prediction by more than chance and the accuracy of laws."""
    p = adjusted(normal_deviates(null, residual(null, values, predicted), predicted))
    return np.asarray(p < null.settings.judging.gate)


def squares_left(null: Null, values: Floats, predicted: Prediction) -> float:
    """Sum of squares, in the null model's noise, of the measured statistics (S,) that a prediction leaves off."""
    return float(np.sum(in_noise(null, values, predicted.mean)[is_left(null, values, predicted)] ** 2))


def sums_by_place(keys: Sequence[StatisticKey], squares: Floats) -> Floats:
    """(S,) sum of (S,) squares over the same group of statistics of the same recording."""
    places = [(k.group, k.recording) for k in keys]
    of = {place: i for i, place in enumerate(dict.fromkeys(places))}
    place = np.array([of[p] for p in places])
    return np.asarray(np.bincount(place, squares)[place])


def robust_beyond_chance(null: Null, rho: Floats) -> float:
    """Deviance of residuals (S,) less that of chance; a large residual counts by its logarithm."""
    return loss(null, rho) - float(np.sum(null.weight * np.ones(len(rho))))


def beyond_chance(null: Null, distances: Floats) -> float:
    """Sum of squares of distances (S,) less that of chance, at least 0; by the null's weights."""
    return max(float(np.sum(null.weight * (distances**2 - 1.0))), 0.0)
