"""From frames of pixels to the spike times of each pixel."""

from __future__ import annotations

import numpy as np
import pytest

from spikecam_env.streams import pack_frames
from spikecam_env.streams.bits import as_words, by_pixel, times_of


@pytest.mark.parametrize("frames", [1, 63, 64, 65, 200])
@pytest.mark.parametrize("rate", [0.0, 0.03, 0.5, 1.0])
def test_times_of_finds_all_spikes_of_every_pixel(frames, rate):
    shape = (3, 43)
    spikes = (np.random.default_rng(frames).random((frames, *shape)) < rate).astype(np.uint8)
    words = as_words(pack_frames(spikes))
    out = np.empty((64, -(-frames // 64)), np.uint64)
    times = np.empty(frames + 1, np.int32)
    flat = spikes.reshape(frames, -1)
    for column in range(words.shape[1]):
        by_pixel(words, column, out)
        for within in range(64):
            p = 64 * column + within
            n = times_of(out[within], times)
            expected = np.flatnonzero(flat[:, p]) if p < flat.shape[1] else []
            assert np.array_equal(times[:n], expected)
