"""Plots of temporal noise of recordings that have next to no spikes."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from spikecam_env.gap.observe.observation import observe
from spikecam_env.gap.report.exhibits.noise import lag_one
from spikecam_env.streams import pack_frames


@pytest.mark.parametrize("spikes", [0, 1])
def test_a_twin_without_intervals_has_no_correlation_and_no_warning(spikes: int) -> None:
    """As after an effect that silences most pixels."""
    frames = np.zeros((64, 4, 4), np.uint8)
    frames[:spikes] = 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.isnan(lag_one(observe(pack_frames(frames), (4, 4)))).all()
