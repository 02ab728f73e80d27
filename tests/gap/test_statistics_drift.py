"""Slow change within a recording."""

from __future__ import annotations

import pytest
from small import check_reveals, effect

CASES = [
    (effect("lamp_drift", sigma_per_root_s=0.02), "flat-0.65", ["trend", "bend"], ["dark", "intervals", "rows"]),
    (effect("dark_current_drift", rise=0.3, tau_ms=50.0), "dark", ["trend"], ["intervals", "step"]),
    (effect("random_telegraph_noise", amplitude_pA=1.0, fraction=0.1, dwell_ms=20.0), "flat-0.08", ["pixel tail"], []),
    (effect("threshold_flicker_noise", sigma_mV=2.0), "flat-0.4", ["pixels"], ["dark"]),
]


@pytest.mark.parametrize("shown_by, where, names, silent", CASES, ids=lambda v: getattr(v, "name", None))
def test_drift_reveal(shown_by, where, names, silent):
    check_reveals("drift", shown_by, where, names, silent)
