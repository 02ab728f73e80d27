"""A whole stream through a denoiser has the bits of `denoise`."""

from __future__ import annotations

import numpy as np
import pytest

from denoiser import denoise
from denoiser.evaluate.rows import Weights, denoiser, restored
from spikecam_env.errors import InputError


def test_the_same_bits_as_denoise_and_how_many_were_whole():
    spikes = (np.random.default_rng(0).random((75, 16, 24)) < 0.2).astype(np.uint8)
    online = denoiser("best", Weights())
    found = restored(online, spikes)
    fired, rates = denoise(spikes, "best", output="both")
    assert np.array_equal(found.spikes, fired) and np.array_equal(found.rates, rates)
    assert 0 < found.whole <= len(spikes)
    assert len(spikes) - found.whole <= online.latency
    again = restored(online, spikes[: found.whole + online.latency])
    assert np.array_equal(again.rates[: found.whole], rates[: found.whole])


def test_weights_that_are_none_are_refused(tmp_path):
    (tmp_path / "x.pt").write_text("text")
    with pytest.raises(InputError, match=r"x\.pt"):
        Weights.of_modes(["best"], {"best": tmp_path / "x.pt"})
