"""Integration: capacitor and shot noise against their closed forms (their laws in time: test_pixel_laws)."""

from __future__ import annotations

import numpy as np
from laws import camera, check, check_mean, jittered, spike_frames


def test_capacitor_spread_is_the_stated_one() -> None:
    inverse = 1 / camera("capacitor_spread", (200, 200), sigma_fF=0.04).unit.gain
    check("relative spread", inverse.std(), 0.04 / 4.348, 4.5 * 0.04 / 4.348 / np.sqrt(2 * inverse.size))


def test_shot_noise_spreads_a_spike_by_one_over_root_n() -> None:
    """Pooled interval variance T^2/N + 1/6."""
    intervals = np.random.default_rng(0).permutation(np.linspace(20.0, 21.0, 4000, endpoint=False))
    gaps = np.diff(spike_frames(jittered(quanta=400.0), intervals, 12, "reference"), axis=1)
    check_mean("variance - 1/6", (gaps - intervals[:, None]) ** 2 - 1 / 6 - intervals[:, None] ** 2 / 400 + 1.0, 1.0)
