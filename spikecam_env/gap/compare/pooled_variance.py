"""Moderated variances: a variance from few twins is combined with those of similar statistics.

Empirical Bayes as in Smyth, "Linear models and empirical Bayes methods for assessing differential expression in
microarray experiments", 2004, but for logarithms: those of one kind are normal about the kind's own, as closely as
their scatter beyond chance shows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
import scipy

from spikecam_env.gap.statistics import StatisticKey, floor_family
from spikecam_env.types import Floats

FEWEST_FREEDOM = 4
"""Degrees of freedom of a scatter from which the spread of variances within a kind is estimated, at least."""

MOST_FREEDOM = 2000.0
"""Degrees of freedom of a variance at most."""


def moderated(keys: Sequence[StatisticKey], variances: Floats, freedom: float) -> tuple[Floats, Floats]:
    """Variances drawn to those of their kind.

    A kind is the same statistic of all recordings.  The agreement within kinds is estimated from all kinds that share a
    floor (`floor_family`), with or without a factor for each recording, as some have more spikes than others.  A
    variance of 0, or of one recording alone, stays.

    Args:
        keys: (S,) statistics.
        variances: (S,) sample variances.
        freedom: degrees of freedom of each.

    Returns:
        ((S,) variances, (S,) degrees of freedom).
    """
    out, degrees = variances.copy(), np.full(len(keys), float(freedom))
    several = Counter((k.group, k.name) for k, v in zip(keys, variances, strict=True) if v > 0)
    families: dict[tuple[str, str], list[int]] = {}
    for i, key in enumerate(keys):
        if variances[i] > 0 and several[key.group, key.name] > 1:
            families.setdefault(floor_family(key), []).append(i)
    logs = np.log(np.where(variances > 0, variances, 1.0)) - bias(freedom)
    chance = float(scipy.special.polygamma(1, freedom / 2))
    for of in families.values():
        kinds, recordings = one_of_each([keys[i].name for i in of]), one_of_each([keys[i].recording for i in of])
        fits = [shrunk(logs[of], like, chance) for like in (kinds, np.hstack([kinds, recordings]))]
        joint, error = min(fits, key=lambda f: f[1])
        if error < chance:
            degrees[of] = freedom_of_variance(error)
            out[of] = np.exp(joint + bias(degrees[of[0]]))
    return out, degrees


def one_of_each(names: Sequence[str]) -> Floats:
    """(S, n) 1 where a statistic has that name."""
    return np.array([[name == other for other in dict.fromkeys(names)] for name in names], dtype=np.float64)


def shrunk(logs: Floats, like: Floats, chance: float) -> tuple[Floats, float]:
    """Logarithms drawn to those like them.

    Args:
        logs: (S,) logarithms.
        like: (S, n) kinds that each belongs to.
        chance: variance of each by itself.

    Returns:
        ((S,) logarithms, the variance of their error).
    """
    fitted = like @ np.linalg.lstsq(like, logs)[0]
    parameters = int(np.linalg.matrix_rank(like))
    known = len(logs) - parameters
    if known < FEWEST_FREEDOM:
        return logs, chance
    scatter = float(np.sum((logs - fitted) ** 2)) / known
    share = chance / max(scatter, chance)
    return share * fitted + (1 - share) * logs, chance * (1 - share * known / len(logs))


def bias(freedom: float) -> float:
    """Mean of the logarithm of a sample variance, less the logarithm of the variance."""
    return float(scipy.special.digamma(freedom / 2) - np.log(freedom / 2))


def freedom_of_variance(variance: float) -> float:
    """Degrees of freedom of a sample variance of which the logarithm has so much variance; MOST_FREEDOM at most."""
    if variance <= scipy.special.polygamma(1, MOST_FREEDOM / 2):
        return MOST_FREEDOM
    log_half = scipy.optimize.brentq(lambda x: np.log(scipy.special.polygamma(1, np.exp(x)) / variance), -20.0, 10.0)
    return 2.0 * float(np.exp(log_half))
