"""Which pixels of a scene count as in step with the read-out's clock, by made-up rates."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from spikecam_env.calibration.real import ideal_second_difference
from spikecam_env.gap.observe.observation import DIFFERENCES
from spikecam_env.gap.statistics.clock import statistics
from spikecam_env.gap.statistics.reading import root

SCENE = [SimpleNamespace(kind="unknown")]


def clock(intervals: np.ndarray, excess: np.ndarray, terms: int = 50_000) -> dict[str, float]:
    """Statistics of pixels of mean intervals (P,), with second differences `excess` (P,) above an ideal pixel's."""
    ideal = np.stack([ideal_second_difference(np.array(k), intervals) for k in DIFFERENCES], axis=1)
    times = SimpleNamespace(
        rate=1.0 / intervals,
        count=np.full(intervals.size, 100),
        terms=np.full(ideal.shape, terms),
        square=terms * (ideal + excess[:, None]),
    )
    base = SimpleNamespace(live=np.ones(intervals.size, bool))
    return statistics(SimpleNamespace(conditions=SCENE, observations=[SimpleNamespace(times=times)], base=base), 0)


@pytest.mark.parametrize("off, counted", [(0.003, True), (-0.003, True), (0.007, False), (-0.007, False)])
def test_a_pixel_within_a_200th_of_a_frame_of_a_whole_interval_is_counted(off, counted):
    found = clock(np.array([10.0 + off, 7.5, 8.4]), np.zeros(3))
    assert found["whole"] == pytest.approx(root(1.0 if counted else 0.0))


@pytest.mark.parametrize("off, part", [(0.03, "above"), (-0.03, "below"), (0.06, "between"), (-0.06, "between")])
def test_a_pixel_within_a_25th_of_a_frame_is_beside_it(off, part):
    found = clock(np.array([10.0 + off, 7.5]), np.array([0.2, 0.0]))
    shows = 0.2 if part != "between" else 0.1  # of two pixels between
    for k in DIFFERENCES:
        assert found[f"A_{k} {part}"] == pytest.approx(1e3 * shows / (2 * k), rel=1e-3)
        assert f"A_{k} above" not in found or part == "above"


@pytest.mark.parametrize("terms, stated", [(15_000, False), (30_000, True)])
def test_a_mean_is_of_20_000_second_differences(terms, stated):
    assert ("A_1 between" in clock(np.array([7.5]), np.zeros(1), terms)) == stated
