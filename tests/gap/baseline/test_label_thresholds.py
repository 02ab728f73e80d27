"""From which error a label is reported, and when it is not at fault: made-up rates on a straight line."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from spikecam_env.gap.baseline.label_audit import wrong_label

LEVELS = {"dark": 0.0, "flat-1": 0.05, "flat-2": 0.1, "flat-3": 0.2, "flat-4": 0.3, "flat-5": 0.45, "flat-6": 0.6}
PIXELS = 2001
DARK = 0.01
SPREAD = np.sqrt(3.0) * np.linspace(-1.0, 1.0, PIXELS)
"""Of pixels: even, with half of the middle 68 % of them 0.68 sqrt(3)."""


def found(which: str, off: float, spread: float = 0.0, irregular: float = 0.0) -> list[str]:
    """Names of wrong labels, where the rates of `which` are off by a share, differently in pixels, with irregular
    intervals as a share of all."""
    conditions = [SimpleNamespace(name=n, kind="flat" if x else "dark", level=x) for n, x in LEVELS.items()]
    observations = []
    for c in conditions:
        share = off * (1.0 + spread * SPREAD / (0.68 * np.sqrt(3.0))) if c.name == which else np.zeros(PIXELS)
        count = np.full(PIXELS, 1000)
        odd = np.full(PIXELS, 1000 * irregular if c.name == which else 0.0)
        rate = (c.level + DARK) * (1.0 + share)
        times = SimpleNamespace(count=count)
        observations.append(SimpleNamespace(rate=rate, times=times, short=odd, long=np.zeros(PIXELS)))
    base = SimpleNamespace(live=np.ones(PIXELS, bool), gain=np.ones(PIXELS), dark=np.full(PIXELS, DARK))
    case = SimpleNamespace(conditions=conditions, observations=observations, base=base)
    return [name for c in wrong_label(case, set()) for name in c.recordings]


@pytest.mark.parametrize("off, reported", [(6e-4, False), (1.6e-3, True), (-1.6e-3, True)])
def test_a_label_off_by_a_thousandth_is_reported(off, reported):
    assert found("flat-4", off) == (["flat-4"] if reported else [])


@pytest.mark.parametrize("off, reported", [(0.013, False), (0.03, True)])
def test_a_dark_recording_is_reported_from_two_hundredths(off, reported):
    assert found("dark", off) == (["dark"] if reported else [])


@pytest.mark.parametrize("spread, reported", [(0.35, True), (0.75, False)])
def test_no_label_is_at_fault_where_pixels_are_off_differently_by_half_as_much(spread, reported):
    assert found("flat-4", 0.02, spread=spread) == (["flat-4"] if reported else [])


@pytest.mark.parametrize("share, reported", [(0.065, True), (0.15, False)])
def test_no_label_is_at_fault_where_a_tenth_as_many_intervals_are_irregular(share, reported):
    assert found("flat-4", 0.02, irregular=share * 0.02) == (["flat-4"] if reported else [])
