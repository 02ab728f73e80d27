"""The evaluation: held out from training, and its bound is a bound."""

from __future__ import annotations

import json

import numpy as np
import pytest

from denoiser.evaluate import HELD_OUT_KINDS, PICTURES, evaluate_quick, held_out_textures, report, work
from denoiser.training.pairs import TRAINING_KINDS
from spikecam_env.errors import InputError


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
    return found | {"out": out}


def test_an_evaluation_goes_on_where_it_was_and_refuses_other_settings(result, monkeypatch):
    """No stream is denoised again for the same question, and those of a new mode alone for a wider one."""
    done = []
    monkeypatch.setattr(work, "do", lambda item, do=work.do: done.append((item.case.scene, item.source)) or do(item))
    same = {"scenes_a_class": 1, "shape": (48, 48), "frames": 152, "out": result["out"]}
    assert evaluate_quick(("best",), **same) == {name: found for name, found in result.items() if name != "out"}
    assert not done
    evaluate_quick(("best", "fast"), **same)
    assert len(done) == 9 and {source for _, source in done} == {"fast"}
    with pytest.raises(InputError, match="other settings: frames 152"):
        evaluate_quick(("best",), **same | {"frames": 160})


def test_unknown_modes_and_unreadable_weights_are_refused_before_the_folder(tmp_path):
    (tmp_path / "x.pt").write_text("text")
    for options, why in (({"modes": ("bets",)}, "best"), ({"weights": {"best": tmp_path / "x.pt"}}, r"x\.pt")):
        with pytest.raises(InputError, match=why):
            evaluate_quick(**options, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


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
