"""A search on made-up statistics: problems whose misfits are listed, and twins by a law."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import chain
from types import SimpleNamespace

import numpy as np
from small import MODEL, effect, unit

from spikecam_env.gap.candidates.strength import with_effect
from spikecam_env.gap.compare.prediction import Draw, Null, Prediction
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.settings import DiagnosisSettings
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.sensor import CATALOGUE

COUNT, TWINS = 20, 6
NAME = "incomplete_reset"
FREE = [(NAME, "fraction"), (NAME, "tau_us")]


def null(settings: DiagnosisSettings | None = None) -> Null:
    """COUNT statistics of rates, each of noise 1."""
    values = np.random.default_rng(0).standard_normal((TWINS, COUNT))
    draws = tuple(Draw(n, v, None) for n, v in enumerate(values))
    keys = tuple(StatisticKey("rates", "r", str(i)) for i in range(COUNT))
    mean, one = values.mean(axis=0), np.ones(COUNT)
    there = settings or DiagnosisSettings()
    return Null(keys, mean, one, np.zeros(COUNT), TWINS, TWINS - 1, draws=draws, settings=there)


def with_reset(fraction: float):
    """The model with an incomplete reset."""
    return with_effect(MODEL, NAME, {"fraction": fraction, "tau_us": 300.0})


def law(model) -> np.ndarray:
    """Half of the statistics in proportion to the fraction, as many to its product with a root of the time constant."""
    there = next((e.parameters() for e in model.effects if e.name == NAME), {"fraction": 0.0, "tau_us": 300.0})
    power = np.where(np.arange(COUNT) < COUNT // 2, 0.0, 0.5)
    return 20.0 * there["fraction"] / 0.02 * (there["tau_us"] / 300.0) ** power


@dataclass(frozen=True, eq=False)
class Scripted(Problem):
    """Misfits as they are listed, one after another, and twins by a law."""

    script: object = None
    predicted: list[float] = field(default_factory=list)
    """Fractions that were simulated."""
    counts: list[int] = field(default_factory=list)
    """Of the twins each time."""

    def misfit(self, predicted=None) -> float:
        """The next of the list."""
        return next(self.script)

    def predict(self, model, base, count, only=None) -> Prediction:
        """A twin by the law."""
        self.predicted.append(next((e.parameters()["fraction"] for e in model.effects if e.name == NAME), 0.0))
        self.counts.append(count)
        values = self.null.mean + law(model)
        return Prediction(values, np.full(COUNT, 0.4), self.null.sd, (Draw(TWINS - 1, values, None),))

    def affected(self, names, change=None) -> list[int]:
        """One recording."""
        return [0]


def scripted(*misfits, settings: DiagnosisSettings | None = None, fraction: float = 0.02) -> Scripted:
    """A problem with an incomplete reset to find."""
    n = null(settings)
    measured = n.mean + law(with_reset(fraction))
    case = SimpleNamespace(jobs=1, base=unit(), conditions=())
    return Scripted(case, MODEL, n, measured, measured, script=chain(*misfits))


def found_at(fraction: float, misfit: float) -> Fit:
    """A fit of the reset."""
    n, there = null(), with_reset(fraction)
    prediction = Prediction(n.mean + law(there), n.sd, n.sd)
    return Fit(NAME, {"fraction": fraction, "tau_us": 300.0}, {}, prediction, unit(), np.zeros(COUNT), misfit, there)


def some_fit(name: str, misfit: float) -> Fit:
    """A fit of any effect, or of a name that is none."""
    model = MODEL.with_effect(effect(name)) if name in CATALOGUE else MODEL
    return replace(found_at(0.02, misfit), name=name, model=model)
