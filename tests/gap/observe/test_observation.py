"""Recordings reduced to numbers: every field against plain Python, on any size of array."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from spikecam_env.gap.observe.observation import (
    BIN,
    DIFFERENCES,
    FRAME_LAGS,
    LENGTHS,
    TIME_BLOCKS,
    observe,
)
from spikecam_env.streams import pack_frames

SHAPES = [(5, 7), (24, 40), (3, 64), (2, 130), (1, 1), (1, 9)]


def random_spikes(shape: tuple[int, int], frames: int = 300, seed: int = 0) -> NDArray[np.uint8]:
    """Rates from 0 to 0.9 across the array; a silent pixel, and one of a single spike where there is room."""
    rng = np.random.default_rng(seed)
    rate = np.linspace(0.02, 0.9, shape[0] * shape[1])
    flat = (rng.random((frames, rate.size)) < rate).astype(np.uint8)
    if rate.size > 4:
        flat[:, 1] = 0
        flat[:, 2] = 0
        flat[frames // 3, 2] = 1
        flat[:, 3] = 0
        flat[[4, frames - 1], 3] = 1
    return flat.reshape(frames, *shape)


def regular_spikes(shape: tuple[int, int], frames: int = 500) -> NDArray[np.uint8]:
    """Pixel p crosses every 1.5 + 0.173 p frames; floor of the crossings' times."""
    out = np.zeros((frames, shape[0] * shape[1]), np.uint8)
    for p in range(out.shape[1]):
        times = (0.3 + (1.5 + 0.173 * p) * np.arange(frames)).astype(int)
        out[times[times < frames], p] = 1
    return out.reshape(frames, *shape)


MADE = {"random": random_spikes, "regular": regular_spikes}


@pytest.fixture(
    params=[(kind, shape) for kind in MADE for shape in SHAPES], ids=lambda p: f"{p[0]}-{p[1][0]}x{p[1][1]}"
)
def stream(request) -> NDArray[np.uint8]:
    kind, shape = request.param
    return MADE[kind](shape)


def seen(spikes: NDArray[np.uint8], film: bool = False):
    return observe(pack_frames(spikes), spikes.shape[1:], film=film)


def times_of_pixels(spikes: NDArray[np.uint8]) -> list[NDArray[np.int64]]:
    flat = spikes.reshape(len(spikes), -1)
    return [np.flatnonzero(flat[:, p]) for p in range(flat.shape[1])]


def test_ends_and_counts_are_those_of_the_spikes(stream):
    o = seen(stream)
    for p, t in enumerate(times_of_pixels(stream)):
        assert o.times.count[p] == t.size
        assert (o.times.first[p], o.times.last[p]) == ((t[0], t[-1]) if t.size else (-1, -1))
    assert o.frames == len(stream) and o.shape == stream.shape[1:]
    assert o.times.count.size == stream[0].size


def test_second_differences_are_summed_over_all_starts(stream):
    o = seen(stream)
    for p, t in enumerate(times_of_pixels(stream)):
        for j, k in enumerate(DIFFERENCES):
            e = t[2 * k :] - 2 * t[k : t.size - k] + t[: max(t.size - 2 * k, 0)] if t.size > 2 * k else np.zeros(0)
            assert o.times.terms[p, j] == e.size
            assert o.times.square[p, j] == np.sum(e.astype(float) ** 2)


def test_variance_and_covariance_are_about_the_pixels_own_mean(stream):
    """Float64 sums of intervals below 2^20: equal to 1e-9 of T^2."""
    o = seen(stream)
    worst = 0.0
    for p, t in enumerate(times_of_pixels(stream)):
        if t.size < 4:
            assert np.isnan(o.variance[p]) and np.isnan(o.covariance[p])
            continue
        d = np.diff(t) - np.diff(t).mean()
        scale = np.diff(t).mean() ** 2
        error = max(abs(o.variance[p] - np.mean(d**2)), abs(o.covariance[p] - np.mean(d[1:] * d[:-1]))) / scale
        worst = max(worst, error)
    print(f"worst {worst:.1e}")
    assert worst < 1e-9


def test_short_long_and_odd_intervals_are_counted_where_they_end(stream):
    o = seen(stream)
    odd, late, scatter, timed = np.zeros((4, len(stream)))
    for p, t in enumerate(times_of_pixels(stream)):
        if t.size < 4:
            assert o.short[p] == o.long[p] == 0
            continue
        d, mean = np.diff(t), np.diff(t).mean()
        short, long = d < 0.6 * mean - 1, d > 1.5 * mean + 1
        assert (o.short[p], o.long[p]) == (short.sum(), long.sum())
        np.add.at(odd, t[1:], short | long)
        if not np.any(short | long):
            np.add.at(late, t[1:], d - mean)
            np.add.at(scatter, t[1:], d.var())
            np.add.at(timed, t[1:], 1)
    assert np.array_equal(o.odd, odd) and np.array_equal(o.timed, timed)
    assert np.allclose(o.late, late, atol=1e-9 * len(stream))
    assert np.allclose(o.scatter, scatter, atol=1e-9 * len(stream))


