"""Spike-Zoo's protocol: its measures on pictures whose error is known, and on one of its own clips."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from denoiser.evaluate.spikezoo import evaluate_spikezoo, interval_picture, report, score
from spikecam_env.cli.main import run
from spikecam_env.datasets.spikezoo import find_clips, read_clip, write_clip
from spikecam_env.errors import InputError
from spikecam_env.streams import read_recording, read_truth

SYNTHETIC = Path(__file__).parents[2].parent / "shared" / "data" / "synthetic"


def test_an_offset_of_a_tenth_is_20_db():
    truth = np.linspace(0.1, 0.8, 400).reshape(20, 20)
    assert score(0.6 * (truth + 0.1), truth)["PSNR"] == pytest.approx(20.0)
    same = score(0.6 * truth, truth)
    assert same["PSNR"] > 150 and same["SSIM"] == pytest.approx(1) and same["SSIM [0, 1]"] == pytest.approx(1)


def test_errors_in_fine_detail_are_left_out_of_the_coarse_psnr():
    truth = np.full((40, 40), 0.5)
    checks = 0.1 * (-1.0) ** np.add.outer(np.arange(40), np.arange(40))
    found = score(0.6 * (truth + checks), truth)
    assert found["PSNR"] == pytest.approx(20.0) and found["coarse PSNR"] > 60
    assert score(0.6 * (truth + 0.1), truth)["coarse PSNR"] == pytest.approx(20.0)


def test_a_picture_is_cut_at_black_and_white():
    truth = np.linspace(0, 1, 400).reshape(20, 20)
    wild = 0.6 * np.where(truth > 0.5, 1.5, -0.5)
    assert score(wild, truth) == score(0.6 * np.where(truth > 0.5, 1.0, 0.0), truth)


def test_the_measures_are_those_of_pictures_from_minus_one_to_one():
    """In single precision and with scikit-image's own range, as Spike-Zoo computes them."""
    rng = np.random.default_rng(8)
    truth = rng.random((30, 40))
    picture = np.clip(truth + 0.1 * rng.standard_normal((30, 40)), 0, 1)
    a, b = (np.float32(2 * p - 1) for p in (picture, truth))
    found = score(0.6 * picture, truth)
    assert found["PSNR"] == pytest.approx(peak_signal_noise_ratio(a, b), abs=1e-3)
    assert found["SSIM"] == pytest.approx(structural_similarity(a, b, data_range=2), abs=1e-4)
    assert found["SSIM [0, 1]"] == pytest.approx(structural_similarity(picture, truth, data_range=1), abs=1e-9)


@pytest.mark.parametrize(
    "last, following, interval",
    [(50, 51, 1), (48, 53, 5), (31, 70, 39), (30, 60, 40), (45, 71, 40), (None, 55, 40), (45, None, 40)],
)
def test_an_interval_is_seen_20_frames_either_way(last, following, interval):
    """Of 101 frames, about frame 50: the last spike in 31 .. 50, the next in 51 .. 70, else 40 frames."""
    spikes = np.zeros((101, 1, 1), np.uint8)
    spikes[[t for t in (last, following) if t is not None]] = 1
    assert interval_picture(spikes, 50)[0, 0] == pytest.approx(1 / interval)


def test_a_stream_of_even_light_has_the_picture_that_it_should(tmp_path):
    """A spike in every third frame is grey 1/3 / 0.6."""
    spikes = np.zeros((63, 16, 24), np.uint8)
    spikes[::3] = 1
    write_clip(tmp_path, "a", spikes, np.full((16, 24), 1 / 3), bits=16)
    result = evaluate_spikezoo(tmp_path, (), pictures=("tfp21", "tfp41", "tfi"))
    found = {row["row"]: row["PSNR"] for row in result["rows"]}
    assert found["noisy TFP 41"] == pytest.approx(-20 * np.log10(abs(14 / 41 - 1 / 3) / 0.6), abs=0.05)
    assert min(found["noisy TFP 21"], found["noisy TFI"]) > 90
    assert "1 clips" in report(result)


