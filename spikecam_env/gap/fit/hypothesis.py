"""A hypothesis: a set of effects with their parameters, and how well its prediction suits a measurement."""

from __future__ import annotations

from dataclasses import dataclass

from spikecam_env.gap.compare.prediction import Prediction
from spikecam_env.gap.fit.slopes import NO_SLOPES, Slopes
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats


@dataclass(frozen=True, eq=False, kw_only=True)
class Hypothesis:
    """A model with effects, beside a measurement."""

    model: SensorModel
    base: BaseFit
    """The unit under `model`."""
    prediction: Prediction
    """The prediction of `model`."""
    rho: Floats
    """(S,) residuals, in noise."""
    misfit: float
    """See `distance.residual_and_misfit`."""

    @property
    def effects(self) -> set[str]:
        """Names of the effects of `model`."""
        return {e.name for e in self.model.effects}

    def parameters_of(self, name: str) -> dict[str, float]:
        """All parameters of one of its effects."""
        return next(e for e in self.model.effects if e.name == name).parameters()


@dataclass(frozen=True, eq=False, kw_only=True)
class Fit(Hypothesis):
    """A hypothesis by the candidate that it was made for, at its best fit."""

    name: str
    """The candidate."""
    parameters: dict[str, float]
    sd: dict[str, float]
    """Standard deviations, by parameter."""
    slopes: Slopes = NO_SLOPES
    """Derivatives of the statistics that are known."""

    def added_to(self, model: SensorModel) -> list[str]:
        """Names of the effects that it adds to a model: its own, then those that are fitted with it."""
        has = {self.name, *(e.name for e in model.effects)}
        return [self.name, *(e.name for e in self.model.effects if e.name not in has)]