def test_late_and_early_spikes_are_counted_near_whole_intervals(stream):
    """By plain Python, in pixels of a mean interval within 0.04 frames of a whole number."""
    o = seen(stream)
    for p, t in enumerate(times_of_pixels(stream)):
        d = np.diff(t) if t.size >= 4 else np.zeros(0)
        whole = round(d.mean()) if d.size else 0
        near = d.size > 0 and abs(d.mean() - whole) < 0.04
        late = sum(a == whole + 1 and b == whole - 1 for a, b in pairwise(d)) if near else 0
        early = sum(a == whole - 1 and b == whole + 1 for a, b in pairwise(d)) if near else 0
        assert tuple(o.flips[p]) == (late, early)


@pytest.mark.parametrize("flip, expected", [(1, (1, 0)), (-1, (0, 1))])
def test_one_spike_a_frame_off_is_late_or_early(flip, expected):
    spikes = np.zeros((100, 1, 1), np.uint8)
    times = np.arange(3, 100, 5)
    times[7] += flip
    spikes[times] = 1
    assert tuple(seen(spikes).flips[0]) == expected


def test_intervals_are_counted_by_length_one_frame_first(stream):
    o = seen(stream)
    d = np.concatenate([np.diff(t) for t in times_of_pixels(stream)])
    expected = np.bincount(np.minimum(d, LENGTHS).astype(int), minlength=LENGTHS + 1)[1:]
    assert o.lengths.size == LENGTHS
    assert np.array_equal(o.lengths, expected)


@pytest.mark.parametrize("frames", [300, 320, 17, 16])
def test_blocks_hold_every_spike_once(frames):
    spikes = random_spikes((5, 7), frames)
    o = seen(spikes)
    each = -(-frames // TIME_BLOCKS)
    for b in range(TIME_BLOCKS):
        assert np.array_equal(o.blocks[b], spikes[b * each : (b + 1) * each].reshape(-1, 35).sum(axis=0, dtype=int))
    assert o.blocks.sum() == spikes.sum()


def test_frames_rows_and_columns_are_sums(stream):
    o = seen(stream)
    assert np.array_equal(o.frame, stream.sum(axis=(1, 2)))
    assert np.array_equal(o.row, stream.sum(axis=2))
    assert np.array_equal(o.column, stream.sum(axis=1))


def test_columns_are_right_for_more_rows_than_a_byte_counts():
    spikes = np.ones((3, 300, 2), np.uint8)
    assert np.all(seen(spikes).column == 300)


def test_coincidences_are_of_both_orders_of_neighbours(stream):
    s = stream.astype(int)
    o = seen(stream)
    for lag in range(FRAME_LAGS):
        now, then = s[lag:], s[: len(s) - lag]
        across = (now[:, :, :-1] * then[:, :, 1:]).sum() + (now[:, :, 1:] * then[:, :, :-1]).sum()
        down = (now[:, :-1] * then[:, 1:]).sum() + (now[:, 1:] * then[:, :-1]).sum()
        assert tuple(o.coincidences[lag]) == (across, down), lag


def test_film_counts_in_bins_and_is_kept_on_request_only(stream):
    bins = len(stream) // BIN
    o = seen(stream, film=True)
    expected = stream[: bins * BIN].reshape(bins, BIN, -1).sum(axis=1)
    assert np.array_equal(o.film, expected)
    assert seen(stream).film is None


def test_rate_is_between_the_ends_and_by_count_below_two_spikes():
    spikes = random_spikes((5, 7))
    rate = seen(spikes).rate
    assert rate[1] == 0.0
    assert rate[2] == 1 / 300
    assert rate[3] == 1 / (299 - 4)
    t = np.flatnonzero(spikes.reshape(300, -1)[:, 20])
    assert rate[20] == (t.size - 1) / (t[-1] - t[0])


def test_spikes_at_the_very_ends_of_words_are_found():
    """Frames 0, 63, 64, 127 and the last; pixels 0, 7, 63, 64 of the array."""
    frames = [0, 63, 64, 127, 129]
    spikes = np.zeros((130, 5, 13), np.uint8)
    flat = spikes.reshape(130, -1)
    for p in (0, 7, 63, 64):
        flat[frames, p] = 1
    o = seen(spikes)
    for p in range(65):
        lit = p in (0, 7, 63, 64)
        assert o.times.count[p] == (len(frames) if lit else 0)
        assert (o.times.first[p], o.times.last[p]) == ((0, 129) if lit else (-1, -1))
    assert [int(d) for d in np.flatnonzero(o.lengths) + 1] == sorted({b - a for a, b in pairwise(frames)})


def test_an_empty_and_a_full_stream():
    empty, full = seen(np.zeros((70, 4, 5), np.uint8)), seen(np.ones((70, 4, 5), np.uint8))
    assert empty.frame.sum() == 0 and np.all(empty.times.first == -1) and np.isnan(empty.variance).all()
    assert full.times.count.min() == 70 and full.lengths[0] == 69 * 20 and full.lengths[1:].sum() == 0
    assert np.all(full.variance == 0) and np.all(full.late == 0) and full.odd.sum() == 0
