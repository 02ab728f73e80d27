"""The other parameters of a candidate, fitted together with its strength.

They cost twins, one a parameter, and are asked for where they can matter alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.candidates.table import candidate, is_pattern
from spikecam_env.gap.compare.distance import alarmed, judged
from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.fit.candidate import Fit, concerned, predict, twins_of
from spikecam_env.gap.fit.gauss_newton import descend
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]

HALF = 0.5
"""Share of what the best fit removes that one has to remove for its shape to be worth fitting."""

TELLS = 5.0
"""Misfit for which a step is worth its twins here: less does not put candidates in another order."""


def has_shapes(name: str) -> bool:
    """Whether more is fitted of a candidate, by simulation, than its strength."""
    return len(candidate(name).fitted) > 1 and not is_pattern(name) and not candidate(name).wanders


def worth_shaping(null: Null, before: float, fits: Sequence[Fit]) -> list[Fit]:
    """Those of the fits whose other parameters can matter; before: misfit of none.

    One with no other parameter that leaves nothing but chance, and less than they do, is not beaten by more parameters.
    """
    least = min((f.misfit for f in fits), default=np.inf)
    simple = min((f for f in fits if not has_shapes(f.name)), key=lambda f: f.misfit, default=None)
    enough = simple.misfit if simple and not alarmed(null, simple.rho, simple.prediction) else np.inf
    near = before - HALF * (before - least)
    return [f for f in fits if has_shapes(f.name) and f.misfit < min(near, enough)]


def shaped(case: Case, model: SensorModel, null: Null, measured: Array, found: Fit) -> Fit:
    """The fit with all that is fitted of its candidate at its best; model, null: what it was added to."""
    only = concerned(case, [found.name], null, measured, found.prediction.mean - null.mean)

    def probe(there: SensorModel, base: BaseFit) -> Prediction:
        return predict(case, there, constrained_refit(there, base), null, twins_of(found.name), only)

    names = candidate(found.name).fitted
    free = [(found.name, key) for key in names]
    end = descend(probe, null, measured, found.model, found.base, free, case.jobs, TELLS)
    rho, left = judged(null, measured, end.prediction)
    if left > found.misfit:
        return found
    values = next(e for e in end.model.effects if e.name == found.name).parameters()
    errors = np.sqrt(np.diag(end.covariance))
    return replace(
        found,
        parameters={k: values[k] for k in found.parameters},
        sd={k: float(abs(values[k]) * e) for k, e in zip(names, errors, strict=True)},
        prediction=end.prediction,
        base=end.base,
        rho=rho,
        misfit=left,
        model=end.model,
    )
