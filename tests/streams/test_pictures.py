from __future__ import annotations

import numpy as np
import pytest

from spikecam_env.errors import InputError
from spikecam_env.streams import middleTFI, middleTFP, tfp_film


@pytest.fixture
def spikes() -> np.ndarray:
    return (np.random.default_rng(0).random((50, 6, 9)) < 0.3).astype(np.uint8)


def test_tfp_is_the_mean_over_its_window(spikes: np.ndarray) -> None:
    np.testing.assert_allclose(middleTFP(spikes), spikes[5:46].mean(0), rtol=1e-6)
    np.testing.assert_allclose(middleTFP(spikes, 20, 4), spikes[18:22].mean(0), rtol=1e-6)


def test_tfp_window_is_cut_at_the_ends(spikes: np.ndarray) -> None:
    np.testing.assert_allclose(middleTFP(spikes, 0, 11), spikes[:6].mean(0), rtol=1e-6)
    np.testing.assert_allclose(middleTFP(spikes, 49, 11), spikes[44:].mean(0), rtol=1e-6)


@pytest.mark.parametrize(("window", "every"), [(1, 1), (11, 1), (4, 3), (5, 20), (200, 7)])
def test_film_is_tfp_at_each_frame(spikes: np.ndarray, window: int, every: int) -> None:
    film = tfp_film(spikes, window, every=every)
    expected = [middleTFP(spikes, t, window) for t in range(0, 50, every)]
    np.testing.assert_allclose(film, expected, rtol=1e-6)


def test_tfi_of_a_regular_train_is_its_rate() -> None:
    regular = np.zeros((40, 1, 1), np.uint8)
    regular[::8] = 1
    assert middleTFI(regular)[0, 0] == np.float32(1 / 8)


def test_frames_outside_are_refused(spikes: np.ndarray) -> None:
    for call in (
        lambda: middleTFP(spikes, 50),
        lambda: middleTFI(spikes, -1),
        lambda: middleTFP(spikes, 3, 0),
    ):
        with pytest.raises(InputError):
            call()
