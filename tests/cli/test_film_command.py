"""`spikecam film`: films of users as spikes; the table states how, an error names the fault."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from made_films import greys, write_film
from PIL import Image

from scenes import VideoScene
from spikecam_env.sensor import SpikeSensor
from spikecam_env.streams import middleTFP, read_recording
from tests.commands import spikecam

SMALL = ("--size", "16", "24")


def printed(capsys: pytest.CaptureFixture[str]) -> dict[str, str]:
    """The table's lines by their names, after the line of size and time."""
    lines = capsys.readouterr().out.splitlines()[3:]
    return {line.rsplit("  ", 1)[0].strip(): line.rsplit("  ", 1)[1].strip() for line in lines}


def folder_of(folder: Path, codes: list[int]) -> Path:
    """Pictures dark at the left, `codes` at the right."""
    folder.mkdir()
    for i, code in enumerate(codes):
        values = np.full((32, 48), 40, np.uint8)
        values[:, 24:] = code
        Image.fromarray(values).save(folder / f"p{i}.png")
    return folder


@pytest.mark.parametrize("suffix", ["h5", "dat", "npz"])
def test_a_video_becomes_spikes_of_the_asked_interval(suffix: str, tmp_path: Path, capsys) -> None:
    film = write_film(tmp_path / "f.mkv", greys([60, 120, 180, 120]), rate=100, color_trc=13)
    out = tmp_path / f"f.{suffix}"
    assert spikecam("film", film, "--out", out, "--mean-interval", 8, "--model", "ideal", *SMALL) == 0
    shape = {"height": 16, "width": 24} if suffix == "dat" else {}
    spikes = read_recording(out, **shape).spikes
    assert spikes.shape == (1200, 16, 24)
    assert spikes.mean() == pytest.approx(1 / 8, rel=0.01)
    said = printed(capsys)
    assert said["pictures"] == "4" and said["transfer"] == "srgb" and said["frames"] == "1200"
    assert said["times"] == "100 pictures a second" and said["between pictures"] == "motion"
    assert float(said["mean interval got [frames]"]) == pytest.approx(8, rel=0.01)


def test_all_kinds_of_file_hold_the_same_spikes(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "p", [60, 200, 60])
    for name in ("a.h5", "a.dat", "a.npz"):
        options = ("--out", tmp_path / name, "--seed", 3, "--frame-rate", 20_000, *SMALL)
        assert spikecam("film", folder, "--film-rate", 800, *options) == 0
    same, dat = read_recording(tmp_path / "a.h5").spikes, read_recording(tmp_path / "a.dat")
    assert np.array_equal(same, read_recording(tmp_path / "a.npz").spikes)
    assert np.array_equal(same, dat.spikes) and dat.frame_rate_hz == 20_000
    attributes = read_recording(tmp_path / "a.h5").attributes
    assert attributes["film"] == "p" and attributes["transfer"] == "srgb" and attributes["gain"] > 0


def test_a_list_sets_the_time_of_every_picture(tmp_path: Path, capsys) -> None:
    """Bright for a tenth of the time: light is held, and the mean interval is by time."""
    folder = folder_of(tmp_path / "p", [40, 250, 40])
    (folder / "list.csv").write_text("name,time_s\np0.png,0\np1.png,0.009\np2.png,0.010\n")
    options = ("--interpolation", "hold", "--model", "ideal", "--mean-interval", "20", *SMALL)
    assert spikecam("film", folder / "list.csv", "--out", tmp_path / "a.h5", *options) == 0
    assert printed(capsys)["times"] == "1 to 9 ms apart"
    spikes = read_recording(tmp_path / "a.h5").spikes
    assert len(spikes) == 440
    right = spikes[:, :, 14:].mean(axis=(1, 2))
    assert right[362:398].mean() > 5 * right[:358].mean()


def test_the_film_is_seen_where_it_is_bright(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "p", [200, 200])
    assert spikecam("film", folder, "--film-rate", 200, "--out", tmp_path / "a.h5", "--model", "ideal", *SMALL) == 0
    picture = middleTFP(read_recording(tmp_path / "a.h5").spikes, 100, 101)
    ratio = picture[:, 14:].mean() / picture[:, :10].mean()
    expected = ((200 / 255 + 0.055) / (40 / 255 + 0.055)) ** 2.4
    assert ratio == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize(
    ("options", "frames"),
    [
        ((), 1200),
        (("--slow", "2"), 600),
        (("--film-rate", "400"), 300),
        (("--frames", "70"), 70),
        (("--seconds", "0.005"), 200),
        (("--frame-rate", "20000"), 600),
        (("--interpolation", "hold"), 1600),
    ],
)
def test_a_recording_lasts_as_long_as_the_film_did_in_life(options: tuple, frames: int, tmp_path: Path, capsys) -> None:
    film = write_film(tmp_path / "f.mkv", greys([60, 120, 180, 120]), rate=100, color_trc=13)
    assert spikecam("film", film, "--out", tmp_path / "f.dat", *options, *SMALL) == 0
    assert printed(capsys)["frames"] == str(frames)
    assert (tmp_path / "f.dat").stat().st_size == frames * 16 * 24 // 8


def test_an_array_of_linear_light_is_a_film(tmp_path: Path, capsys) -> None:
    np.save(tmp_path / "f.npy", np.random.default_rng(0).random((5, 16, 24, 3)) * 3)
    options = ("--film-rate", 1000, "--transfer", "linear", "--channel", "green", *SMALL)
    assert spikecam("film", tmp_path / "f.npy", "--out", tmp_path / "f.h5", *options) == 0
    said = printed(capsys)
    assert said["transfer"] == "linear" and said["light of"] == "green" and said["frames"] == "160"


