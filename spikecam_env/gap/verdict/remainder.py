"""The remainder: what named effects leave beyond chance, where their law differs in details from the catalogue's.

It is judged in all, and where it is left, by group of statistics and recording: what was far off elsewhere makes it no
smaller there, so that a strong effect hides no other.  The best stand-in of a mechanism outside of the catalogue may
take 99.9 % of the sum of squares, and yet leaves some group of some recording as it was; the right name of a slightly
different law does not.
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

    A remainder is small in all (`most_left`) and wherever it is left (`most_left_there`), beside what the null model
    leaves.  Both are measured in the noise of the null model: that of the prediction contains a share of the change
    that it predicts, so that what it leaves would look small.
    """
    off, limits = is_left(null, values, predicted), null.settings.concluding
    before, after = (in_noise(null, values, mean) for mean in (null.mean, predicted.mean))
    there = sums_by_place(null.keys, before**2 - 1.0)
    little = sums_by_place(null.keys, np.where(off, after**2, 0.0)) <= limits.most_left_there * np.maximum(there, 1.0)
    deviance = [robust_beyond_chance(null, rho) for rho in (before, residual(null, values, predicted))]
    return bool(not off.any() or (np.all(little) and deviance[1] < limits.most_left * deviance[0]))


def remainder_of(
    null: Null, values: Floats, predicted: Prediction, where: str = "", when: str = ""
) -> Remainder | None:
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
    """(S,) which of measured statistics a prediction leaves off, beyond chance and what laws are known to at all."""
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
    """Deviance of residuals (S,) beyond what chance makes: one that is far off counts by its logarithm."""
    return loss(null, rho) - float(np.sum(null.weight * np.ones(len(rho))))


def beyond_chance(null: Null, distances: Floats) -> float:
    """Sum of squares of distances (S,) beyond what chance makes, at least 0; by the null's weights."""
    return max(float(np.sum(null.weight * (distances**2 - 1.0))), 0.0)
