"""Time constants and other second parameters: found where they matter, and not asked for where they do not."""

from dataclasses import replace

import numpy as np
import pytest
from small import MODEL, effect, null, recorded

from spikecam_env.gap.compare.distance import residual_and_misfit
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.fit.candidate import fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.fit.shapes import with_fitted_shapes
from spikecam_env.gap.screen.screen import Screened
from spikecam_env.gap.search.neighbours import try_other_starts


@pytest.mark.parametrize("start", [0.4, 2.5])
def test_a_time_constant_is_found_from_a_start_far_off(start):
    """Lag of 8 % and 1 ms."""
    case = recorded(effect("photodiode_lag", fraction=0.08, tau_us=1000.0))
    measured = values_of(case.bank, null().keys)
    first = fit(
        Problem(case, MODEL, null(), measured, measured), "photodiode_lag", {"fraction": 0.08, "tau_us": 1000.0 * start}
    )
    found = with_fitted_shapes(Problem(case, MODEL, null(), measured, measured), first)
    print(found.parameters, found.sd, f"misfit {first.misfit:.0f}, then {found.misfit:.0f} of {len(measured)}")
    assert first.parameters["tau_us"] == 1000.0 * start
    assert found.parameters["tau_us"] == pytest.approx(1000.0, rel=0.2)
    assert found.parameters["fraction"] == pytest.approx(0.08, rel=0.15)
    assert found.misfit < min(first.misfit - 10.0, 1.5 * len(measured))


def test_of_other_shapes_the_best_is_fitted_whole_where_it_removes_nearly_as_much():
    """Lag of 1 ms from 0.6 and from 8 ms, where its strength alone removes most of the misfit, or some of it."""
    case = recorded(effect("photodiode_lag", fraction=0.08, tau_us=1000.0))
    measured = values_of(case.bank, null().keys)
    before = residual_and_misfit(null(), measured, null().prediction)[1]
    best = fit(Problem(case, MODEL, null(), measured, measured), "photodiode_lag", {"fraction": 0.08, "tau_us": 1000.0})
    tried = [{"fraction": 0.08, "tau_us": tau_us} for tau_us in (600.0, 8000.0)]
    starts = [Screened("photodiode_lag", start, best.misfit, np.full(len(measured), np.inf)) for start in tried]
    began = replace(starts[0], start=best.parameters)
    problem = Problem(case, MODEL, null(), measured, measured)
    found = try_other_starts(problem, best, before, [began, *starts], {began: best})
    print(f"{before:.0f}, of the best {best.misfit:.0f}", [(f.parameters, round(f.misfit)) for f in found])
    assert [f.parameters["tau_us"] for f in found] == [pytest.approx(1000.0, rel=0.2)]
    spent = case.budget.simulated
    tries = {began: best, starts[0]: replace(best, misfit=before)}
    assert try_other_starts(problem, best, before, [began, starts[0]], tries) == []
    assert case.budget.simulated == spent, "a start that was fitted is not fitted again"
