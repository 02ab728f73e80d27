"""`best` on measured streams (skipped where the shared data are not)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from denoiser import denoise
from spikecam_env.streams import middleTFP
from tools.real_recordings import REAL


def recording(name: str) -> np.ndarray:
    path = REAL / f"{name}.npz"
    if not path.exists():
        pytest.skip(f"the shared recording {name}.npz is not here")
    with np.load(path) as data:
        spikes = data[data.files[0]]
    return np.ascontiguousarray(np.moveaxis(spikes, 2, 0) if name == "wall" else spikes).astype(np.uint8)


@pytest.fixture(scope="module", params=["wall", "helicopter_low_light"])
def streams(request):
    noisy = recording(request.param)[:160]
    return noisy, denoise(noisy)


def test_the_denoised_picture_is_the_same_scene_the_right_way_up(streams):
    noisy, denoised = (gaussian_filter(middleTFP(s, 80, 121), 2) for s in streams)
    upright = np.corrcoef(noisy.ravel(), denoised.ravel())[0, 1]
    turned = max(np.corrcoef(noisy.ravel(), d.ravel())[0, 1] for d in (denoised[::-1], denoised[:, ::-1]))
    print(f"correlation upright {upright:.4f}, flipped at best {turned:.4f}")
    assert upright > 0.98 and turned < 0.9


def test_the_mean_rate_is_kept_but_for_the_dark_current(streams):
    noisy, denoised = (float(s.mean()) for s in streams)
    print(f"mean rate {noisy:.4f} -> {denoised:.4f} spikes/frame")
    assert 0.85 < denoised / noisy < 1.03


def test_grain_is_less(streams):
    """Contrast between neighbouring pixels, over the difference of neighbours two apart."""
    noisy, denoised = (middleTFP(s, 80, 81) for s in streams)
    grain = [float(np.abs(np.diff(p, 2, axis=1)).mean()) for p in (noisy, denoised)]
    print(f"mean second difference {grain[0]:.4f} -> {grain[1]:.4f}")
    assert grain[1] < 0.8 * grain[0]
