"""The truth tests together, small, without recordings and with them."""

from __future__ import annotations

import json
from functools import partial

import numpy as np
import pytest

from denoiser.evaluate import truth
from denoiser.evaluate.quick import evaluate_quick
from denoiser.evaluate.writing import write_result
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.streams import save_npz


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """No modes; scenes of 32 x 32 pixels, and a recording of a scene at rest as both recordings."""
    path = tmp_path_factory.mktemp("recording") / "rest.npz"
    light = np.random.default_rng(9).uniform(0.1, 0.5, (32, 40)).astype(np.float32)
    save_npz(path, SpikeSensor(SensorModel.preset("scsim"), (32, 40), seed=1).step(light, 260))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(truth, "evaluate_quick", partial(evaluate_quick, shape=(32, 32), frames=152))
        return truth.evaluate_truth(path, path, ())


def test_every_test_is_there_and_in_the_report(result, tmp_path):
    assert list(result["pattern"]) == ["rest.npz", "scsim", "measured"]
    assert list(result["measured"]) == ["measured", "measured, without shading"]
    text = truth.report(result)
    for words in ("rest.npz, against itself", "noisy half", "light known", "without shading", "well lit, moving"):
        assert words in text
    write_result(tmp_path, "truth", result, text)
    assert json.loads((tmp_path / "truth.json").read_text())["settings"]["modes"] == []
    assert (tmp_path / "truth.txt").read_text() == text


def test_shading_is_what_a_camera_without_noise_does_not_have(result):
    with_it, without = (found["well lit, static"] for found in result["measured"].values())
    for picture in ("TFP 21", "TFP 41"):
        noisy, even, clean = (
            t[row][picture]["light_db"] for t, row in ((with_it, "noisy"), (without, "noisy"), (without, "clean"))
        )
        print(f"{picture}: noisy with shading {noisy:.2f}, without {even:.2f}, clean {clean:.2f} dB")
        assert noisy < even - 1 < clean
        assert with_it["clean"][picture]["light_db"] == clean


def test_recordings_may_be_missing_but_not_unreadable(tmp_path):
    with pytest.raises(InputError, match=r"none\.npz"):
        truth.evaluate_truth(tmp_path / "none.npz", None, ())


def test_what_is_not_finite_is_null_in_the_file(tmp_path):
    write_result(tmp_path, "x", {"rows": [{"dB": float("inf"), "bias": 0.5}]}, "text")
    assert json.loads((tmp_path / "x.json").read_text()) == {"rows": [{"dB": None, "bias": 0.5}]}
