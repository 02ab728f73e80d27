"""The input of every statistic: a campaign's observations, its conditions, and its own base refit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import ObservedRecording
from spikecam_env.gap.statistics.film import FilmFeatures
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.renamed import old_names
from spikecam_env.types import Floats


@dataclass(frozen=True)
class CampaignReading:
    """One campaign, measured or simulated."""

    observations: Sequence[ObservedRecording]
    conditions: Sequence[Condition]
    base: BaseFit
    """Refitted from these observations and no others."""
    films: Mapping[str, FilmFeatures]
    """Of moving light, by recording (`film.films`)."""

    def expected(self, i: int) -> Floats:
        """(P,) thresholds a frame of recording i, steady light, by the refit; its own rate where light is unknown."""
        condition = self.conditions[i]
        if condition.light is None:
            return self.observations[i].rate
        return self.base.gain * condition.picture + self.base.dark


def root(count: float) -> float:
    """A count on a scale where its Poisson spread is 1 (Anscombe 1948)."""
    return 2.0 * float(np.sqrt(count + 0.375))


def log(value: float, floor: float = 1e-12) -> float:
    """Natural logarithm of a quantity, at least `floor`."""
    return float(np.log(max(value, floor)))


def slope(y: Floats, x: Floats) -> float:
    """Least-squares slope of y on x, both about their means."""
    x = x - x.mean()
    return float((x @ (y - y.mean())) / max(x @ x, 1e-30))


__getattr__ = old_names(__name__, {"Reading": "CampaignReading"})
