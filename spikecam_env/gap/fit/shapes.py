"""The other parameters of a candidate, fitted together with its strength.

They cost twins, one a parameter, and are fitted only where they can matter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import is_significant
from spikecam_env.gap.fit.coordinates import error_of
from spikecam_env.gap.fit.gauss_newton import COMPARED, Descent, Free, descend, probe_of, spreads_of
from spikecam_env.gap.fit.hypothesis import Fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.fit.recordings import twins_of

WORTH = 0.5
"""Of what the best removes: less is not worth another fit, of a start, a shape, or a runner-up of an earlier effect."""


def with_shapes_to_fit(problem: Problem, before: float, fits: Sequence[Fit]) -> list[Fit]:
    """Fits whose other parameters can matter: they remove a share (`Searching.worth`) of the best's misfit.

    None of them where a fit without other parameters leaves less, and no more than chance.

    Args:
        before: misfit of the model itself.
    """
    least = min((f.misfit for f in fits), default=np.inf)
    simple = min((f for f in fits if not candidate(f.name).has_shapes), key=lambda f: f.misfit, default=None)
    explained = simple is not None and not is_significant(problem.null, simple.rho, simple.prediction)
    enough = simple.misfit if simple and explained else np.inf
    near = before - WORTH * (before - least)
    return [f for f in fits if candidate(f.name).has_shapes and f.misfit < min(near, enough)]


def with_fitted_shapes(problem: Problem, fitted: Fit) -> Fit:
    """The fit with all fitted parameters of its candidate at their best."""
    name = fitted.name
    problem.begin(f"fitting the shape of {name}")
    only = problem.affected([name], fitted.prediction.mean - problem.null.mean)
    probe = probe_of(problem, [name], only, twins_of(name))
    free = [*((name, key) for key in problem.fitted_parameters(name)), *spreads_of(problem, fitted.model)]
    end = descend(problem, probe, fitted.model, fitted.base, free, COMPARED)
    shaped = where_ended(problem, fitted, end, free)
    return fitted if shaped.misfit > fitted.misfit else shaped


def where_ended(problem: Problem, fitted: Fit, end: Descent, free: Free) -> Fit:
    """The fit at the end of a descent over the parameters `free`, with errors of its own effect's."""
    values = next(e for e in end.model.effects if e.name == fitted.name).parameters()
    errors = zip(free, np.sqrt(np.diag(end.covariance)), strict=True)
    sd = {k: error_of(name, k, values[k], float(e)) for (name, k), e in errors if name == fitted.name}
    own = {k: values[k] for k in fitted.parameters}
    return problem.fit_of(fitted.name, own, end.model, end.base, end.prediction, sd)
