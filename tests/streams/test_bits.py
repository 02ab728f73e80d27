"""From frames of pixels to the spike times of each pixel."""

from __future__ import annotations

import numpy as np
import pytest

from spikecam_env.streams import pack_frames
from spikecam_env.streams.bits import as_words, by_pixel, lowest, ones, times_of, transpose


def random_words(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 2**64, count, dtype=np.uint64)


def bits_of(words: np.ndarray) -> np.ndarray:
    """(n, 64): bit i of word j at [j, i]."""
    return np.unpackbits(np.ascontiguousarray(words).view(np.uint8), bitorder="little").reshape(-1, 64)


def test_transpose_swaps_word_and_bit():
    square = random_words(64)
    turned = square.copy()
    transpose(turned)
    assert np.array_equal(bits_of(turned), bits_of(square).T)


def test_transpose_is_an_involution():
    for seed in range(20):
        square = random_words(64, seed)
        twice = square.copy()
        transpose(twice)
        assert not np.array_equal(twice, square)
        transpose(twice)
        assert np.array_equal(twice, square)


def test_ones_and_lowest_are_those_of_python():
    from numba import njit

    @njit
    def both(word):
        return ones(word), lowest(word)

    for word in (*random_words(50), np.uint64(1), np.uint64(2**63), np.uint64(2**64 - 1)):
        n = int(word)
        assert tuple(map(int, both(word))) == (bin(n).count("1"), (n & -n).bit_length() - 1)


@pytest.mark.parametrize("shape", [(5, 7), (24, 40), (8, 8), (1, 3), (9, 15)])
def test_words_hold_pixel_p_at_bit_p_of_the_frame(shape):
    pixels = shape[0] * shape[1]
    spikes = (np.random.default_rng(1).random((11, *shape)) < 0.3).astype(np.uint8)
    words = as_words(pack_frames(spikes))
    assert words.shape == (11, -(-pixels // 64)) and words.dtype == np.uint64
    found = bits_of(words).reshape(11, -1)
    assert np.array_equal(found[:, :pixels], spikes.reshape(11, -1))
    assert not found[:, pixels:].any()


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
