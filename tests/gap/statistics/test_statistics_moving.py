"""Moving light: the rest of the film."""

from __future__ import annotations

import numpy as np
from small import FRAMES, SHAPE, conditions

from spikecam_env.gap.observe.observation import BIN
from spikecam_env.gap.statistics.film import FEATURES, film_features, light_film


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
