"""Numbers at the ends of a float: refused in a line, or warned of."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from scenes import VideoScene
from spikecam_env.calibration import write_flats
from spikecam_env.cli.main import run
from spikecam_env.datasets.spikezoo import write_clip
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel

SIZE = (16, 16)


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """Five even pictures, four milliseconds."""
    np.save(tmp_path / "film.npy", np.full((5, *SIZE), 100, np.uint8))
    return tmp_path / "film.npy"


def made(film: Path, capsys, *options: str) -> tuple[int, list[str]]:
    """Exit code of `spikecam film`, and lines on standard error that are no progress bar's."""
    line = ["film", str(film), "--out", str(film.with_name("out.h5")), "--size", "16", "16", "--transfer", "linear"]
    capsys.readouterr()
    code = run([*line, *([] if "--film-rate" in options else ["--film-rate", "1000"]), *options])
    said = capsys.readouterr().err.replace("\r", "\n").splitlines()
    return code, [line for line in said if line.strip() and "%|" not in line]


def test_light_too_faint_for_the_mean_interval_is_said(film: Path, capsys) -> None:
    """Of scsim, whose dark current fires every few hundred frames; of a camera without, none comes and none is due."""
    code, said = made(film, capsys, "--mean-interval", "1e6")
    assert code == 0 and len(said) == 1
    assert said[0].startswith("spikecam: warning: --mean-interval 1e+06 became ") and "dark current" in said[0]
    assert made(film, capsys, "--mean-interval", "1e6", "--model", "ideal") == (0, [])


def test_light_too_bright_for_the_mean_interval_is_said(tmp_path: Path, capsys) -> None:
    """A tenth of the picture has all of the light: at most a tenth of the pixels fire, once a frame."""
    pictures = np.zeros((5, 20, 20), np.uint8)
    pictures[:, :2] = 200
    np.save(tmp_path / "film.npy", pictures)
    code, said = made(tmp_path / "film.npy", capsys, "--mean-interval", "2", "--model", "ideal")
    assert code == 0 and len(said) == 1
    assert "--mean-interval 2 became " in said[0] and "once a frame at most" in said[0]


@pytest.mark.parametrize("interval", ["1", "10", "100"])
def test_a_mean_interval_that_comes_is_not_warned_of(interval: str, film: Path, capsys) -> None:
    assert made(film, capsys, "--mean-interval", interval, "--model", "ideal") == (0, [])


@pytest.mark.parametrize("interval", [1e300, 1e-300, np.inf, np.nan, -0.0, True, "10", None])
def test_a_film_in_python_has_the_same_range(interval, film: Path) -> None:
    def make() -> VideoScene:
        return VideoScene(film, 1000.0, SIZE, transfer="linear", mean_interval=interval)

    if interval is None:
        assert make().gain == 1.0
        return
    with pytest.raises(InputError, match=r"mean_interval = .*from 1 to 1e\+06 frames"):
        make()


@pytest.mark.parametrize(
    "option, value, said",
    [
        ("--frame-rate-hz", "1e300", r"from 1 to 1e\+06 Hz"),
        ("--frame-rate-hz", "5e-324", r"from 1 to 1e\+06 Hz"),
        ("--radiance-per-unit", "1e300", r"from 1e-12 to 1e\+12"),
        ("--radiance-per-unit", "1e-300", r"from 1e-12 to 1e\+12"),
        ("--label", "b.npz=1e-300", "radiance = 1e-300"),
        ("--holdout-share", "1e-300", "holds out no frame of 'a.npz', which has 40"),
        ("--holdout-share", "5e-324", "holds out no frame of 'a.npz', which has 40"),
    ],
)
def test_an_import_of_no_such_camera_or_light_is_refused(option: str, value: str, said: str, tmp_path, capsys) -> None:
    """A radiance below the smallest float32 made a lit flat a dark one; a share without a frame held out none."""
    for name in ("a.npz", "b.npz"):
        np.savez(tmp_path / name, spikes=np.random.default_rng(0).integers(0, 2, (40, 8, 8), np.uint8))
    line = ["campaign", "import", str(tmp_path), str(tmp_path / "out"), "--time-axis", "0", "--label", "a.npz=0.5"]
    rate = [] if option == "--frame-rate-hz" else ["--frame-rate-hz", "40000"]
    assert run([*line, *rate, option, value]) == 2
    lines = [line for line in capsys.readouterr().err.replace("\r", "\n").splitlines() if "spikecam" in line]
    assert len(lines) == 1 and re.search(said, lines[0]), lines
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("noise", ["1e300", "1.7976931348623157e308", "300"])
def test_a_reset_noise_that_no_camera_has_is_refused(noise: str, tmp_path: Path, capsys) -> None:
    write_flats(tmp_path / "flats", SensorModel.preset("scsim"), levels=(0.0, 0.2), frames=200, shape=(8, 8))
    line = ["calibrate", str(tmp_path / "flats"), "--out", str(tmp_path / "out"), "--reset-noise-mv", noise]
    assert run(line) == 2
    assert "reset_noise_mV" in capsys.readouterr().err and not (tmp_path / "out").exists()


@pytest.mark.parametrize("rate", [1e300, 1e-300, 5e-324, -0.0])
def test_a_white_that_no_picture_has_is_refused(rate: float, tmp_path: Path) -> None:
    """All pictures were black, or white."""
    with pytest.raises(InputError, match=r"rate = .*from 0\.001 to 10 spikes/frame"):
        write_clip(tmp_path, "a", np.zeros((3, 8, 8), np.uint8), np.full((8, 8), 0.3), rate)
