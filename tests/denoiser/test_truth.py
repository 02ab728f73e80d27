"""The truth tests together, small, without recordings and with them."""

from __future__ import annotations

import json
from functools import partial

import numpy as np
import pytest

from denoiser.evaluate import truth
from denoiser.evaluate.quick import held_out_tables
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.streams import save_npz


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """No modes; scenes of 32 x 32 pixels, and a recording of a scene at rest as both recordings."""
    folder = tmp_path_factory.mktemp("recording")
    path = folder / "rest.npz"
    light = np.random.default_rng(9).uniform(0.1, 0.5, (32, 40)).astype(np.float32)
    save_npz(path, SpikeSensor(SensorModel.preset("scsim"), (32, 40), seed=1).step(light, 260))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(truth, "held_out_tables", partial(held_out_tables, shape=(32, 32), frames=152))
        found = truth.evaluate_truth(path, path, (), out=folder / "out")
    assert (folder / "out" / "truth.txt").read_text() == truth.report(found)
    assert json.loads((folder / "out" / "truth.json").read_text())["measured"] == found["measured"]
    return found


def test_every_test_is_there_and_in_the_report(result):
    assert list(result["pattern"]) == ["rest.npz", "scsim", "measured"]
    assert list(result["measured"]) == ["measured", "measured, without shading"]
    text = truth.report(result)
    for words in ("rest.npz, against itself", "noisy half", "light known", "without shading", "well lit, moving"):
        assert words in text


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
