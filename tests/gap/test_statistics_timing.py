"""How late the array's spikes come."""

from __future__ import annotations

import pytest
from small import check_reveals, effect

CASES = [
    (effect("common_threshold_noise", sigma_mV=3.0), "flat-0.03", ["late"], []),
    (effect("clock_jitter", sigma_ns=2000.0), "flat-0.65", ["late", "next"], []),
]


@pytest.mark.parametrize("shown_by, where, names, silent", CASES, ids=lambda v: getattr(v, "name", None))
def test_timing_reveal(shown_by, where, names, silent):
    check_reveals("timing", shown_by, where, names, silent)
