"""Metrics in their limiting cases."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

from denoiser.decoders import accumulate
from denoiser.evaluate.metrics import count_variance, gap_closed, psnr_db, ssim
from denoiser.evaluate.niqe import niqe
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
    """4096 random phases; 5 standard errors."""
    rate = 0.2371
    light = np.broadcast_to(np.float32(rate), (window, 64, 64))
    spikes, _ = accumulate.step(light, accumulate.start((64, 64)))
    squares = np.square(spikes.mean(axis=0) - rate)
    expected = float(count_variance(np.float64(rate), window))
    error = squares.std() / 64
    print(f"window {window}: variance {squares.mean():.3e} +- {error:.0e}, f(1-f)/w^2 {expected:.3e}")
    assert abs(squares.mean() - expected) < 5 * error


def test_niqe_prefers_the_clean_photograph():
    import skimage.data

    clean = skimage.data.camera()[:256, :400].astype(np.float32) / 255
    noisy = clean * (1 + 0.1 * np.random.default_rng(0).standard_normal(clean.shape))
    scores = niqe(clean), niqe(noisy)
    print(f"NIQE clean {scores[0]:.2f}, noisy {scores[1]:.2f}")
    assert scores[0] < scores[1]
    assert "mmcv" not in sys.modules and "mmagic" not in sys.modules


def test_niqe_says_what_it_needs():
    with pytest.raises(InputError, match="192"):
        niqe(np.zeros((100, 300)))
