"""Accumulation: no stretch of the stream is off by more than a spike."""

from __future__ import annotations

import numpy as np

from denoiser.decoders import accumulate

SHAPE = (6, 8)


def rates(seed: int = 0, frames: int = 400) -> np.ndarray:
    return np.random.default_rng(seed).random((frames, *SHAPE), dtype=np.float32)


def test_count_of_any_stretch_is_the_sum_of_its_rates_within_one():
    given = rates()
    spikes, _ = accumulate.step(given, accumulate.start(SHAPE))
    drift = np.cumsum(spikes - given.astype(np.float64), axis=0)
    widest = (drift.max(axis=0) - drift.min(axis=0)).max()
    print(f"largest difference over any stretch {widest:.4f} spikes")
    assert widest < 1 + 1e-9


def test_rates_outside_zero_to_one_are_cut():
    given = np.broadcast_to(np.array([-0.5, 1.5], np.float32), (10, 1, 2))
    spikes, state = accumulate.step(given, accumulate.start((1, 2)))
    assert spikes[:, 0, 0].sum() == 0 and spikes[:, 0, 1].sum() == 10
    assert (state.charge >= 0).all() and (state.charge < 1).all()


def test_starting_phases_are_uniform():
    phase = np.sort(accumulate.start((64, 64)).charge, axis=None)
    worst = abs(phase - (np.arange(4096) + 0.5) / 4096).max()
    print(f"largest distance from uniform {worst:.4f}")
    assert worst < 1.63 / 64  # Kolmogorov-Smirnov at 1 %, 4096 pixels
