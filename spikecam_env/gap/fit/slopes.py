"""Derivatives of the statistics by parameters' coordinates: a descent begins with those that are known.

Known are those of the descent that it follows, of the same effects.  An effect that changes statistics in proportion to
its only parameter needs no descent for them: its change is its derivative by the logarithm.  Of a mixed response it is
not: crosstalk adds coincidences in proportion, and noise with a higher power.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.compare.step import change_of
from spikecam_env.gap.fit.coordinates import error_of, is_apart
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats

UNIT = "the unit"
"""Its own parameters stand under this name among parameters by effect and name."""

NEAR = 0.5
"""Step of a logarithm beyond which derivatives are taken anew."""

Free = Sequence[tuple[str, str]]
"""Parameters by effect and name."""


@dataclass(frozen=True, eq=False)
class Slopes:
    """Derivatives of the statistics by parameters' coordinates."""

    free: tuple[tuple[str, str], ...]
    """The n parameters, by effect and name."""
    columns: Floats
    """(S, n) change of each statistic for one more of each coordinate."""
    noise: Floats
    """(S, n) standard deviations of `columns`."""
    at: tuple[float, ...] = ()
    """(n,) values of the parameters where they were taken."""
    once: bool = False
    """Whether they were taken once, at the fit, since not all parameters were descended."""

    @classmethod
    def of_descent(cls, model: SensorModel, free: Free, columns: Floats, noise: Floats) -> Slopes:
        """Derivatives at the end of a descent of a model, or at a model."""
        return cls(tuple(free), columns, noise, values_in(model, free))

    @classmethod
    def by_proportion(cls, null: Null, seen: Floats, name: str, model: SensorModel, predicted: Prediction) -> Slopes:
        """The derivative by an effect's only parameter (`is_in_proportion`).

        Args:
            null: the prediction without the effect.
            seen: (S,) measured statistics.
            name: of the effect.
            model: with the effect.
            predicted: of the model.
        """
        free = [(name, candidate(name).strength)]
        change, noise, clear = change_of(null, seen, predicted, null.prediction)
        return cls.of_descent(model, free, np.where(clear, change, 0.0)[:, None], noise[:, None])

    def near(self, model: SensorModel, free: Free) -> Slopes:
        """Those of the parameters `free` whose effects have nearly the same parameters in a model, and all of them."""
        then, now = dict(zip(self.free, self.at, strict=True)), dict(zip(free, values_in(model, free), strict=True))
        far = {f[0] for f in free if f[0] == UNIT or f not in then or not are_alike(f, then[f], now[f], NEAR)}
        return self.of([f for f in free if f[0] not in far])

    def of(self, free: Free) -> Slopes:
        """Those of some of its parameters."""
        which = [self.free.index(f) for f in free]
        return Slopes(
            tuple(free), self.columns[:, which], self.noise[:, which], tuple(self.at[i] for i in which), self.once
        )

    def beside(self, other: Slopes) -> Slopes:
        """Its derivatives, and those of another's parameters that it lacks."""
        more = other.of([f for f in other.free if f not in self.free])
        if not (self.free and more.free):
            return self if self.free else more
        columns, noise = np.hstack([self.columns, more.columns]), np.hstack([self.noise, more.noise])
        return Slopes(self.free + more.free, columns, noise, self.at + more.at, self.once)


NO_SLOPES = Slopes((), np.zeros((0, 0)), np.zeros((0, 0)))
"""Of no parameter."""


def values_in(model: SensorModel, free: Free) -> tuple[float, ...]:
    """Values of parameters in a model; of the unit's own NaN."""
    has = {e.name: e.parameters() for e in model.effects}
    return tuple(float("nan") if name == UNIT else float(has[name][key]) for name, key in free)


def is_in_proportion(name: str) -> bool:
    """Whether an effect has one parameter, which statistics are in proportion to."""
    effect = candidate(name)
    return effect.is_linear and len(effect.fitted) == 1


def are_alike(parameter: tuple[str, str], one: float, other: float, step: float) -> bool:
    """Whether two values of an effect's parameter differ by less than a step of its coordinate."""
    return not is_apart(*parameter, one, other, error_of(*parameter, other, step))
