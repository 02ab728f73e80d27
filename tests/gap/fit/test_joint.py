"""The last step: all parameters refined together, and the unit with them."""

from dataclasses import replace

import numpy as np
import pytest
from small import MODEL, effect, null, recorded, unit

from spikecam_env.gap.compare.prediction import Prediction, values_of
from spikecam_env.gap.fit.candidate import Fit, fit
from spikecam_env.gap.fit.joint import agree, refined_together
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.twins.budget import Budget

NOTHING = Prediction(np.zeros(0), np.zeros(0), np.zeros(0))


@pytest.mark.parametrize("seed", [1, 12])
def test_noise_of_the_unit_is_found_beside_common_noise(seed):
    """3 mV in common take a fifth of what the refit holds for the unit's own."""
    name = "common_threshold_noise"
    case = recorded(effect(name, sigma_mV=3.0), seed=seed)
    values = values_of(case.bank, null().keys)
    seen = np.where([case.use(k.recording) == "fit" for k in null().keys], values, np.nan)
    first = fit(Problem(case, MODEL, null(), seen, seen), name, {"sigma_mV": 4.0})
    best, errors, _ = refined_together(Problem(case, MODEL, null(), seen, values), first, [name])
    own, before = best.base.white / unit().white, first.base.white / unit().white
    print(best.parameters, errors, f"s^2 {before:.2f}, then {own:.2f} of the unit's")
    assert own == pytest.approx(1.0, abs=0.1) and abs(own - 1.0) < abs(before - 1.0)
    assert best.parameters["sigma_mV"] == pytest.approx(3.0, abs=3 * errors[name]["sigma_mV"])


def test_strengths_refined_alone_are_known_no_better_than_with_their_shapes(monkeypatch):
    """A fit that says its strength is open by half, and enough simulated to leave its time constant alone."""
    name = "photodiode_lag"
    case = replace(recorded(effect(name, fraction=0.05, tau_us=600.0), seed=2), budget=Budget(0))
    values = values_of(case.bank, null().keys)
    seen = np.where([case.use(k.recording) == "fit" for k in null().keys], values, np.nan)
    first = fit(Problem(case, MODEL, null(), seen, seen), name, {"fraction": 0.05, "tau_us": 600.0})
    open_ = {"fraction": 0.025, "tau_us": 200.0}
    monkeypatch.setattr(Problem, "is_explained", lambda *_: False)
    best, errors, _ = refined_together(Problem(case, MODEL, null(), seen, values), replace(first, sd=open_), [name])
    assert errors[name] == best.sd == open_ and case.budget.left_out == ["finer shapes of the effects found"]


@pytest.mark.parametrize("then, same", [(0.0076, True), (0.0019 / 4, True), (0.02, False), (-0.0019, False)])
def test_parameters_agree_within_errors_of_their_logarithms(then, same):
    """Half of it unknown: a factor of four is 2.6 errors, whichever way; of ten, 4.4."""
    here, there = (
        Fit("crosstalk", {}, {}, NOTHING, unit(), np.zeros(0), 0.0, MODEL.with_effect(effect("crosstalk", kick=k)))
        for k in (0.0019, then)
    )
    assert agree(here, there, {"crosstalk": {"kick": 0.001}}, 3.0) is same
