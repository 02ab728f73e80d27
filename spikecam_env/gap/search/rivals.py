"""Whether a measurement distinguishes one candidate from another.

Had the other been true, would the first have looked as much better as it does?  The noise of the null's own draws,
added to the other's prediction, makes campaigns in which the other is true.  They show which lead is chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from spikecam_env.gap.compare.distance import APART, residual_and_misfit
from spikecam_env.gap.compare.prediction import Draw, Null, Prediction, own_variance, with_change_scaled
from spikecam_env.gap.compare.step import scale_to
from spikecam_env.types import Floats


def is_rival(null: Null, draws: Sequence[Draw], measured: Floats, best: Prediction, other: Prediction) -> bool:
    """Whether a measurement does not separate one candidate from another.

    It does if the lead of the best is larger than chance makes it in campaigns in which the other is true.

    Args:
        null: the null model, to which both were added.
        draws: campaigns of the model as given; their noise is made as large as that of `null`.
        measured: (S,) statistics, NaN where they take no part.
        best: prediction of the best candidate.
        other: prediction of the other.
    """
    observed = lead(null, measured, best, other)
    if observed < null.settings.deviance.tie:
        return True
    noise = np.array([d.values for d in draws])
    noise = noise - noise.mean(axis=0)
    scatter = noise.std(axis=0, ddof=1)
    noise *= np.maximum(null.sd / np.where(scatter > 0, scatter, np.inf), 1.0)
    middle, own2 = most_likely(null, *(rescaled(null, measured, p) for p in (best, other)))
    noise += np.sqrt(own2) * np.random.default_rng(len(noise)).standard_normal(noise.shape)
    known = np.isfinite(measured)
    by_chance = [lead(null, np.where(known, middle + n, np.nan), best, other) for n in noise]
    above = observed - np.mean(by_chance)
    sd = np.std(by_chance, ddof=1) * np.sqrt(1 + 1 / len(noise))
    return bool(scipy.stats.t.sf(above / max(sd, 1e-9), len(noise) - 1) > null.settings.judging.least_chance)


def most_likely(null: Null, best: Prediction, other: Prediction) -> tuple[Floats, Floats]:
    """The most likely statistics of a candidate: the mean of both where its twins do not differ from the best's.

    Otherwise the chance of its few twins would count as its law.

    Args:
        best: prediction of the best candidate.
        other: prediction of the other.

    Returns:
        ((S,) mean, (S,) its variance).
    """
    apart, own2, others2 = best.mean - other.mean, own_variance(null, other), own_variance(null, best)
    both2 = np.maximum(own2 + others2, 1e-300)
    clearly = np.abs(apart) > APART * np.sqrt(both2)
    share = np.where(clearly, 0.0, own2 / both2)
    return other.mean + share * apart, (1.0 - share) * own2


def lead(null: Null, seen: Floats, best: Prediction, other: Prediction) -> float:
    """Misfit by which `best` is better than `other`, each at the strength that suits `seen` (S,) best.

    Both are judged in the mean of their noises.  Two twins of each do not show which one's campaigns scatter more, and
    the logarithm of the variance would decide.

    Args:
        seen: (S,) statistics.
        best: prediction of one candidate.
        other: prediction of the other.
    """
    both = [rescaled(null, seen, p) for p in (other, best)]
    spread = np.sqrt(np.mean([p.spread**2 for p in both], axis=0))
    left = [residual_and_misfit(null, seen, replace(p, spread=spread))[1] for p in both]
    return left[0] - left[1]


def rescaled(null: Null, seen: Floats, predicted: Prediction) -> Prediction:
    """A prediction with its change from the null scaled to come nearest to the statistics `seen` (S,)."""
    return with_change_scaled(null, predicted, scale_to(null, seen, predicted)[0])
