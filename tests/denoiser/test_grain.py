"""Grain of known size is found, whatever noise lies over it."""

from __future__ import annotations

import numpy as np
import pytest

from denoiser.evaluate.grain import APART, GAP, WHITE, elsewhere, kept, relative_grain, residual, two_looks
from spikecam_env.sensor import SensorModel, SpikeSensor

SHAPE = (120, 160)


@pytest.fixture(scope="module")
def looks():
    """A pattern of 5 % on light of 0.2, under independent noise of 10 % in each look."""
    rng = np.random.default_rng(1)
    pattern = 0.05 * rng.standard_normal(SHAPE)
    return pattern, tuple(0.2 * (1 + pattern + 0.1 * rng.standard_normal(SHAPE)) for _ in range(2))


def test_smooth_light_has_no_grain():
    y, x = np.mgrid[:20, :30].astype(float)
    assert np.abs(residual(0.1 + 0.003 * x - 0.001 * y)).max() < 1e-15


def test_the_residual_of_white_grain_has_the_variance_that_the_law_says():
    grain = np.random.default_rng(2).standard_normal((400, 400))
    assert residual(grain)[1:-1, 1:-1].var() == pytest.approx(WHITE, rel=0.02)


def test_the_size_of_a_pattern_is_found_within_its_error(looks):
    size, error = relative_grain(looks[1], np.full(SHAPE, 0.2))
    print(f"{100 * size:.3f} +- {100 * error:.3f} %, is 5 %")
    assert size == pytest.approx(0.05, abs=4 * error) and error < 0.002


def test_what_a_denoiser_keeps_is_found_within_its_error(looks):
    pattern, (first, second) = looks
    denoised = 0.2 * (1 + 0.3 * pattern)
    share, error = kept([(denoised, first, second), (denoised, second, first)])
    print(f"kept {share:.4f} +- {error:.4f}, is 0.3")
    assert share == pytest.approx(0.3, abs=4 * error) and error < 0.02


def test_noise_of_its_own_look_is_not_taken_for_pattern(looks):
    """A picture that is the noisy one keeps the pattern, not more."""
    _, (first, second) = looks
    assert kept([(first, first, second)])[0] == pytest.approx(1.0)
    assert kept([(np.zeros(SHAPE), first, second)])[0] == 0.0


def test_white_grain_is_not_elsewhere_and_a_scene_is(looks):
    assert abs(elsewhere(looks[1])) < 0.1
    rows = np.sin(np.arange(SHAPE[0]) * 2 * np.pi / APART)[:, None] * np.ones(SHAPE)
    assert elsewhere((rows, rows)) > 0.5


def test_two_looks_do_not_touch():
    first, second = two_looks(np.arange(101)[:, None, None])
    assert len(first) == len(second) == 34 and second[0] - first[-1] - 1 == GAP + 1
    assert len(two_looks(np.zeros((GAP, 1, 1)))[0]) == 0


def test_two_looks_of_a_camera_without_pattern_share_nothing():
    """Where two looks touch, the part of an interval that one count misses the other has: they share -1.6 %."""
    light = np.linspace(0.15, 0.3, 80, dtype=np.float32)[:, None] + np.zeros((80, 100), np.float32)
    spikes = SpikeSensor(SensorModel.preset("ideal"), light.shape, seed=2, engine="fast").step(light, 200)
    apart, touching = (
        [part.mean(axis=0) for part in parts] for parts in (two_looks(spikes), (spikes[:84], spikes[84:168]))
    )
    size, error = relative_grain(tuple(apart), light)
    shared, _ = relative_grain(tuple(touching), light)
    print(f"apart {100 * size:.2f} +- {100 * error:.2f} %, touching {100 * shared:.2f} %")
    assert abs(size) < 0.008 < 0.012 < -shared
