"""Slow change within a recording."""

from __future__ import annotations

import numpy as np
import pytest
from small import CLEAR, effect, recorded, seen

from spikecam_env.gap.observe.observation import observe
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.statistics.drift import CONSTANCY, PARTS, lateness
from spikecam_env.streams import pack_frames

SHAPE, FRAMES = (16, 16), 8000


def at(times):
    """A recording of pixels that all fire at these times, each some frames later than the one before it."""
    spikes = np.zeros((FRAMES, SHAPE[0] * SHAPE[1]), np.uint8)
    for pixel in range(spikes.shape[1]):
        fired = np.round(times + pixel % 40).astype(int)
        spikes[fired[fired < FRAMES], pixel] = 1
    return observe(pack_frames(spikes.reshape(FRAMES, *SHAPE)), SHAPE)


def test_in_the_dark_intervals_tell_when_a_change_came():
    early, late = np.arange(0, 4000, 40), np.arange(4000, FRAMES, 50)
    shown = lateness(at(np.concatenate([early, late])))
    mean = 8000 / (100 + 80)
    assert len(shown) == PARTS
    assert [shown[f"late {i}"] for i in range(3)] == pytest.approx([40 / mean - 1] * 3, rel=0.02)
    assert [shown[f"late {i}"] for i in range(5, PARTS)] == pytest.approx([50 / mean - 1] * 3, rel=0.02)


def test_in_the_dark_a_wave_hardly_passes_for_a_drift():
    times = np.arange(0, FRAMES, 40.0)
    slow = lateness(at(times + 8 * (times / FRAMES) ** 2))
    wave = lateness(at(times + 2 * np.sin(2 * np.pi * times / 1700)))
    assert lateness(at(times))["late 0"] == pytest.approx(0.0, abs=0.2 * CONSTANCY)
    assert max(map(abs, wave.values())) < 0.2 * 2 * 2 * np.pi / 1700
    assert slow["late 0"] < -2 * CONSTANCY < 2 * CONSTANCY < slow["late 7"]


def test_a_change_of_all_pixels_is_no_variance_within_a_pixel():
    drifting = seen(recorded(effect("lamp_drift", sigma_per_root_s=0.3)))
    for flat in ("flat-0.2", "flat-0.65"):
        trend, pixels = (drifting[StatisticKey("drift", flat, name)] for name in ("trend", "pixels"))
        print(f"{flat}: trend {trend:.0f}, pixels {pixels:.1f}")
        assert abs(trend) > 2 * CLEAR
        assert abs(pixels) < CLEAR