def test_the_least_gain_is_over_the_best_classical_picture_of_the_worst_clip(tmp_path):
    """Clip a: 1/3 is exact in 21 frames, 1/4 in none; clip b has them exchanged in 41."""
    for name, every, light in (("a", 3, 1 / 3), ("b", 4, 0.25)):
        spikes = np.zeros((63, 16, 24), np.uint8)
        spikes[::every] = 1
        write_clip(tmp_path, name, spikes, np.full((16, 24), light), bits=16)
    result = evaluate_spikezoo(tmp_path, (), pictures=("tfp21", "tfp41"))
    clips = {(c["clip"], c["row"]): c["PSNR"] for c in result["clips"]}
    for row in result["rows"]:
        gains = [clips[n, row["row"]] - max(clips[n, f"noisy TFP {k}"] for k in (21, 41)) for n in "ab"]
        assert row["least gain"] == min(gains) <= 0


def test_a_learned_picture_costs_more_than_a_mean_and_a_denoised_one_more_than_a_noisy(tmp_path):
    write_clip(
        tmp_path, "a", (np.random.default_rng(0).random((63, 16, 24)) < 0.3).astype(np.uint8), np.zeros((16, 24))
    )
    result = evaluate_spikezoo(tmp_path, ("best", "best-overlap"), pictures=("tfp41", "spk2img-clean"))
    seconds = {row["row"]: row["seconds"] for row in result["rows"]}
    assert 0 < seconds["noisy TFP 41"] < seconds["noisy Spk2Img, clean"]
    assert 0 < seconds["best rate"] < seconds["best TFP 41"]


def test_two_processes_find_the_figures_of_one(tmp_path):
    for name in "ab":
        spikes = (np.random.default_rng(ord(name)).random((41, 16, 24)) < 0.3).astype(np.uint8)
        write_clip(tmp_path, name, spikes, np.full((16, 24), 0.2))
    one, two = (evaluate_spikezoo(tmp_path, (), pictures=("tfp21", "tfi"), jobs=jobs) for jobs in (1, 2))
    assert [(c["clip"], c["row"], c["PSNR"]) for c in one["clips"]] == [
        (c["clip"], c["row"], c["PSNR"]) for c in two["clips"]
    ]


@pytest.mark.parametrize("wrong", [{"modes": ("bets",)}, {"pictures": ("tfp40",)}, {"jobs": 0}])
def test_unknown_rows_are_refused(wrong, tmp_path):
    write_clip(tmp_path, "a", np.zeros((41, 16, 24), np.uint8), np.zeros((16, 24)))
    with pytest.raises(InputError, match=r"bets|tfp40|jobs"):
        evaluate_spikezoo(tmp_path, **wrong)


def test_a_picture_without_error_is_null_in_the_files_and_infinite_in_the_result(tmp_path):
    """Nothing fires before black: TFP is exact, TFI is 1/40 and cut at black no more."""
    write_clip(tmp_path, "a", np.zeros((63, 16, 24), np.uint8), np.zeros((16, 24)))
    for _ in range(2):  # made, then read
        result = evaluate_spikezoo(tmp_path, (), pictures=("tfp21", "tfi"), out=tmp_path / "out")
        assert result["clips"][0]["PSNR"] == result["rows"][0]["PSNR"] == np.inf
    assert json.loads((tmp_path / "out" / "spikezoo.json").read_text())["clips"][0]["PSNR"] is None


def test_a_clip_of_too_few_frames_is_refused(tmp_path):
    write_clip(tmp_path, "a", np.zeros((40, 16, 24), np.uint8), np.zeros((16, 24)))
    with pytest.raises(InputError, match="40 frames"):
        evaluate_spikezoo(tmp_path, ())


