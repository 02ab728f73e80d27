"""How late the array's spikes come."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from small import SHAPE, null

from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import observe
from spikecam_env.gap.statistics.timing import statistics
from spikecam_env.streams import pack_frames


def test_a_few_slow_pixels_of_uneven_intervals_are_no_later_together_than_alone():
    """As of traps in the dark: twenty of a thousand pixels make the mean variance, and hardly a spike."""
    rng = np.random.default_rng(0)
    spikes = np.zeros((6000, *SHAPE), np.uint8)
    for p in range(spikes[0].size):
        mean, by = (300, 60) if p % 50 == 0 else (30, 1)
        ends = rng.integers(0, mean) + np.cumsum(rng.integers(mean - by, mean + by + 1, 6000 // mean))
        spikes.reshape(6000, -1)[ends[ends < 6000], p] = 1
    seen_by = observe(pack_frames(spikes), SHAPE)
    shown = Condition("flat", "flat", 0.03, None, 6000, "fit")
    late = statistics(SimpleNamespace(conditions=[shown], observations=[seen_by]), 0)["late"]
    slow = np.sort(seen_by.variance)[-21:].sum() / seen_by.variance.sum()
    print(f"{late:.3f}; slow pixels have {slow:.2f} of all variance")
    assert slow > 0.9 and abs(late) < 0.25


def test_pixels_on_their_own_are_no_later_together_than_alone():
    """Nor in the first frames, in which only short intervals can have ended."""
    late = {k.recording: m for k, m in zip(null().keys, null().mean, strict=True) if k.name == "late"}
    print({k: round(float(m), 3) for k, m in late.items()})
    assert len(late) >= 6 and np.abs(list(late.values())).max() < 0.05
