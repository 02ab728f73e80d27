"""`spikecam denoise`: its pictures, its film and its table, as a user reads them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from denoiser import denoise
from denoiser.evaluate.metrics import psnr_db
from denoiser.weights import pretrained_path
from spikecam_env.cli.screen.screen import MARGIN, panel_scale
from spikecam_env.streams import SpikeWriter, middleTFP, read_recording, read_truth, save_npz, save_vidar_dat
from tests.commands import film_in, picture_in, spikecam

SHAPE = (64, 96)
FRAMES = 130


@pytest.fixture(scope="module")
def disk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fast disk, denoised in the folder beside it."""
    file = tmp_path_factory.mktemp("denoise") / "disk.h5"
    assert spikecam("record", "--rpm", 6000, "--frames", FRAMES, "--size", *SHAPE, "--out", file) == 0
    assert spikecam("denoise", file, "--out", file.with_name("out")) == 0
    return file


def panel(picture: np.ndarray, number: int) -> np.ndarray:
    """Linear light of a panel, from 0, a pixel of the camera each; white is 1."""
    scale = panel_scale(SHAPE[1])
    left = MARGIN + number * (SHAPE[1] * scale + MARGIN) + scale // 2
    grey = picture[MARGIN + scale // 2 :: scale, left::scale, 0][: SHAPE[0], : SHAPE[1]]
    return (grey / 255.0) ** 2.2


def alike(shown: np.ndarray, picture: np.ndarray) -> float:
    """Correlation where the panel is not clipped."""
    inside = (shown > 0.001) & (shown < 0.99)
    return float(np.corrcoef(shown[inside], picture[inside])[0, 1])


def test_the_last_panel_is_the_rate_of_one_frame_in_the_picture_and_in_the_film(disk: Path) -> None:
    rates = denoise(read_recording(disk).spikes, output="rate")
    picture = picture_in(disk.with_name("out") / "pictures.png")
    frames = film_in(disk.with_name("out") / "film.mp4")
    first = 20  # the middle of the first whole window: the film has every frame from it on
    for what, shown, at, least in (
        ("picture", picture, FRAMES // 2, 0.9999),  # 8 bits of grey
        ("film", frames[FRAMES // 2 - first], FRAMES // 2, 0.99),  # and the loss of its encoding
    ):
        one, mean = rates[at], rates[at - 20 : at + 21].mean(axis=0)
        found = alike(panel(shown, 2), one), alike(panel(shown, 2), mean)
        print(f"{what}: correlation of the last panel with one frame {found[0]:.5f}, with a mean of 41 {found[1]:.5f}")
        assert found[0] > least > found[1]


def test_pictures_of_spikes_are_means_of_the_window(disk: Path) -> None:
    picture = picture_in(disk.with_name("out") / "pictures.png")
    for number, file in enumerate((disk, disk.with_name("out") / "denoised.h5")):
        spikes = read_recording(file).spikes
        assert alike(panel(picture, number), middleTFP(spikes, FRAMES // 2, 41)) > 0.999


def test_a_recording_has_the_light_of_its_middle_and_is_judged_by_it(disk: Path) -> None:
    truth, summary = read_truth(disk), json.loads((disk.with_name("out") / "summary.json").read_text())
    assert truth["frame"].tolist() == [FRAMES // 2 + 0.5]
    light = truth["radiance"][0]
    rate = denoise(read_recording(disk).spikes, output="rate")[FRAMES // 2]
    rows = {(row["picture"], row["of"]): row for row in summary["rows"]}
    scores = {name: row["PSNR, light [dB]"] for name, row in rows.items()}
    print(scores)
    assert scores["denoised rate", "one frame"] == pytest.approx(psnr_db(rate, light, light.max()))
    assert scores["denoised rate", "one frame"] > scores["noisy spikes", "mean of 41 frames"]
    assert alike(panel(picture_in(disk.with_name("out") / "pictures.png"), 3), light) > 0.999


def test_a_part_of_a_recording_is_denoised_as_if_it_were_the_whole(disk: Path, tmp_path: Path, capsys) -> None:
    part = ("--first", 40, "--count", 60, "--mode", "fast", "--no-film")
    assert spikecam("denoise", disk, *part, "--out", tmp_path / "part") == 0
    assert "true light" not in capsys.readouterr().err
    spikes = read_recording(disk).spikes[40:100]
    denoised = read_recording(tmp_path / "part" / "denoised.h5")
    np.testing.assert_array_equal(denoised.spikes, denoise(spikes, "fast", output="spikes"))
    summary = json.loads((tmp_path / "part" / "summary.json").read_text())
    assert denoised.attributes["first"] == summary["first"] == 40
    rate, light = denoise(spikes, "fast", output="rate")[FRAMES // 2 - 40], read_truth(disk)["radiance"][0]
    assert summary["rows"][-1]["PSNR, light [dB]"] == pytest.approx(psnr_db(rate, light, light.max()))


@pytest.mark.parametrize(
    ("part", "said"),
    [
        (("--first", FRAMES), f"frames {FRAMES} to {FRAMES} asked of"),
        (("--first", 100, "--count", 31), "frames 100 to 131 asked of"),
        (("--first", -1), "--first -1"),
        (("--count", 0), "--count 0"),
    ],
)
def test_a_part_that_a_recording_has_not_ends_in_one_line(part, said: str, disk: Path, tmp_path: Path, capsys) -> None:
    assert spikecam("denoise", disk, *part, "--out", tmp_path / "none") == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert len(error) == 1 and said in error[0] and not (tmp_path / "none").exists()


def test_weights_of_ones_own_take_the_place_of_the_mode(disk: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.pt"
    own.write_bytes(pretrained_path("fast").read_bytes())
    for name, which in (("own", ("--weights", own)), ("fast", ("--mode", "fast"))):
        options = ("--count", 60, "--no-film", "--out", tmp_path / name)
        assert spikecam("denoise", disk, *which, *options) == 0
    a, b = (read_recording(tmp_path / name / "denoised.h5") for name in ("own", "fast"))
    np.testing.assert_array_equal(a.spikes, b.spikes)
    assert (a.attributes["denoiser"], b.attributes["denoiser"]) == ("own.pt", "fast")


@pytest.mark.parametrize("suffix", [".dat", ".npz"])
def test_a_recording_without_truth_or_frame_rate_has_a_figure_in_every_cell(
    suffix: str, tmp_path: Path, capsys
) -> None:
    spikes = np.random.default_rng(0).random((60, 16, 24)) < 0.2
    save = save_vidar_dat if suffix == ".dat" else save_npz
    save(tmp_path / f"a{suffix}", spikes.astype(np.uint8))
    size = ("--height", 16, "--width", 24) if suffix == ".dat" else ()
    assert spikecam("denoise", tmp_path / f"a{suffix}", "--out", tmp_path / "out", "--no-film", *size) == 0
    printed = capsys.readouterr().out
    assert "-" not in printed.split() and "nan" not in printed and "install" not in printed, printed
    assert "PSNR" not in printed and "real time" not in printed, printed
    assert "latency, frames" in printed and "frames/s" in printed


@pytest.mark.parametrize(("frames", "window"), [(1, 1), (31, 31), (40, 39), (41, 41)])
def test_a_short_recording_is_denoised_too_and_says_how_many_frames_a_mean_is_of(
    frames: int, window: int, tmp_path: Path, capsys
) -> None:
    file = tmp_path / "short.h5"
    assert spikecam("record", "--frames", frames, "--size", 15, 33, "--out", file) == 0
    assert spikecam("denoise", file, "--out", tmp_path / "out") == 0
    assert (f"mean of {window} frames" if window > 1 else "one frame") in capsys.readouterr().out
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["window"] == window
    assert read_recording(tmp_path / "out" / "denoised.h5").spikes.shape == (frames, 15, 33)
    assert spikecam("denoise", file, "--out", tmp_path / "out", "--window", frames + 1 + frames % 2) == 2
    assert f"the recording has {frames} frames" in capsys.readouterr().err


def test_a_dark_recording_is_shown_black(tmp_path: Path, capsys) -> None:
    with SpikeWriter(tmp_path / "dark.h5", SHAPE, 40_000.0) as writer:
        writer.append(np.zeros((64, *SHAPE), np.uint8))
        writer.append_truth(32.5, radiance=np.zeros(SHAPE, np.float32))
    assert spikecam("denoise", tmp_path / "dark.h5", "--out", tmp_path / "out", "--no-film") == 0
    assert "nan" not in capsys.readouterr().out
    picture = picture_in(tmp_path / "out" / "pictures.png")
    assert panel(picture, 0).max() == 0


def test_light_of_another_size_is_refused_in_a_line(tmp_path: Path, capsys) -> None:
    with SpikeWriter(tmp_path / "odd.h5", SHAPE, 40_000.0) as writer:
        writer.append(np.zeros((64, *SHAPE), np.uint8))
        writer.append_truth(32.5, radiance=np.zeros((3, 3), np.float32))
    assert spikecam("denoise", tmp_path / "odd.h5", "--out", tmp_path / "out") == 2
    assert "radiance must be finite numbers of shape (64, 96)" in capsys.readouterr().err
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


def test_the_demo_says_of_how_many_frames_each_picture_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from spikecam_env.cli.screen import screen

    written: list[str] = []
    monkeypatch.setattr(screen.ImageDraw.ImageDraw, "text", lambda self, at, text, *_, **__: written.append(text))
    assert spikecam("demo", "--quick", "--size", *SHAPE, "--no-open", "--out", tmp_path) == 0
    assert Image.open(tmp_path / "demo.png").size[0] > 0
    said = " | ".join(written)
    print(said)
    assert "noisy spikes | mean of 41 frames, PSNR" in said and "denoised rate | one frame, PSNR" in said
    assert "true light | frame 187, 4.69 ms" in said
