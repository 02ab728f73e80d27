"""Time constants and other second parameters: found where they matter, and not asked for where they do not."""

import pytest
from small import MODEL, effect, null, recorded

from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.fit.candidate import fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.fit.shapes import with_fitted_shapes


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
