"""Variances from few twins, moderated: what they say of one statistic is joined with what they say of its like.

Empirical Bayes as in Smyth, "Linear models and empirical Bayes methods for assessing differential expression in
microarray experiments", 2004, but for logarithms: those of one kind are normal about the kind's own, and how closely
is read off their scatter beyond chance.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.optimize import brentq

from spikecam_env.gap.statistics import Key, alike

Array = NDArray[np.float64]

FEWEST = 4
"""Degrees of freedom of a scatter that says how alike variances are."""

SURE = 2000.0
"""Degrees of freedom of a variance at most."""


def moderated(keys: Sequence[Key], variances: Array, freedom: float) -> tuple[Array, Array]:
    """((S,) variances, (S,) degrees of freedom) from (S,) sample variances with `freedom` each.

    A statistic's kind is the same one of all recordings; how alike a kind's variances are is told by all kinds that
    share a floor (`alike`).  What never varied, or is of one recording alone, stays as it is.
    """
    out, degrees = variances.copy(), np.full(len(keys), float(freedom))
    kinds: dict[tuple[str, str], list[int]] = {}
    for i, key in enumerate(keys):
        if variances[i] > 0:
            kinds.setdefault((key.group, key.name), []).append(i)
    families: dict[tuple[str, str], list[list[int]]] = {}
    for (group, name), of in kinds.items():
        if len(of) > 1:
            families.setdefault(alike(Key(group, "", name)), []).append(of)
    logs = np.log(np.where(variances > 0, variances, 1.0)) - bias(freedom)
    chance = float(special.polygamma(1, freedom / 2))
    for family in families.values():
        known = sum(len(of) - 1 for of in family)
        if known < FEWEST:
            continue
        scatter = sum(float(np.sum((logs[of] - logs[of].mean()) ** 2)) for of in family) / known
        share = chance / max(scatter, chance)
        joint = worth(chance * (1 - share))
        for of in family:
            out[of] = np.exp(share * logs[of].mean() + (1 - share) * logs[of] + bias(joint))
            degrees[of] = joint
    return out, degrees


def bias(freedom: float) -> float:
    """Mean of the logarithm of a sample variance, less the logarithm of the variance."""
    return float(special.digamma(freedom / 2) - np.log(freedom / 2))


def worth(variance: float) -> float:
    """Degrees of freedom of a sample variance of which the logarithm has so much variance; SURE at most."""
    if variance <= special.polygamma(1, SURE / 2):
        return SURE
    return 2.0 * float(np.exp(brentq(lambda x: np.log(special.polygamma(1, np.exp(x)) / variance), -20.0, 10.0)))
