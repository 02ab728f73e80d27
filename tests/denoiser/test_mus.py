"""MUS: the incremental decoder is the paper's equation, and keeps the rate."""

from __future__ import annotations

import math

import numpy as np
import pytest

from denoiser.decoders import mus


def literal(planes: np.ndarray, first_wait: float) -> np.ndarray:
    """Paper (23) for one pixel, interval by interval: end = min of t + ISI_t over t0 <= t < end."""
    interval = [1.0 / min(max(float(r), mus.SLOWEST), 1.0) for r in planes]
    spikes = np.zeros(len(planes), np.uint8)
    end = first_wait * interval[0] - 1.0
    t = 0
    while True:
        while t < end and t < len(planes):
            end = min(end, t + interval[t])
            t += 1
        frame = max(math.ceil(end), 0)
        if frame >= len(planes):
            return spikes
        spikes[frame] = 1
        end = end + interval[frame]
        t = frame + 1


def random_planes(seed: int, frames: int = 300) -> np.ndarray:
    rng = np.random.default_rng(seed)
    base = rng.random((1, 4, 6)) ** 2
    return (base * rng.uniform(0.5, 1.5, (frames, 4, 6))).astype(np.float32)


@pytest.mark.parametrize("seed", range(5))
def test_incremental_decoding_is_the_literal_equation(seed):
    planes = random_planes(seed)
    state = mus.start((4, 6))
    spikes, _ = mus.step(planes, state)
    for pixel in np.ndindex(4, 6):
        assert np.array_equal(
            spikes[:, pixel[0], pixel[1]], literal(planes[:, pixel[0], pixel[1]], float(state.wait[pixel]))
        )


def test_a_steady_rate_is_kept_whatever_its_fraction():
    """Rounding every interval to a frame would give 1/3 for a rate of 0.29 and 1/2 for 0.41."""
    rates = np.linspace(0.02, 0.98, 49, dtype=np.float32).reshape(7, 7)
    spikes, _ = mus.step(np.broadcast_to(rates, (2000, 7, 7)), mus.start((7, 7)))
    worst = abs(spikes.sum(axis=0) - 2000 * rates).max()
    print(f"worst count error over 2000 frames {worst:.2f} spikes")
    assert worst <= 1.001


def test_a_later_plane_can_only_shorten_the_interval():
    planes = np.full((60, 1, 1), 1 / 40, np.float32)
    long, _ = mus.step(planes, mus.MusState(np.ones((1, 1)), False))
    planes[5:] = 1 / 10
    short, _ = mus.step(planes, mus.MusState(np.ones((1, 1)), False))
    assert np.flatnonzero(long)[0] == 39 and np.flatnonzero(short)[0] == 15


def test_rates_beyond_what_a_pixel_can_do_are_cut():
    planes = np.array([5.0, -1.0, np.inf, 0.0], np.float32).reshape(4, 1, 1)
    spikes, state = mus.step(planes, mus.start((1, 1)))
    assert set(np.unique(spikes)) <= {0, 1} and np.isfinite(state.wait).all()
