"""Metrics in their limiting cases."""

from __future__ import annotations

import math

import numpy as np
import pytest

from denoiser import accumulate
from denoiser.metrics import count_variance, gap_closed, psnr_db, ssim
from denoiser.niqe import niqe
from spikecam_env.errors import InputError


def test_psnr_of_a_tenth_of_the_peak_is_twenty_decibels():
    picture = np.zeros((8, 8))
    assert psnr_db(picture + 0.05, picture, 0.5) == pytest.approx(20.0)
    assert psnr_db(picture, picture, 1.0) == math.inf


def test_ssim_of_equal_pictures_is_one():
    picture = np.random.default_rng(0).random((16, 16))
    assert ssim(picture, picture, 1.0) == pytest.approx(1.0)


def test_gap_closed_runs_from_noisy_to_clean():
    assert gap_closed(20.0, 20.0, 30.0) == 0.0
    assert gap_closed(20.0, 27.5, 30.0) == 0.75
    assert math.isnan(gap_closed(20.0, 25.0, 20.0))


@pytest.mark.parametrize("window", [21, 41])
def test_count_variance_is_that_of_an_ideal_pixel(window):
    """1 % of the variance: 64 x 64 evenly spread phases and 60 windows."""
    rates = np.full((1, 64, 64), 0.2371, np.float32)
    spikes, _ = accumulate.step(np.broadcast_to(rates, (window * 60, 64, 64)), accumulate.start((64, 64)))
    counts = spikes.reshape(60, window, 64, 64).mean(axis=1)
    measured, expected = np.square(counts - 0.2371).mean(), float(count_variance(np.float64(0.2371), window))
    print(f"window {window}: variance {measured:.3e}, f(1-f)/w^2 {expected:.3e}")
    assert measured == pytest.approx(expected, rel=0.01)


def test_niqe_prefers_the_clean_photograph():
    pytest.importorskip("skvideo", reason="scikit-video is a development extra")
    import skimage.data

    clean = skimage.data.camera()[:256, :400].astype(np.float32) / 255
    noisy = clean * (1 + 0.1 * np.random.default_rng(0).standard_normal(clean.shape))
    scores = niqe(clean), niqe(noisy)
    print(f"NIQE clean {scores[0]:.2f}, noisy {scores[1]:.2f}")
    assert scores[0] < scores[1]
    assert not hasattr(np, "float")


def test_niqe_says_what_it_needs():
    with pytest.raises(InputError, match="194"):
        niqe(np.zeros((100, 300)))
