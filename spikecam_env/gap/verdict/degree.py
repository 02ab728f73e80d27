"""How much of a difference the named effects explain, on one scale.

    explains all           chance is left
    explains nearly all    the names are right; their laws differ in detail from the catalogue's
    largest of several     the names are right; something else is there as well
    unknown                no name is shown to be right

Two numbers show that a name is right.

    margin    of the misfit that the effect removes, the share that no other candidate of its round removes;
              another effect of the final model is no other candidate
    missed    squares that are left over those of the effects' changes, in the worst of the places that they change

Where only some of the effects have a margin, these are among several, and the others stand for something else.

A place is a group of statistics of a recording.  It counts by the change that the effects make there, each by itself,
and not by the difference that was there: a place that an effect does not change says nothing about its name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.compare.distance import CLEAR, in_noise
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.result import EXPLAINS_ALL, EXPLAINS_NEARLY_ALL, LARGEST, UNKNOWN
from spikecam_env.gap.search.round import Round, adding
from spikecam_env.gap.settings import Concluding
from spikecam_env.gap.verdict.remainder import is_left, share_left, sums_by_place
from spikecam_env.types import Floats

HALF = 0.5
"""Of the squares: the largest of several effects leaves no more than it explains.  Beside stand-ins it leaves a small
share, `Concluding.most_left`: where they do not help, it may be one of them."""

LEAST_SHARE = 0.1
"""Of the misfit that all effects remove, removed by one that is named beside stand-ins: less may be details of the law
that these stand for (part `tune` of the blind trial)."""


@dataclass(frozen=True)
class Explanation:
    """The part of a difference that the effects of a search explain."""

    degree: str
    """One of `DEGREES`."""
    names: tuple[str, ...] = ()
    """Effects whose names have a margin; of a model that explains all, every one."""
    stand_ins: tuple[str, ...] = ()
    """The other effects."""
    left: float = 0.0
    """Share of the squares beyond chance that is left (`remainder.share_left`)."""
    missed: float = 0.0
    """Squares that are left over those of the effects' changes, in the worst of the places that they change."""
    margin: float = 1.0
    """The least margin of an effect."""

    def fault(self, limits: Concluding) -> str:
        """Why no name is shown to be right; empty where one is."""
        if self.missed > limits.most_missed:
            return "somewhere it leaves as much as it changes"
        if self.left > (limits.most_left if self.stand_ins else HALF):
            return f"it leaves {self.left:.0%} of the squares"
        return "" if self.names else f"another candidate explains {1.0 - self.margin:.0%} as much"


def explanation_of(null: Null, values: Floats, rounds: Sequence[Round]) -> Explanation:
    """The part of measured statistics that the effects of all rounds explain.

    Args:
        null: the null model.
        values: (S,) measured statistics.
        rounds: of a search, the last with the final model.
    """
    last, steps, limits = rounds[-1].start.prediction, adding(rounds), null.settings.concluding
    off = is_left(null, values, last)
    every = tuple(r.fits[0].name for r, _ in steps)
    if not off.any():
        return Explanation(EXPLAINS_ALL, every)
    left, after = share_left(null, values, last), in_noise(null, values, last.mean)
    changes = squares_changed(null, rounds)
    shares = sums_by_place(null.keys, np.where(off, after**2, 0.0)) / np.maximum(sums_by_place(null.keys, changes), 1.0)
    missed = float(np.max(np.where(shows_there(null, changes), shares, 0.0)))
    names = right_names(rounds, limits)
    stand_ins = tuple(name for name in every if name not in names)
    degree = LARGEST if stand_ins or left > limits.most_left else EXPLAINS_NEARLY_ALL
    explained = Explanation(degree, names, stand_ins, left, missed, min(margins_of(rounds), default=0.0))
    return replace(explained, degree=UNKNOWN) if explained.fault(limits) else explained


def right_names(rounds: Sequence[Round], limits: Concluding) -> tuple[str, ...]:
    """Effects with a margin; beside effects without one, those that also remove a share of the misfit."""
    steps = adding(rounds)
    both = zip(steps, margins_of(rounds), strict=True)
    having = [step for step, margin in both if margin >= limits.least_margin]
    least = LEAST_SHARE * (rounds[0].start.misfit - rounds[-1].start.misfit) if len(having) < len(steps) else -np.inf
    return tuple(r.fits[0].name for r, after in having if r.start.misfit - after.start.misfit >= least)


def margins_of(rounds: Sequence[Round]) -> list[float]:
    """The margin of each effect of the last model, in the order of their rounds."""
    return [r.margin(rounds[-1].start.effects) for r, _ in adding(rounds)]


def squares_changed(null: Null, rounds: Sequence[Round]) -> Floats:
    """(S,) sum over effects of the square of each one's change, in the null model's noise."""
    steps = adding(rounds)
    means = [(r.start.prediction.mean, after.start.prediction.mean) for r, after in steps]
    changes = [np.nan_to_num((after - before) / null.noise) for before, after in means]
    return np.asarray(np.sum(np.square(changes), axis=0) if changes else np.zeros(len(null.keys)))


def shows_there(null: Null, squares: Floats) -> NDArray[np.bool_]:
    """(S,) whether a statistic is of a place that is changed clearly: by CLEAR noises of the sum of its squares.

    Args:
        null: the null model.
        squares: (S,) squares of the change, in noise.
    """
    count = sums_by_place(null.keys, np.ones(len(null.keys)))
    return np.asarray(sums_by_place(null.keys, squares) >= CLEAR**2 * np.sqrt(count))
