"""The `spikecam` command as a user meets it: results as files, tables, and one line for a fault."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import h5py
import numpy as np
import pytest

from spikecam_env.cli.main import COMMANDS, run
from spikecam_env.streams import load_vidar_dat, read_recording
from tests.commands import film_in, picture_in, said, spikecam

SMALL = ("--size", "64", "96")
SIMULATE = ("campaign", "simulate", "c")
IMPORT = ("campaign", "import", ".", "out")


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_explains_itself_with_an_example(name: str, capsys) -> None:
    with pytest.raises(SystemExit) as end:
        spikecam(name, "--help")
    assert end.value.code == 0
    assert f"example:  spikecam {name}" in capsys.readouterr().out


def test_the_version_is_that_of_the_package(capsys) -> None:
    assert run(["--version"]) == 0 and capsys.readouterr().out == f"spikecam-env {version('spikecam-env')}\n"


def test_help_needs_no_torch() -> None:
    code = "import sys; from spikecam_env.cli.main import run\ntry: run(['--help'])\nexcept SystemExit: pass\n"
    code += "assert 'torch' not in sys.modules and 'numba' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


@pytest.mark.parametrize("suffix", ["h5", "dat", "npz"])
def test_a_recording_reads_back_and_denoises(suffix: str, tmp_path: Path, capsys) -> None:
    file = tmp_path / f"disk.{suffix}"
    assert spikecam("record", "--frames", 130, "--out", file, *SMALL) == 0
    shape = {"height": 64, "width": 96} if suffix == "dat" else {}
    options = [f"--{name}={value}" for name, value in shape.items()]
    spikes = read_recording(file, **shape).spikes
    assert spikes.shape == (130, 64, 96)
    assert 0.05 < spikes.mean() < 0.6
    assert spikecam("denoise", file, "--out", tmp_path / "out", *options) == 0
    assert "denoised rate" in capsys.readouterr().out
    names = {p.name for p in (tmp_path / "out").iterdir()}
    assert names == {"denoised.h5", "pictures.png", "film.mp4", "summary.json"}
    assert read_recording(tmp_path / "out" / "denoised.h5").spikes.shape == spikes.shape
    assert len(json.loads((tmp_path / "out" / "summary.json").read_text())["rows"]) == 4


def test_the_same_seed_records_the_same_bits(tmp_path: Path) -> None:
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        spikecam("record", "--frames", 70, "--seed", seed, "--out", tmp_path / f"{name}.dat", *SMALL)
    a, b, c = ((tmp_path / f"{name}.dat").read_bytes() for name in "abc")
    assert a == b != c
    assert load_vidar_dat(tmp_path / "a.dat", height=64, width=96).shape == (70, 64, 96)


def test_the_demo_makes_a_film_a_picture_and_its_figures(tmp_path: Path, capsys) -> None:
    assert spikecam("demo", "--frames", 500, "--out", tmp_path, "--size", 32, 48) == 0
    printed = capsys.readouterr().out
    assert "clean twin" in printed and "x real time" in printed
    figures = json.loads((tmp_path / "demo.json").read_text())
    assert [row["stream"] for row in figures["table"]] == ["noisy", "paper", "best", "picture", "clean twin"]
    assert len(film_in(tmp_path / "demo.mp4")) == 500 // 25 - 6
    assert picture_in(tmp_path / "demo.png").shape[2] == 3
    assert f"wrote {tmp_path / 'demo.mp4'}" in printed


def test_a_quick_demo_makes_a_picture_alone(tmp_path: Path, capsys) -> None:
    assert spikecam("demo", "--quick", "--out", tmp_path, *SMALL) == 0
    assert f"wrote {tmp_path / 'demo.png'}" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["demo.png"]
    noisy, denoised, truth = np.array_split(picture_in(tmp_path / "demo.png")[20:160, :, 0].astype(float), 3, 1)
    errors = [float(np.mean(np.abs(picture[:, 20:280] - truth[:, 20:280]))) for picture in (noisy, denoised)]
    print(f"mean difference from the true light: noisy {errors[0]:.1f}, denoised {errors[1]:.1f} of 255")
    assert errors[1] < 0.8 * errors[0]


@pytest.mark.parametrize(
    "args, message",
    [
        (("record", "--out", "x.avi"), "unknown file type '.avi'; use .h5, .dat or .npz"),
        (("record", "--out", "nowhere/x.h5"), "there is no folder nowhere"),
        (
            ("record", "--out", "x.h5", "--model", "scs"),
            "unknown preset 'scs'; choose one of ideal, measured, physical, scsim",
        ),
        (("record", "--out", "x.h5", "--model", "no.toml"), "cannot read model file no.toml"),
        (("record", "--out", "x.h5", "--frames", "0"), "--frames 0"),
        (("record", "--out", "x.h5", "--size", "0", "400"), "--size 0 400"),
        (("record", "--out", "x.h5", "--size", "2", "400"), "shape is (2, 400); the disk's radius"),
        (("demo", "--frames", "10"), "10 frames are too few to show; ask for 500 or more"),
        (("demo", "--quick", "--frames", "10"), "10 frames are too few to show; ask for 175 or more"),
        (("demo", "--model", "scs"), "unknown preset 'scs'"),
        (("demo", "--rpm", "nan"), "rpm"),
        (("denoise", "absent.dat"), "absent.dat"),
        (("denoise", "odd.dat"), "12345"),
        (("denoise", "broken.h5"), "broken.h5"),
        (("denoise", "text.npz"), "text.npz"),
        (("denoise", "good.dat", "--window", "4"), "--window 4"),
        (("denoise", "good.dat", "--out", "good.dat"), "good.dat"),
        (("train", "--out", "runs", "--steps", "0"), "steps 0"),
        (
            ("train", "--out", "runs", "--width", "24"),
            "--width is for spk2img-clean, spk2img-noisy, ssml; leave it out",
        ),
        (("train", "--out", "runs", "--mode", "ssml", "--no-refine"), "--refine is for paper; leave it out for ssml"),
        (("train", "--out", "runs", "--mode", "ssml", "--width", "30"), "width = 30; it must be a multiple of 12"),
        (("evaluate", "quick", "--best", "text.npz"), "text.npz"),
        (("evaluate", "truth", "--static", "text.npz"), "text.npz"),
        (("evaluate", "spikezoo", "."), "no folder spike"),
        (("export", "broken.h5", "--out", "zoo"), "broken.h5"),
        (
            (
                "scenes",
                "nope",
            ),
            "unknown scene 'nope'",
        ),
        (("scenes", "--film", "a.mp4"), "which scene?"),
        (("scenes", "disk", "--film", "a.avi"), "unknown file type '.avi'"),
        (("scenes", "disk", "--film", "a.mp4", "--every", "0"), "--every 0"),
        (("scenes", "disk", "--film", "no/such/a.mp4"), "no folder"),
        (("scenes", "--out", "a.jpg"), "use .png"),
        (("scenes", "disk", "--size", "2", "9", "--out", "a.png"), "at least 8 rows"),
        (
            (
                "play",
                "Track-v9",
            ),
            "unknown id 'Track-v9'",
        ),
        (("play", "Track-v1", "--policy", "keyboard"), "needs a window"),
        (("play", "Track-v1", "--policy", "oracl"), "unknown policy 'oracl'"),
        (("play", "Track-v1", "--policy", "ReadDigit-v1"), "unknown policy 'ReadDigit-v1'"),
        (("play", "Track-v1", "--policy", "mine.pt"), "mine.pt"),
        (
            ("play", "ReadSpin-v1", "--policy", "Catch-v1"),
            "takes 7 numbers an action, this agent gives 1: another task's",
        ),
        (("play", "Track-v1", "--film", "a.avi"), "use .mp4"),
        (("play", "Track-v1", "--slow", "9000"), "at most 90000"),
        (("view", "disk", "--save", "a.mp4"), "use .rrd"),
        (
            ("view", "disk", "--size", 12, 20, "--save", "a.rrd", "--pixels", "12,0"),
            "rows are 0 to 11, columns 0 to 19",
        ),
        (("view", "disk", "--size", 12, 20, "--save", "a.rrd", "--pixels", "1"), "give row,column"),
        (("view", "disc", "--save", "a.rrd"), "unknown scene, file or environment 'disc'"),
        (("view", "Track-v1", "--save", "a.rrd", "--policy", "oracl"), "'oracl'"),
        (("view", "none.dat", "--save", "a.rrd"), "none.dat"),
        (
            (
                "view",
                "disk",
            ),
            "write a file with --save FILE.rrd",
        ),
        (
            (*SIMULATE, "--effect", "dead_tme"),
            "unknown effect 'dead_tme'; choose one of afterpulsing",
        ),
        ((*SIMULATE, "--effect", "dead_tme"), "vignetting (dead_time?)"),
        (
            (*SIMULATE, "--effect", "dead_time:tau=1"),
            "unknown parameter of dead_time 'tau'; choose one of tau_us",
        ),
        ((*SIMULATE, "--effect", "dead_time:tau_us"), "tau_us has no value"),
        (
            (*SIMULATE, "--effect", "dead_time:tau_us=far"),
            "dead_time.tau_us = 'far'; it must be a number",
        ),
        ((*SIMULATE, "--effect", "dead_time:tau_us=90"), "a number from 0 to 25 us"),
        ((*SIMULATE, "--effect", "afterpulsing:delay_frames=2.5"), "must be a whole number"),
        ((*SIMULATE, "--effect", "shot_noise:dark_is_noisy=maybe"), "must be true or false"),
        ((*SIMULATE, "--without", "dead_time"), "unknown effect of scsim 'dead_time'"),
        (
            (*SIMULATE, "--recording", "film"),
            "unknown recording 'film'; choose one of bars, dark, disk, flat, masked_rows, step",
        ),
        ((*SIMULATE, "--recording", "flat"), "needs radiance; write flat:radiance=..."),
        ((*SIMULATE, "--recording", "flat:radiance=-1"), "negative"),
        ((*SIMULATE, "--recording", "bars:speed=9"), "at most 1.2 pixels a frame"),
        ((*SIMULATE, "--frames", "0"), "--frames 0; it must be"),
        ((*SIMULATE, "--second-v-d", "0.001"), "is outside 0.05 .. 20 V"),
        (IMPORT, "no labels"),
        ((*IMPORT, "--label", "a.npz"), "not of the form FILE=RADIANCE"),
        ((*IMPORT, "--label", "a.npz="), "the radiance is missing"),
        ((*IMPORT, "--label", "a.npz=bright"), "radiance is 'bright'"),
        ((*IMPORT, "--label", "b.npz=0.2"), "there is no file"),
        ((*IMPORT, "--table", "none.csv"), "there is no file none.csv"),
        (("record", "--out", "x.dat", "--truth-every", "10"), "kept in .h5 files only"),
    ],
)
def test_what_is_wrong_ends_in_one_line_and_code_2(args, message: str, tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("spikecam_env.cli.screen.window.has_display", lambda: False)
    Path("odd.dat").write_bytes(bytes(12345))
    Path("good.dat").write_bytes(bytes(12500 * 50))
    Path("text.npz").write_text("not an array")
    with h5py.File("whole.h5", "w") as file:
        file["data"] = np.arange(10_000)
    Path("broken.h5").write_bytes(Path("whole.h5").read_bytes()[:3000])
    before = {p.name for p in tmp_path.iterdir()}
    assert spikecam(*args) == 2
    errors = said(capsys.readouterr().err)
    assert len(errors) == 1 and errors[0].startswith("spikecam: ") and message in errors[0], errors
    left = {p.name for p in tmp_path.iterdir()} - before
    assert not any((tmp_path / name).is_file() or list((tmp_path / name).iterdir()) for name in left), left


def test_a_word_that_is_no_choice_ends_with_code_2() -> None:
    for args in (["bench", "everything"], ["demo", "--mode", "bst"], ["demo", "more"]):
        with pytest.raises(SystemExit) as end:
            spikecam(*args)
        assert end.value.code == 2
