"""Read-out: when rows are read and which bits arrive; each against its closed form."""

from __future__ import annotations

import numpy as np
import pytest
from laws import camera, check, check_mean, population

from spikecam_env.sensor import Keyframes, SpikeSensor

SHAPE = (40, 50)


def lit(level: float, shape: tuple[int, int] = SHAPE) -> np.ndarray:
    return np.full(shape, level, dtype=np.float32)


def ideal_bits(level: float, frames: int) -> np.ndarray:
    return SpikeSensor("ideal", SHAPE, 0).step(lit(level), frames).astype(bool)


def test_clock_jitter_moves_the_share_of_a_frame_in_proportion_to_light() -> None:
    """Variance 2 (x sigma)^2, lag-1 -(x sigma)^2; P random phases add x (1 - x) / P and -x^2 / P."""
    pixels, sigma = 20_000, 0.05
    for x in (0.1, 0.3):
        off = np.array(
            [population(camera("clock_jitter", (1, pixels), s, sigma_ns=25_000 * sigma), x, 16) - x for s in range(40)]
        )
        check_mean(f"variance at x = {x}", off**2, 2 * (x * sigma) ** 2 + x * (1 - x) / pixels)
        if x == 0.3:
            check_mean("lag-1", off[:, 1:] * off[:, :-1], -((x * sigma) ** 2) - x**2 / pixels)


def test_readout_skew_shows_a_step_of_light_later_in_the_rows_read_first() -> None:
    """First frame after the step: row r collects 1 - s (1 - r/(H-1)) of its light, the next frame all of it."""
    rows, columns, span, x = 11, 8000, 0.8, 0.5
    sensor = camera("readout_skew", (rows, columns), span=span)
    sensor.step(lit(0.0, (rows, columns)), 3)
    share = sensor.step(lit(x, (rows, columns)), 3).mean(axis=2)
    early = span * (1 - np.arange(rows) / (rows - 1))
    error = 4.5 * 0.5 / np.sqrt(columns)
    print("first frame by row:", np.round(share[0], 3))
    assert np.abs(share[0] - x * (1 - early)).max() < error
    assert np.abs(share[1:] - x).max() < error


@pytest.mark.parametrize("span", [0.8, 1.25, -0.8, -1.25])
def test_readout_skew_of_light_that_changes_within_a_frame_is_its_integral_over_the_frame_that_is_read(
    span: float,
) -> None:
    """A rise within frame 100, and a slow fall: a row read e early has the light from n - e to n + 1 - e.

    e falls from |span| in the row read first, the first of all where span > 0, to 0 in the last."""
    rows, columns = 11, 6000
    early = abs(span) * np.linspace(1.0, 0.0, rows)[:: 1 if span > 0 else -1]
    edges, levels = np.array([0.0, 100.0, 101.0, 110.0, 114.0]), np.array([0.2, 0.2, 0.6, 0.6, 0.3])
    light = Keyframes(edges, np.broadcast_to(levels[:, None, None].astype(np.float32), (5, rows, columns)))
    share = camera("readout_skew", (rows, columns), span=span).step(light, 120)[98:116].mean(axis=2)
    time = np.linspace(0.0, 120.0, 120 * 1000 + 1)
    total = np.concatenate([[0.0], np.cumsum(np.interp(0.5 * (time[1:] + time[:-1]), edges, levels)) / 1000])
    collected = lambda t: np.interp(t, time, total)  # noqa: E731
    begin = np.arange(98, 116)[:, None] - early
    expected = collected(begin + 1) - collected(begin)
    print("frame of the edge, by row:", np.round(share[2] - expected[2], 3))
    assert np.abs(share - expected).max() < 4.5 * 0.5 / np.sqrt(columns)


@pytest.mark.parametrize("span", [0.9, 1.25, -1.1])
def test_readout_skew_alone_does_nothing_in_steady_light(span: float) -> None:
    assert np.array_equal(camera("readout_skew", SHAPE, span=span).step(lit(0.37), 200), ideal_bits(0.37, 200))


def test_dead_pixels_never_fire_and_the_others_fire_as_before() -> None:
    wide = (200, 250)
    spikes = camera("dead_pixels", wide, fraction=0.2).step(lit(0.5, wide), 10).astype(bool)
    alive = spikes.any(axis=0)
    check("alive", alive.mean(), 0.8, 4.5 * np.sqrt(0.16 / alive.size))
    assert np.array_equal(spikes, SpikeSensor("ideal", wide, 0).step(lit(0.5, wide), 10).astype(bool) & alive)


def test_missed_spikes_lowers_the_rate_by_their_share_and_adds_none() -> None:
    spikes, true = (
        camera("missed_spikes", SHAPE, probability=0.1).step(lit(0.3), 400).astype(bool),
        ideal_bits(0.3, 400),
    )
    assert not np.any(spikes & ~true)
    check("kept", spikes.sum() / true.sum(), 0.9, 4.5 * np.sqrt(0.09 / true.sum()))


def test_spurious_spikes_fill_empty_bits_with_their_probability_and_lose_none() -> None:
    p = 0.02
    for level in (0.0, 0.3):
        spikes = camera("spurious_spikes", SHAPE, probability=p).step(lit(level), 400).astype(bool)
        true = ideal_bits(level, 400)
        assert not np.any(true & ~spikes)
        check(f"filled at x = {level}", spikes[~true].mean(), p, 4.5 * np.sqrt(p / (~true).sum()))
    counts = camera("spurious_spikes", SHAPE, probability=p).step(lit(0.0), 400).sum(axis=0)
    expected = 400 * p * (1 - p)
    check("variance of dark counts", counts.var(), expected, 4.5 * expected * np.sqrt(2.2 / counts.size))


def test_afterpulsing_repeats_its_share_of_the_spikes_after_the_delay() -> None:
    """Rate x (1 + p) at T = 5 > 2 frames; new spikes lie two frames after a true one."""
    p = 0.1
    spikes = camera("afterpulsing", SHAPE, probability=p, delay_frames=2).step(lit(0.2), 400).astype(bool)
    true = ideal_bits(0.2, 400)
    new = spikes & ~true
    assert not np.any(true & ~spikes) and not np.any(new[2:] & ~true[:-2]) and not np.any(new[:2])
    check("repeated", new.sum() / true[:-2].sum(), p, 4.5 * np.sqrt(p / true.sum()))
