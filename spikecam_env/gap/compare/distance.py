"""How far a measurement lies from a prediction: every statistic in units of its own noise."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
import scipy

from spikecam_env.gap.compare.prediction import Null, Prediction, total_variance
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.types import Floats

HEAVY = 8.0
"""Degrees of freedom of Student's loss: statistics that are far off count by their logarithm, so that a second effect
does not pull the fit of the first."""

CLEAR = 5.0
"""Noises by which a statistic is off that are not chance: of 600 statistics one is, in one campaign of 3000."""

APART = 3.0
"""Noises by which two simulations, or two values of a parameter, differ that are not the same."""

SHOWS = 2 * APART
"""Noises of a change that is clear of the twins' own noise."""


def effect_size(null: Null, measured: Floats, change: Floats) -> float:
    """Largest change among the measured statistics (S,), in units of their noise."""
    return float(np.max(np.where(np.isfinite(measured), np.abs(change), 0.0) / null.noise))


def in_noise(null: Null, values: Floats, mean: Floats | None = None) -> Floats:
    """(S,) how far values lie from a mean, by default the null model's, in the null model's noise; 0 where unknown."""
    return np.nan_to_num((values - (null.mean if mean is None else mean)) / null.noise)


def deviates(null: Null, values: Floats) -> Floats:
    """(S,) normal deviates from Student's t with the freedom of few twins; 0 where unknown."""
    return normal_deviates(null, in_noise(null, values))


def normal_deviates(null: Null, t: Floats, predicted: Prediction | None = None) -> Floats:
    """(S,) normal deviates of distances in noise, of a prediction or of the null model.

    The noise is estimated from few twins, and has more degrees of freedom where part of it is floor.  A distance that n
    drawn units do not show counts as no rarer than 1 in n.

    Args:
        null: the null model.
        t: (S,) distances in noise.
        predicted: that they are of; None: the null model.
    """
    known, freedom = null.sd**2 * (1.0 + 1.0 / null.twins), null.freedom
    if predicted is not None:
        known, freedom = predicted.spread**2 + predicted.error**2, freedom_of(null, predicted)
    freedom = freedom * np.minimum(1.0 + null.floor**2 / np.maximum(known, 1e-300), 100.0) ** 2
    log_p = np.maximum(scipy.stats.t.logsf(np.abs(t), freedom), -800.0)
    if predicted is not None and predicted.units is not None:
        apart = (predicted.units - predicted.mean) / np.sqrt(total_variance(null, predicted))
        log_p = np.maximum(log_p, np.log(np.maximum(share_beyond(t, apart), 1e-300)))
    return np.asarray(np.sign(t) * -scipy.special.ndtri_exp(log_p))


def share_beyond(t: Floats, apart: Floats) -> Floats:
    """(S,) share of drawn units, half at most, that lie as far to the same side as a distance; 0 where none does.

    Outliers of a row pattern come by whole rows: one unit in a hundred has some, which no t distribution describes.

    Args:
        t: (S,) distances in noise.
        apart: (U, S) those of units, NaN where they show nothing.
    """
    beyond = np.sum(np.sign(t) * apart >= np.abs(t), axis=0)
    return np.where(beyond > 0, np.minimum((beyond + 1) / (len(apart) + 1), 0.5), 0.0)


def freedom_of(null: Null, predicted: Prediction) -> Floats:
    """(S,) degrees of freedom of a prediction's spread (Welch and Satterthwaite).

    The null's part has the null's freedom; the excess of the effect's twins has that of few twins, `half_pooled`, or of
    the drawn units.  The excess is pooled over a group: a statistic with a small one by chance gains no freedom.

    Args:
        null: the null model.
        predicted: whose spread it is.
    """
    beyond = np.maximum(predicted.spread / np.maximum(null.sd, 1e-300), 1.0) ** 2 - 1.0
    groups = np.unique([k.group for k in null.keys], return_inverse=True)[1]
    beyond = np.maximum(beyond, (np.bincount(groups, beyond) / np.bincount(groups))[groups])
    kind = Counter((k.group, k.name) for k in null.keys)
    few = max(len(predicted.draws) - 1, 1) / (0.25 + 0.75 / np.array([kind[k.group, k.name] for k in null.keys]))
    if predicted.units is not None:
        few = np.where(np.isfinite(predicted.units[0]), len(predicted.units) - 1, few)
    return np.asarray((1.0 + beyond) ** 2 / (1.0 / null.freedom + beyond**2 / few))


def of_all_recordings(keys: Sequence[StatisticKey], z: Floats, group: str) -> Floats:
    """(n,) normal deviates of each statistic of a group over all recordings together, where z is not 0 (Stouffer): two
    events in every recording are chance in none, and none in all."""
    names = list(dict.fromkeys(k.name for k in keys if k.group == group))
    of = [z[[(k.group, k.name) == (group, name) for k in keys]] for name in names]
    return np.array([v.sum() / np.sqrt(max(int(np.count_nonzero(v)), 1)) for v in of])


def adjusted(z: Floats) -> Floats:
    """(S,) two-sided p-values, adjusted by Holm's step-down for the number of statistics."""
    p = 2.0 * scipy.special.ndtr(-np.abs(z))
    order = np.argsort(p)
    stepped = np.maximum.accumulate(p[order] * (p.size - np.arange(p.size)))
    out = np.empty_like(p)
    out[order] = np.minimum(stepped, 1.0)
    return np.asarray(out)


def is_significant(null: Null, rho: Floats, predicted: Prediction | None = None) -> bool:
    """Whether the residuals of a prediction, or of the null model, are beyond chance."""
    return bool(adjusted(normal_deviates(null, rho, predicted)).min() < null.settings.judging.gate)


def residual(null: Null, measured: Floats, predicted: Prediction) -> Floats:
    """(S,) measured less predicted in noise."""
    return np.nan_to_num((measured - predicted.mean) / np.sqrt(total_variance(null, predicted)))


def residual_and_misfit(null: Null, measured: Floats, predicted: Prediction) -> tuple[Floats, float]:
    """(residual, misfit).  The misfit is a deviance: the heavy-tailed sum of squared residuals, plus the logarithm of
    the variance over the null's.  Without that term a prediction would win by being vague.  Statistics that were not
    measured (NaN, held out) do not count.
    """
    rho = residual(null, measured, predicted)
    wider = (total_variance(null, predicted) - predicted.error**2) / (null.sd**2 + null.floor**2)
    log_variance = np.where(np.isfinite(measured), null.weight * np.log(wider), 0.0)
    return rho, loss(null, rho) + float(log_variance.sum())


def loss(null: Null, rho: Floats) -> float:
    """Heavy-tailed sum of squares of residuals (S,), by the weights of a null model."""
    return robust_squares(rho, null.weight)


def robust_squares(rho: Floats, weight: Floats | float = 1.0) -> float:
    """Heavy-tailed sum of squares (`HEAVY`); about the sum of the weights for noise alone."""
    return float(np.sum(weight * (HEAVY + 1.0) * np.log1p(rho**2 / HEAVY)))
