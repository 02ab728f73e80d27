"""The remainder: the distance that named effects leave beyond chance, its place and its look."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.compare.distance import adjusted, in_noise, normal_deviates, residual
from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.result import Remainder
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.verdict.structure import is_common, marks_of, weight_by_group
from spikecam_env.gap.verdict.where_and_when import when, where
from spikecam_env.types import Floats

KINDS = {
    "dark": "the dark",
    "picture": "static pictures",
    "unknown": "static scenes",
    "step": "the step of light",
    "moving": "moving light",
}
"""Kinds of recordings in words; of flats see `light_in_words`."""

LOOKS = {"history": "a memory of earlier light", "neighbours": "a coupling of neighbours", "clock": "the clock's phase"}
"""Marks of statistics (`structure.marks_of`) in words."""


def remainder_of(case: Case, null: Null, values: Floats, predicted: Prediction) -> Remainder | None:
    """The remainder of a prediction; None where it leaves no more than chance.

    Args:
        case: the measurement.
        null: the null model.
        values: (S,) measured statistics.
        predicted: under the model with the named effects.
    """
    off = is_left(null, values, predicted)
    if not off.any():
        return None
    left = np.where(off, np.abs(residual(null, values, predicted)), 0.0)
    keys = [null.keys[j] for j in np.argsort(-left, kind="stable")[: int(off.sum())]]
    groups = {
        g: float(np.sum(left[[k.group == g for k in null.keys]] ** 2)) for g in dict.fromkeys(k.group for k in keys)
    }
    recordings = tuple(dict.fromkeys(k.recording for k in keys))
    marks = [words for mark, words in LOOKS.items() if marks_of(keys)[mark]]
    return Remainder(
        noises=float(left.max()),
        share=share_left(null, values, predicted),
        worst=f"{keys[0].group}: {keys[0].name}",
        groups={g: s / sum(groups.values()) for g, s in sorted(groups.items(), key=lambda item: -item[1])},
        recordings=recordings,
        light=light_in_words(case.conditions, recordings),
        looks=("common to many pixels" if is_common(weight_by_group(null, left)) else "pixel by pixel", *marks),
        where=where(case),
        when=when(case),
    )


def light_in_words(conditions: Sequence[Condition], names: Sequence[str]) -> tuple[str, ...]:
    """Kinds of light of some recordings; flats are dim or bright where all of them are below or above the median.

    Args:
        conditions: of all recordings.
        names: of some of them.
    """
    flats = {c.name: c.level for c in conditions if c.kind == "flat"}
    own = [level for name, level in flats.items() if name in names]
    middle = float(np.median(list(flats.values()))) if flats else 0.0
    which = "dim " if own and max(own) < middle else "bright " if own and min(own) > middle else ""
    kinds = dict.fromkeys(c.kind for c in conditions if c.name in names)
    return tuple(KINDS.get(kind, f"the {which}flats") for kind in kinds)


def is_left(null: Null, values: Floats, predicted: Prediction) -> NDArray[np.bool_]:
    """(S,) whether a statistic is off the prediction by more than chance and the accuracy of laws."""
    p = adjusted(normal_deviates(null, residual(null, values, predicted), predicted))
    return np.asarray(p < null.settings.judging.gate)


def share_left(null: Null, values: Floats, predicted: Prediction) -> float:
    """Squares of statistics (S,) that a prediction leaves off, over those beyond chance that there were.

    Both are in the null model's noise: the noise of the prediction contains a share of its change, and would make the
    rest look small.
    """
    off, after = is_left(null, values, predicted), in_noise(null, values, predicted.mean)
    before = float(np.sum(null.weight * (in_noise(null, values) ** 2 - 1.0)))
    return float(np.sum(null.weight * np.where(off, after**2, 0.0))) / max(before, 1.0)


def squares_left(null: Null, values: Floats, predicted: Prediction) -> float:
    """Sum of squares, in the null model's noise, of the measured statistics (S,) that a prediction leaves off."""
    return float(np.sum(in_noise(null, values, predicted.mean)[is_left(null, values, predicted)] ** 2))


def sums_by_place(keys: Sequence[StatisticKey], squares: Floats) -> Floats:
    """(S,) sum of (S,) squares over the same group of statistics of the same recording."""
    places = [(k.group, k.recording) for k in keys]
    of = {place: i for i, place in enumerate(dict.fromkeys(places))}
    place = np.array([of[p] for p in places])
    return np.asarray(np.bincount(place, squares)[place])
