"""How near one picture is to another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from skimage.metrics import structural_similarity

Picture = NDArray[np.floating]


def psnr_db(picture: Picture, truth: Picture, peak: float) -> float:
    """10 log10(peak^2 / mean squared error) [dB]; equal pictures give infinity."""
    error = float(np.square(np.asarray(picture, np.float64) - truth).mean())
    return float("inf") if error == 0.0 else float(10 * np.log10(peak**2 / error))


def ssim(picture: Picture, truth: Picture, peak: float) -> float:
    """Structural similarity over 7 x 7 windows (Wang et al., TIP 2004), by scikit-image."""
    return float(structural_similarity(np.asarray(picture, np.float64), np.asarray(truth, np.float64), data_range=peak))


def gap_closed(noisy_db: float, denoised_db: float, clean_db: float) -> float:
    """Share of the way from noisy to clean, in dB, that the denoised stream has gone; NaN for a way under half a dB."""
    return (denoised_db - noisy_db) / (clean_db - noisy_db) if clean_db - noisy_db >= 0.5 else float("nan")


def count_variance(rate: NDArray[np.floating], window: int) -> NDArray[np.floating]:
    """Variance of spikes / window for an ideal pixel of any phase: f (1 - f) / window^2, f = frac(rate * window).

    Two streams of the same rates and independent phases differ by twice that: no denoiser comes nearer to the clean
    twin's picture in the mean, since the phase of the clean twin is not in the noisy stream.
    """
    fraction: NDArray[np.floating] = np.mod(rate * window, 1.0)
    return fraction * (1 - fraction) / window**2
