"""A weak effect on rates beside bars of 1.4 thresholds a frame: these saturate, and tell it from a brighter unit.

The crosstalk is that at a frame's end, which a campaign takes a fraction of a second to simulate; at the spike it takes
four.  Fits are shared.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from small import MODEL, effect, problem_of, recorded

from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.fit.candidate import fit
from spikecam_env.gap.fit.gauss_newton import Probe, derivatives, moved
from spikecam_env.gap.fit.hypothesis import Fit
from spikecam_env.gap.fit.predict import predict_by_twins
from spikecam_env.gap.fit.problem import Problem

TRUE = 0.0025
"""Kick, which makes the refit 1 % brighter [thresholds]."""


@lru_cache
def fitted() -> tuple[Problem, Fit]:
    """Crosstalk fitted, from four fifths of it."""
    case = recorded(effect("crosstalk", kick=TRUE, when="frame_end"), seed=4)
    without = model_null(case, MODEL, 12)
    problem = problem_of(case, without)
    return problem, fit(problem, "crosstalk", {"kick": 0.8 * TRUE, "when": "frame_end"})


@pytest.mark.slow
def test_a_weak_effect_on_rates_is_fitted() -> None:
    problem, found = fitted()
    print(found.parameters, problem.misfit(), found.misfit)
    assert found.parameters["kick"] == pytest.approx(TRUE, rel=0.2)


@pytest.mark.slow
def test_derivatives_are_of_a_unit_that_has_settled() -> None:
    """Crosstalk half a logarithm stronger makes the refit brighter, which the bars tell."""
    problem, found = fitted()
    without = problem.null

    probe = Probe(lambda model, base, count: predict_by_twins(problem.case, model, base, without, count), 3)
    at = probe(found.model, found.base)
    free = [("crosstalk", "kick")]
    columns, _ = derivatives(problem, probe, found.model, found.base, at, free)
    unsettled = (probe(*moved(found.model, found.base, free, np.array([0.5]))).mean - at.mean) / 0.5
    bars = np.array([k.recording == "bars" for k in without.keys])
    most, most_unsettled = (np.abs(c[bars] / without.noise[bars]).max() for c in (columns[:, 0], unsettled))
    print(f"bars change by {most:.1f} noises a logarithm at most, unsettled by {most_unsettled:.1f}")
    assert most < 20.0 < most_unsettled
