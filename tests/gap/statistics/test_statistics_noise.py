"""Noise of intervals."""

from __future__ import annotations

import pytest
from small import check_reveals, effect

CASES = [
    (effect("frame_threshold_noise", sigma_mV=10.0), "flat-0.03", ["A_1", "lag-1"], ["spectrum"]),
    (effect("threshold_flicker_noise", sigma_mV=1.0), "flat-0.4", ["A_64"], ["dark", "spectrum", "rows"]),
    (effect("random_telegraph_noise", fraction=0.05), "flat-0.03", ["A_1"], ["spectrum", "step"]),
    (effect("synchronous_reset", fraction=0.3), "flat-0.65", ["lag-1"], ["intervals"]),
]


@pytest.mark.parametrize("shown_by, where, names, silent", CASES, ids=lambda v: getattr(v, "name", None))
def test_noise_reveal(shown_by, where, names, silent):
    check_reveals("noise", shown_by, where, names, silent)
