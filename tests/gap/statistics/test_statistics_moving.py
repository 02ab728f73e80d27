"""Moving light: the rest of the film."""

from __future__ import annotations

import numpy as np
import pytest
from small import FRAMES, SHAPE, check_reveals, conditions, effect

from spikecam_env.gap.observe.observation import BIN
from spikecam_env.gap.statistics.film import FEATURES, film_features, light_film

CASES = [
    (effect("photodiode_lag", fraction=0.06, tau_us=1000.0), "bars", ["lag 16"], ["rates", "noise"]),
    (effect("readout_skew", span=1.0), "bars", ["skew", "delay"], ["rates", "noise"]),
    (effect("optical_blur", sigma_pixels=0.5), "bars", ["level", "left"], ["rates", "noise", "step", "neighbours"]),
    (effect("blooming", share=0.2), "bars", ["bloom"], ["rates", "noise", "step", "neighbours"]),
]


@pytest.mark.parametrize("shown_by, where, names, silent", CASES, ids=lambda v: getattr(v, "name", None))
def test_moving_reveal(shown_by, where, names, silent):
    check_reveals("moving", shown_by, where, names, silent)


def test_features_are_orthonormal_and_span_the_film():
    shown = next(c for c in conditions() if c.kind == "moving")
    light = light_film(shown.light, FRAMES)
    basis, size = film_features(light, SHAPE)
    used = basis[size > 0].astype(np.float64)
    error = np.abs(used @ used.T - np.eye(len(used))).max()
    x = np.minimum(light / BIN, 1).reshape(-1)
    left = np.linalg.norm(x - (used @ x) @ used) / np.linalg.norm(x)
    print(f"{len(used)} features, orthogonal to {error:.1e}, film to {left:.1e}")
    assert error < 1e-4 and left < 1e-5  # float32 sums of 128 000 terms
    assert len(basis) == len(FEATURES)


def test_light_of_a_bin_is_the_sum_over_its_frames():
    shown = next(c for c in conditions() if c.kind == "moving")
    keys = shown.light.radiance.reshape(len(shown.light.frame), -1)
    frames = np.arange(FRAMES) + 0.5
    for p in (0, 37, 1023):
        each = np.interp(frames, shown.light.frame, keys[:, p])
        expected = each.reshape(-1, BIN).sum(axis=1)
        assert np.allclose(light_film(shown.light, FRAMES)[:, p], expected, rtol=1e-5)
