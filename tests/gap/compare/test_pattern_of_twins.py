"""An effect moves the pattern of its twins' rates: where by more than fresh units vary, it is predicted."""

from __future__ import annotations

import numpy as np
import pytest
import small
from small import MODEL, effect, recorded, unit

from spikecam_env.gap.compare.prediction import Draw, Null, with_pattern_moved
from spikecam_env.gap.fit.predict import predict_by_twins
from spikecam_env.gap.statistics import StatisticKey

KEYS = (StatisticKey("rates", "flat", "slope"), StatisticKey("pattern", "flat", "width"))
WITHOUT = Draw(0, np.array([1.0, 5.0]), None, np.array([np.nan, 7.0]))
NULL = Null(KEYS, np.array([1.0, 5.5]), np.ones(2), np.zeros(2), 12, 11.0, draws=(WITHOUT,))


@pytest.mark.parametrize("moved, predicted", [(0.6, False), (1.6, True), (-3.0, True)])
def test_a_pattern_is_moved_as_that_of_the_twin_is(moved: float, predicted: bool):
    made = Draw(0, np.array([2.0, np.nan]), None, np.array([np.nan, 7.0 + moved]))
    values = with_pattern_moved(NULL, made).values
    assert values[0] == 2.0 and (values[1] == pytest.approx(5.0 + moved) if predicted else np.isnan(values[1]))


def test_a_synchronous_reset_narrows_the_pattern_of_bright_flats():
    """Intervals are whole numbers of frames, and most pixels of a flat have the same."""
    found = effect("synchronous_reset", fraction=1.0)
    case, null = recorded(found), small.null()
    predicted = predict_by_twins(recorded(), MODEL.with_effect(found), unit(), null, 1)
    width = [j for j, k in enumerate(null.keys) if (k.group, k.name, k.recording) == ("pattern", "width", "flat-0.65")]
    change = (predicted.mean - null.mean)[width] / null.noise[width]
    measured = (np.array([case.bank[null.keys[j]] for j in width]) - null.mean[width]) / null.noise[width]
    print(f"predicted {change}, measured {measured} noises")
    assert len(width) == 1 and change < -5.0 and change == pytest.approx(measured, rel=0.3)