def test_record_has_a_frame_rate_of_its_own(tmp_path: Path) -> None:
    """At half the rate the disk turns twice as far in a frame."""
    for rate, name in ((40_000, "a"), (20_000, "b")):
        options = ("--frames", 64, "--model", "ideal", "--frame-rate", rate, *SMALL)
        assert spikecam("record", "--out", tmp_path / f"{name}.h5", *options) == 0
    a, b = (read_recording(tmp_path / f"{name}.h5") for name in "ab")
    assert (a.frame_rate_hz, b.frame_rate_hz) == (40_000, 20_000)
    assert not np.array_equal(a.spikes, b.spikes)
    same = ("record", "--out", tmp_path / "c.h5", "--frames", 64, "--model", "ideal", *SMALL)
    assert spikecam(*same) == 0
    assert np.array_equal(read_recording(tmp_path / "c.h5").spikes, a.spikes)


def moving_film(path: Path, pictures: int = 6) -> Path:
    """A step of light that moves two pixels a picture."""
    film = np.full((pictures, 24, 40), 0.1)
    for number in range(pictures):
        film[number, :, 8 + 2 * number : 22 + 2 * number] = 0.5
    np.save(path, film)
    return path


def test_a_clean_twin_lies_beside_spikes_that_are_the_same_with_it_and_without(tmp_path: Path) -> None:
    film = moving_film(tmp_path / "f.npy")
    options = ("--film-rate", 500, "--transfer", "linear", "--seed", 5, "--size", 24, 40)
    assert spikecam("film", film, *options, "--out", tmp_path / "bare.h5") == 0
    assert spikecam("film", film, *options, "--clean", "--out", tmp_path / "both.h5") == 0
    noisy = read_recording(tmp_path / "both.h5").spikes
    assert len(noisy) == 400  # 5 steps of 80 frames
    np.testing.assert_array_equal(noisy, read_recording(tmp_path / "bare.h5").spikes)
    shown = VideoScene(np.load(film), 500.0, (24, 40), transfer="linear", mean_interval=10.0)
    twin = SpikeSensor("scsim", (24, 40), 5).clean_twin()
    clean = read_recording(tmp_path / "both.h5", stream="clean").spikes
    np.testing.assert_array_equal(clean, twin.step(shown.radiance(0, 400), 400))
    assert clean.mean() == pytest.approx(0.1, rel=0.02) and not np.array_equal(clean, noisy)


def test_size_and_time_are_said_before_a_long_recording_and_change_nothing(tmp_path: Path, capsys) -> None:
    film = moving_film(tmp_path / "f.npy")
    options = ("--film-rate", 50, "--transfer", "linear", "--size", 64, 96, "--clean")
    for name, more in (("short", ("--frames", 640)), ("long", ())):
        assert spikecam("film", film, *options, *more, "--out", tmp_path / f"{name}.h5") == 0
    short, long = (line for line in capsys.readouterr().out.splitlines() if line.startswith(str(tmp_path)))
    print(long)
    assert short.endswith("short.h5: 640 frames (0.016 s), 983 kB with the clean twin")
    stated = re.fullmatch(r".*long.h5: 4000 frames \(0.1 s\), ([\d.]+) MB with the clean twin, about \d+ s", long)
    assert stated and 1e6 * float(stated[1]) == pytest.approx((tmp_path / "long.h5").stat().st_size, rel=0.15)
    for stream in ("spikes", "clean"):
        both = [read_recording(tmp_path / f"{name}.h5", stream=stream, count=640).spikes for name in ("short", "long")]
        np.testing.assert_array_equal(*both)


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (("none.mp4",), "there is no film none.mp4"),
        (("text.mp4",), "text.mp4 is not a film"),
        (("p",), "have no times; say film_rate_hz"),
        (("p", "--film-rate", "0"), "--film-rate 0.0; it must be"),
        (
            ("p", "--film-rate", "100", "--transfer", "pq"),
            "unknown transfer 'pq'; choose one of bt709, gamma2.2, linear",
        ),
        (("p", "--film-rate", "100", "--mean-interval", "nan"), "--mean-interval nan; it must be"),
        (("p", "--film-rate", "100", "--frames", "0"), "--frames 0; it must be"),
        (("p", "--film-rate", "100", "--frames", "9999"), "p lasts 800 (0.02 s)"),
        (("p", "--film-rate", "100", "--seconds", "nan"), "--seconds nan"),
        (("p", "--film-rate", "100", "--clean", "--out", "x.dat"), "a clean twin (--clean) is kept in .h5 files only"),
        (("p", "--film-rate", "1e5"), "it must last 1 or more"),
        (("p", "--film-rate", "100", "--frame-rate", "0"), "frame_rate_hz = 0"),
        (("p", "--film-rate", "100", "--size", "0", "24"), "--size 0 24; it must be"),
        (("black.npy", "--film-rate", "100"), "no light"),
        (("p/list.csv",), "line 3: the time is 0 s"),
        (("object.npy", "--film-rate", "100"), "object.npy is not an .npy file"),
    ],
)
def test_what_is_wrong_ends_in_one_line_and_nothing_is_left(args, message, tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("text.mp4").write_text("a text " * 99)
    folder_of(Path("p"), [60, 200, 60])
    np.save("black.npy", np.zeros((2, 8, 8), np.uint8))
    if args[0] == "p/list.csv":
        Path("p/list.csv").write_text("name,time_s\np0.png,0\np1.png,0\n")
    np.save("object.npy", np.array([{}], object), allow_pickle=True)
    before = sorted(tmp_path.rglob("*"))
    assert (
        spikecam("film", *args, *(() if "--out" in args else ("--out", "x.h5")), *(() if "--size" in args else SMALL))
        == 2
    )
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("spikecam: ") and message in error
    assert sorted(tmp_path.rglob("*")) == before
