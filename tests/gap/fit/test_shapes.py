"""Time constants and other second parameters: found where they matter, and not asked for where they do not."""

import pytest
from small import effect, null, problem_of, recorded

from spikecam_env.gap.fit.candidate import fit, with_fitted_shapes


@pytest.mark.parametrize("start", [0.4, 2.5])
def test_a_time_constant_is_found_from_a_start_far_off(start):
    """Lag of 8 % and 1 ms."""
    case = recorded(effect("photodiode_lag", fraction=0.08, tau_us=1000.0))
    problem = problem_of(case, null())
    first = fit(problem, "photodiode_lag", {"fraction": 0.08, "tau_us": 1000.0 * start})
    found = with_fitted_shapes(problem, first)
    print(found.parameters, found.sd, f"misfit {first.misfit:.0f}, then {found.misfit:.0f} of {len(null().keys)}")
    assert first.parameters["tau_us"] == 1000.0 * start
    assert found.parameters["tau_us"] == pytest.approx(1000.0, rel=0.2)
    assert found.parameters["fraction"] == pytest.approx(0.08, rel=0.15)
    assert found.misfit < min(first.misfit - 10.0, 1.5 * len(null().keys))
