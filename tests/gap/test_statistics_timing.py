"""How late the array's spikes come."""

from __future__ import annotations

import numpy as np
import pytest
from small import check_reveals, effect, null

CASES = [
    (effect("common_threshold_noise", sigma_mV=3.0), "flat-0.03", ["late"], []),
    (effect("clock_jitter", sigma_ns=2000.0), "flat-0.65", ["late", "next"], []),
]


@pytest.mark.parametrize("shown_by, where, names, silent", CASES, ids=lambda v: getattr(v, "name", None))
def test_timing_reveal(shown_by, where, names, silent):
    check_reveals("timing", shown_by, where, names, silent)


def test_pixels_on_their_own_are_no_later_together_than_alone():
    """Nor in the first frames, in which only short intervals can have ended."""
    late = {k.recording: m for k, m in zip(null().keys, null().mean, strict=True) if k.name == "late"}
    print({k: round(float(m), 3) for k, m in late.items()})
    assert len(late) >= 6 and np.abs(list(late.values())).max() < 0.05
