"""Phases under a disturbance by the array's clock: the law, own pixels and the estimate against each other."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.clock import phases
from benchmarks.clock.campaign import OFFSETS, counted, spike_steps
from benchmarks.clock.measure import measure, row_phase
from benchmarks.clock.phases import PHASES, edge, sampled, walk
from benchmarks.clock.pixels import POINTS, counts, falling_edge, recorded, tabled

NOISE = 0.0077
ROWS, ACROSS = 64, 64
FALL = (-8e-3, 0.4, 0.2)
TABLE = falling_edge(np.arange(POINTS) / POINTS, *FALL, 0.0)


def _steps(span: float, frames: int = 2000):  # type: ignore[no-untyped-def]
    """Steps of pixels at T = 2 + d, d uniform, whose rows are read over `span` frames."""
    rng = np.random.default_rng(0)
    row = np.repeat(np.arange(ROWS), ACROSS)
    offset = rng.uniform(OFFSETS[0], OFFSETS[-1], row.size)
    start = np.mod(row_phase(ROWS, span), 1.0)[row]
    return counted(spike_steps(recorded(2.0 + offset, start, TABLE, NOISE**2, frames, rng), 2), offset, row, 2)


def test_every_row_sees_the_same_drift() -> None:
    """up - down is what the phase moves on by a spike, whatever phase a row begins at: to a third of a cell."""
    seen = walk(sampled(edge, *FALL), NOISE, 2.0, OFFSETS)
    drift = seen.up - seen.down
    spread = np.ptp(drift, axis=1).max()
    print(f"largest difference of the drift between phases: {spread:.1e} frames of {np.abs(drift).max():.3f}")
    assert spread < 1.0 / PHASES / 3.0


def test_without_a_disturbance_the_drift_is_the_offset() -> None:
    seen = walk(sampled(edge, 0.0, 0.4, 0.2), NOISE, 2.0, OFFSETS)
    assert np.allclose(seen.up - seen.down, OFFSETS[:, None], atol=1e-6)


@pytest.mark.parametrize("amplitude", [-8e-3, 8e-3])
def test_pixels_gather_where_the_drift_has_a_zero(amplitude: float) -> None:
    """-T max c <= d <= -T min c, the fixed points of the noise-free map; half as far beyond, the phase walks."""
    c = sampled(edge, amplitude, 0.4, 0.2)
    least, most = -2.0 * c.max(), -2.0 * c.min()
    middle, beyond = 0.5 * (least + most), most + 0.5 * (most - least)
    seen = walk(c, 0.002, 2.0, np.array([middle, beyond]))
    drift = (seen.up - seen.down).mean(axis=1)
    print(f"offsets {middle:+.4f}, {beyond:+.4f}: drifts {drift[0]:+.5f}, {drift[1]:+.5f}")
    assert abs(drift[0]) < 0.05 * abs(middle) + 2e-4
    assert drift[1] > 0.5 * beyond


def test_own_pixels_step_as_the_law_of_phases_has_it() -> None:
    """Counts of 4096 pixels: the mean square of their distance from the law, by row and offset."""
    steps = _steps(-0.9)
    seen = walk(sampled(edge, *FALL), NOISE, 2.0, OFFSETS)
    gathering = np.abs(OFFSETS) < 0.02
    up, down = seen.at(np.arange(OFFSETS.size), row_phase(ROWS, -0.9)[:, None])
    plain = walk(sampled(edge, 0.0, 0.4, 0.2), NOISE, 2.0, OFFSETS)
    sizes = []
    for share in (up + down, (plain.up + plain.down).mean(axis=1)):
        off = (steps.shifts - steps.intervals * share) / np.sqrt(steps.intervals * share + 4.0)
        sizes.append(float(np.mean(off[:, gathering] ** 2)))
    print(f"mean square by the law {sizes[0]:.2f}, without c {sizes[1]:.2f}")
    assert sizes[0] < 5.0  # a pixel's steps come in runs
    assert sizes[1] > 4.0 * sizes[0]


@pytest.mark.parametrize("fall", [0.0, 0.04])
def test_an_edge_has_mean_zero_and_period_one(fall: float) -> None:
    law = falling_edge(np.arange(20_000) / 20_000, -8e-3, 0.4, 0.2, fall)
    assert abs(law.mean()) < 2e-6
    if fall:
        assert np.abs(np.diff(np.append(law, law[0]))).max() < 8e-3 / (20_000 * fall) * 1.1  # no jump is left
    else:
        assert np.ptp(law) == pytest.approx(8e-3 * (1.0 - np.exp(-5.0)), rel=1e-3)


def test_pixels_without_a_disturbance_keep_their_rate() -> None:
    interval = np.full(500, 6.3)
    n = counts(interval, np.zeros(500), tabled(None), 3e-5, 4000, np.random.default_rng(0))
    print(f"{n.mean():.2f} spikes, {4000 / 6.3:.2f} expected")
    assert abs(n.mean() - 4000 / 6.3) < 0.1


@pytest.mark.slow
def test_amplitude_moment_tau_and_span_are_recovered_to_ten_per_cent(monkeypatch) -> None:
    """By half as many phases, whose probabilities a fit solves for six hundred times."""
    monkeypatch.setattr(phases, "PHASES", PHASES // 2)
    found = measure(_steps(-0.9))
    print(f"amplitude {found.amplitude:.5f}, moment {found.moment:.3f}, tau {found.tau:.3f}, span {found.span:.3f}")
    assert found.amplitude == pytest.approx(FALL[0], rel=0.1)
    assert found.moment == pytest.approx(FALL[1], abs=0.05)
    assert found.tau == pytest.approx(FALL[2], rel=0.1)
    assert found.span == pytest.approx(-0.9, rel=0.1)
