"""Fixed pattern where the scene moves: without the light the same is found as with it."""

from __future__ import annotations

import numpy as np
import pytest

from denoiser.evaluate.fixed_pattern import evaluate_pattern, evaluate_simulated_pattern, report
from spikecam_env.errors import InputError


@pytest.fixture(scope="module")
def results():
    return evaluate_simulated_pattern({}, shape=(64, 64))


@pytest.mark.parametrize("model, size", [("scsim", 0.073), ("measured", 0.020)])
def test_the_pattern_has_the_size_of_the_cameras_spread(model, size, results):
    """SCSim: 7.3 % of pixel-to-pixel response; `measured`: 2.0 %, and the spread of the dark current."""
    row = results[model]["rows"][0]
    print(
        f"{model}: {100 * row['pattern']:.2f} +- {100 * row['pattern_error']:.2f} %, known {row['pattern_known']:.4f}"
    )
    assert row["pattern"] == pytest.approx(row["pattern_known"], rel=0.03)
    assert row["pattern_known"] == pytest.approx(size, rel=0.15)


def test_the_scene_does_not_show(results):
    for model, result in results.items():
        print(f"{model}: elsewhere {result['elsewhere']:+.3f}")
        assert abs(result["elsewhere"]) < 0.1
        assert model in report(result, model) and "light known" in report(result, model)


def test_a_scene_that_stands_is_seen_elsewhere():
    """Two looks at one texture share more than a pattern."""
    rng = np.random.default_rng(6)
    texture = np.repeat(np.repeat(rng.random((12, 12)), 4, axis=0), 4, axis=1)
    spikes = (rng.random((200, 48, 48)) < 0.5 * texture).astype(np.uint8)
    assert evaluate_pattern(spikes, {})["elsewhere"] > 0.1


def test_a_short_recording_is_refused():
    with pytest.raises(InputError, match="two looks of 64"):
        evaluate_pattern(np.zeros((150, 8, 8), np.uint8), {})
