"""Made-up searches: rounds that added effects, by the changes that they made."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import small

from spikecam_env.gap.compare.distance import robust_squares
from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.fit.hypothesis import Hypothesis
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.verdict.degree import Explanation, explanation_of
from spikecam_env.sensor import CATALOGUE

Ahead = dict[str, float]


def given(mean: np.ndarray) -> Prediction:
    """A prediction of a mean (S,), of noise 1."""
    return Prediction(mean, np.zeros(len(mean)), np.ones(len(mean)))


def explained(
    null: Null, values: np.ndarray, *changes: np.ndarray, margin: float | tuple[float, ...] | tuple[Ahead, ...] = 0.9
) -> Explanation:
    """The explanation of values (S,) by effects that change the statistics one after the other.

    Args:
        margin: of each, or how far it is ahead of each other candidate of its round.
    """
    margins = margin if isinstance(margin, tuple) else (margin,) * len(changes)
    model, mean, rounds = small.MODEL, np.zeros(len(values)), []

    def turn(**own: Any) -> Round:
        left = values - mean
        at = Hypothesis(model=model, base=small.unit(), prediction=given(mean), rho=left, misfit=robust_squares(left))
        return Round(at, **own)

    for name, change, own in zip(("dead_time", "crosstalk"), changes, margins, strict=False):
        rounds.append(turn(fits=(SimpleNamespace(name=name),), ahead=own if isinstance(own, dict) else {"": own}))
        model, mean = model.with_effect(CATALOGUE[name]()), mean + change
    return explanation_of(null, values, [*rounds, turn()])
