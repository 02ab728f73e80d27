"""The other parameters of a candidate, fitted together with its strength.

They cost twins, one a parameter, and are asked for where they can matter alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import is_significant
from spikecam_env.gap.compare.prediction import Prediction
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.fit.coordinates import error_of
from spikecam_env.gap.fit.gauss_newton import COMPARED, Descent, Free, descend
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.fit.recordings import twins_of
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import SensorModel

WORTH = 0.5
"""Of what the best removes: less is not worth another fit, of a start, a shape, or a runner-up of an earlier effect."""


def with_shapes_to_fit(problem: Problem, before: float, fits: Sequence[Fit]) -> list[Fit]:
    """Those of the fits whose other parameters can matter: that remove enough of what the best removes.

    A fit with no other parameter that leaves nothing but chance, and less than they do, is not beaten by more
    parameters.  before: misfit of none.
    """
    least = min((f.misfit for f in fits), default=np.inf)
    simple = min((f for f in fits if not candidate(f.name).has_shapes), key=lambda f: f.misfit, default=None)
    explained = simple is not None and not is_significant(problem.null, simple.rho, simple.prediction)
    enough = simple.misfit if simple and explained else np.inf
    near = before - WORTH * (before - least)
    return [f for f in fits if candidate(f.name).has_shapes and f.misfit < min(near, enough)]


def with_fitted_shapes(problem: Problem, found: Fit, names: Sequence[str] = ()) -> Fit:
    """The fit with all that is fitted of its candidate at its best; or of several effects `names`, at once."""
    names = names or (found.name,)
    only = problem.affected(names, found.prediction.mean - problem.null.mean)
    count = max(twins_of(name) for name in names)

    def probe(there: SensorModel, base: BaseFit) -> Prediction:
        return problem.predict(there, constrained_refit(there, base), count, only)

    free = [(name, key) for name in names for key in candidate(name).fitted]
    end = descend(problem, probe, found.model, found.base, free, COMPARED)
    shaped = where_ended(problem, found, end, free)
    return found if shaped.misfit > found.misfit else shaped


def where_ended(problem: Problem, found: Fit, end: Descent, free: Free) -> Fit:
    """The fit where a descent over the parameters `free`, of other effects too, ended; its own errors."""
    rho, left = problem.residual_and_misfit(end.prediction)
    values = next(e for e in end.model.effects if e.name == found.name).parameters()
    errors = zip(free, np.sqrt(np.diag(end.covariance)), strict=True)
    return replace(
        found,
        parameters={k: values[k] for k in found.parameters},
        sd={k: error_of(name, k, values[k], float(e)) for (name, k), e in errors if name == found.name},
        prediction=end.prediction,
        base=end.base,
        rho=rho,
        misfit=left,
        model=end.model,
    )
