"""The evaluation: held out from training, and its bound is a bound."""

from __future__ import annotations

import json

import numpy as np
import pytest

from denoiser.evaluate import HELD_OUT_KINDS, PICTURES, evaluate_quick, held_out_textures, report
from denoiser.training.pairs import TRAINING_KINDS


def test_no_held_out_texture_kind_is_trained_on():
    assert not set(HELD_OUT_KINDS) & set(TRAINING_KINDS)
    textures = held_out_textures(0, 64)
    assert len(textures) == 11
    assert all(t.shape == (64, 64) and t.min() >= 0 and t.max() <= 1 for t in textures)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    out = tmp_path_factory.mktemp("evaluation")
    found = evaluate_quick(("best",), scenes_a_class=1, shape=(48, 48), frames=152, out=out)
    assert json.loads((out / "evaluate.json").read_text())["settings"] == found["settings"]
    assert (out / "evaluate.txt").read_text() == report(found)
    return found


def test_rows_run_from_noisy_to_clean_and_the_oracle(result):
    assert list(result["all well lit"]) == ["noisy", "best", "best rate", "clean", "oracle"]
    for picture in PICTURES:
        noisy, clean = (result["all well lit"][row][picture]["gap_closed"] for row in ("noisy", "clean"))
        assert (noisy, clean) in ((0, 1), (None, None))


def test_the_oracle_is_as_good_as_the_clean_stream_against_the_light(result):
    table = result["all well lit"]
    for picture in ("TFP 21", "TFP 41"):
        difference = table["oracle"][picture]["light_db"] - table["clean"][picture]["light_db"]
        print(f"{picture}: oracle - clean {difference:+.2f} dB")
        assert abs(difference) < 0.5


def test_shipped_best_is_nearer_to_the_light_than_noisy(result):
    table = result["all well lit"]
    for picture in ("TFP 21", "TFP 41"):
        noisy, best = (table[row][picture]["light_db"] for row in ("noisy", "best"))
        print(f"{picture}: noisy {noisy:.2f} dB, best {best:.2f} dB")
        assert np.isfinite(best) and best > noisy + 1
