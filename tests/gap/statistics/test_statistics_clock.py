"""Which pixels and spikes of a scene count as in step with the array's clock, by made-up rates."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from spikecam_env.calibration.spike_times import ideal_second_difference
from spikecam_env.gap.observe.observation import DIFFERENCES
from spikecam_env.gap.statistics import StatisticKey, floor_of
from spikecam_env.gap.statistics.clock import bands, statistics
from spikecam_env.gap.statistics.reading import root

SCENE = [SimpleNamespace(kind="unknown")]


def clock(
    intervals: np.ndarray,
    excess: np.ndarray,
    terms: int = 50_000,
    rows: int = 1,
    frames: int = 500,
    flips: np.ndarray | None = None,
) -> dict[str, float]:
    """Statistics of pixels of mean intervals (P,), with second differences `excess` (P,) above an ideal pixel's."""
    ideal = np.stack([ideal_second_difference(np.array(k), intervals) for k in DIFFERENCES], axis=1)
    times = SimpleNamespace(
        rate=1.0 / intervals,
        count=np.full(intervals.size, 100),
        terms=np.full(ideal.shape, terms),
        square=terms * (ideal + excess[:, None]),
    )
    base = SimpleNamespace(live=np.ones(intervals.size, bool))
    flips = np.zeros((intervals.size, 2), int) if flips is None else flips
    seen = SimpleNamespace(times=times, shape=(rows, intervals.size // rows), frames=frames, flips=flips)
    return statistics(SimpleNamespace(conditions=SCENE, observations=[seen], base=base), 0)


@pytest.mark.parametrize("off, counted", [(0.003, True), (-0.003, True), (0.007, False), (-0.007, False)])
def test_a_pixel_within_a_200th_of_a_frame_of_a_whole_interval_is_counted(off, counted):
    found = clock(np.array([10.0 + off, 7.5, 8.4]), np.zeros(3))
    assert found["whole 0"] == pytest.approx(root(1.0 if counted else 0.0))


@pytest.mark.parametrize("off, part", [(0.03, "above"), (-0.03, "below"), (0.06, "between"), (-0.06, "between")])
def test_a_pixel_within_a_25th_of_a_frame_is_beside_it(off, part):
    found = clock(np.array([10.0 + off, 7.5]), np.array([0.2, 0.0]))
    if part == "between":
        for k in DIFFERENCES:
            assert found[f"A_{k} between"] == pytest.approx(1e3 * 0.1 / (2 * k), rel=1e-3)  # of two pixels
        assert "A_1 below 0" not in found and "A_1 above 0" not in found
    else:
        assert found[f"A_1 {part} 0"] == pytest.approx(1e3 * 0.2 / 2, rel=1e-3)


@pytest.mark.parametrize("frames, count", [(800, 1), (1700, 1), (3400, 3), (100_000, 10)])
def test_bands_are_of_1_2_million_pixel_frames_and_ten_at_most(frames, count):
    found = bands((30, 40), frames)
    assert len(found) == count
    assert np.all(np.sum(found, axis=0) == 1)
    assert all(np.ptp(np.flatnonzero(band)) < 1200 / count + 40 for band in found), "a band is of rows side by side"


def test_late_and_early_spikes_are_those_of_their_rows():
    """Twenty rows of two pixels, long enough for ten bands: only rows 6 and 7 have any."""
    flips = np.zeros((40, 2), int)
    flips[12:16] = (5, 1)
    found = clock(np.full(40, 7.01), np.zeros(40), rows=20, frames=1_000_000, flips=flips)
    assert found["late 3"] == pytest.approx(root(20.0)) and found["early 3"] == pytest.approx(root(4.0))
    assert all(found[f"{name} {b}"] == root(0.0) for name in ("late", "early") for b in range(10) if b != 3)


@pytest.mark.parametrize("name", ["whole 0", "late 3", "early 9"])
def test_counts_are_exact_to_their_own_chance(name):
    assert floor_of(StatisticKey("clock", "wall", name)) == 1.0