def test_a_film_is_exported_and_evaluated_with_its_own_spikes_and_truth(tmp_path, capsys):
    """Film to noisy spikes to Spike-Zoo's layout to figures, each by its command."""
    y, x = np.mgrid[:32, :48]
    film = [np.uint8(120 + 100 * np.sin((x + 2 * i) / 5) * np.cos(y / 4)) for i in range(9)]
    np.save(tmp_path / "wave.npy", film)
    steps = (
        f"film {tmp_path}/wave.npy --film-rate 1600 --transfer linear --size 32 48 --truth-every 25 --seed 1 "
        f"--mean-interval 5 --out {tmp_path}/wave.h5",
        f"export {tmp_path}/wave.h5 --frames 121 --out {tmp_path}/zoo",
        f"evaluate spikezoo {tmp_path}/zoo --modes best --out {tmp_path}/result",
    )
    for step in steps:
        assert run(step.split()) == 0
    printed = capsys.readouterr().out
    assert "best rate" in printed and "white is 0.6 spikes/frame" in printed
    spikes, picture = read_clip(*find_clips(tmp_path / "zoo"))
    truth = read_truth(tmp_path / "wave.h5")
    row = list(truth["frame"]).index(100.5)
    assert np.array_equal(spikes, read_recording(tmp_path / "wave.h5", first=40, count=121).spikes)
    assert np.abs(picture - np.minimum(truth["radiance"][row] / 0.6, 1)).max() <= 0.5 / 255 + 1e-6
    made = {f"spikezoo.{kind}" for kind in ("json", "jsonl", "txt", "csv", "png")}
    assert {p.name for p in (tmp_path / "result").iterdir()} == {*made, "pictures"}
    with (tmp_path / "result" / "spikezoo.csv").open(encoding="utf-8", newline="") as file:
        rows = {row["row"] for row in csv.DictReader(file)}
    assert {"noisy TFP 21", "noisy Spk2Img, clean", "best TFI", "best rate"} <= rows
    for row in rows:
        assert row in printed


@pytest.fixture(scope="module")
def reds(tmp_path_factory) -> Path:
    """Spike-Zoo's three REDS clips, laid out as it has them."""
    if not SYNTHETIC.is_dir():
        pytest.skip("the shared REDS clips are not here")
    folder = tmp_path_factory.mktemp("reds")
    for kind in ("spike", "gt"):
        (folder / kind).mkdir()
    for name in ("200_part1", "200_part3", "203_part1"):
        shutil.copyfile(SYNTHETIC / f"reds_{name}.dat", folder / "spike" / f"{name}.dat")
        shutil.copyfile(SYNTHETIC / f"reds_{name}_frame151.png", folder / "gt" / f"{name}.png")
    return folder


def test_the_reds_clips_are_upright_and_their_white_is_0_6(reds):
    for clip in find_clips(reds):
        spikes, picture = read_clip(clip)
        rate = spikes[130:171].mean(axis=0)
        share, upright, turned = rate.mean() / picture.mean(), score(rate, picture), score(rate[::-1], picture)
        print(f"{clip.name}: mean rate / mean picture {share:.4f}; upright {upright['PSNR']:.2f} dB")
        assert spikes.shape == (301, 250, 400)
        assert share == pytest.approx(0.6, rel=0.02)
        assert upright["PSNR"] > turned["PSNR"] + 5


@pytest.mark.slow
def test_rate_planes_are_nearer_to_the_reds_pictures_than_any_classical_one(reds):
    result = evaluate_spikezoo(reds, ("best",), pictures=("tfp21", "tfp41", "tfi"))
    rows = {row["row"]: row for row in result["rows"]}
    print(report(result))
    assert next(c["PSNR"] for c in result["clips"] if c["row"] == "noisy TFP 41") == pytest.approx(31.60, abs=0.01)
    assert rows["best rate"]["least gain"] > 4
