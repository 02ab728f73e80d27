"""Campaigns that say little: a result without numpy's warnings, or one line that names the unidentified quantity."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from campaigns import flats

from spikecam_env.calibration import calibrate, findings
from spikecam_env.cli.main import run
from spikecam_env.sensor import CATALOGUE, SensorModel

PHYSICAL = SensorModel.preset("physical")
IDEAL = SensorModel.preset("ideal")

CALIBRATED: dict[str, dict[str, Any]] = {
    "two levels": {"levels": (0.0, 0.2)},
    "two lit levels": {"levels": (0.2, 0.6)},
    "two levels, two V_d": {"levels": (0.0, 0.2), "second_v_d": 0.7},
    "one pixel": {"levels": (0.0, 0.2), "shape": (1, 1)},
    "pixels that are all alike": {"levels": (0.0, 0.2), "model": IDEAL},
    "dead pixels": {"levels": (0.0, 0.2), "model": PHYSICAL.with_effect(CATALOGUE["dead_pixels"](fraction=0.3))},
    "hot pixels": {"levels": (0.0, 0.2), "model": PHYSICAL.with_effect(CATALOGUE["hot_pixels"](fraction=0.3))},
    "one level of four saturated": {"levels": (0.0, 0.2, 0.5, 5.0)},
    "ten frames": {"levels": (0.0, 0.2, 0.5), "frames": 10},
}
REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "one level": ({"levels": (0.2,)}, "one level only"),
    "two equal levels": ({"levels": (0.2, 0.2)}, "one level only"),
    "dark alone": ({"levels": (0.0, 0.0)}, "are dark: the response to light cannot be identified"),
    "one frame": ({"levels": (0.0, 0.2), "frames": 1}, "no pixel responds to light"),
    "dark and saturated": ({"levels": (0.0, 5.0)}, "no pixel has two levels at v_d = 1.1 V below saturation"),
    "all saturated": ({"levels": (3.0, 5.0)}, "no pixel has two levels at v_d = 1.1 V below saturation"),
    "a second V_d that saturates": (
        {"levels": (0.0, 0.8, 0.9), "second_v_d": 0.3},
        "no pixel has two levels at v_d = 0.3 V below saturation",
    ),
    "dead pixels alone": (
        {"levels": (0.0, 0.2), "model": PHYSICAL.with_effect(CATALOGUE["dead_pixels"](fraction=1.0))},
        "no pixel responds to light",
    ),
    "most pixels dead": (
        {"levels": (0.0, 0.2), "model": PHYSICAL.with_effect(CATALOGUE["dead_pixels"](fraction=0.9))},
        "all but [0-9]+ pixels respond to light in no recording",
    ),
}


def campaign(folder: Path, *, model: SensorModel = PHYSICAL, **options: Any) -> str:
    flats(folder, model, **{"frames": 1500, "shape": (8, 8), **options})
    return str(folder)


def calibrated(folder: Path, out: Path, capfd) -> tuple[int, list[str]]:
    """Exit code of the command, and lines on standard error that are no progress bar's; numpy's warnings are raised,
    since pytest keeps them from standard error."""
    capfd.readouterr()
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        code = run(["calibrate", str(folder), "--out", str(out)])
    return code, [line for line in capfd.readouterr().err.splitlines() if line.strip() and "%|" not in line]


@pytest.mark.slow
@pytest.mark.parametrize("name", CALIBRATED)
def test_a_campaign_that_says_little_is_calibrated_without_warnings(name: str, tmp_path: Path, capfd) -> None:
    folder = campaign(tmp_path / "flats", **CALIBRATED[name])
    code, said = calibrated(Path(folder), tmp_path / "out", capfd)
    assert (code, said) == (0, [])
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        found = {f.quantity: f for f in findings(calibrate(folder))}
    values = [f.value for f in found.values() if f.value is not None]
    assert np.isfinite(values).all(), found
    # The mean of 64 pixels, each known to a spike more or less in its recording.
    assert found["alpha/phi, mean"].value == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_identified_is_said_in_a_line(name: str, tmp_path: Path, capfd) -> None:
    options, said = REFUSED[name]
    code, lines = calibrated(Path(campaign(tmp_path / "flats", **options)), tmp_path / "out", capfd)
    print(lines)
    assert code == 2 and len(lines) == 1
    assert re.search(said, lines[0])
    assert not (tmp_path / "out").exists()


def test_two_v_d_that_are_one_but_for_rounding_are_one(tmp_path: Path) -> None:
    """V_D - V_ref of the model is 3.3 - 2.2, which is not 1.1 as a number."""
    calibration = calibrate(campaign(tmp_path / "flats", levels=(0.0, 0.2, 0.4), second_v_d=1.1))
    assert len(calibration.settings) == 1 and len(calibration.main.levels) == 6


@pytest.mark.slow
def test_two_v_d_too_near_each_other_are_said_and_taken_as_one(tmp_path: Path, capfd) -> None:
    folder = campaign(tmp_path / "flats", levels=(0.0, 0.2, 0.4), second_v_d=1.1001)
    calibration = calibrate(folder)
    assert calibration.swing_V is None
    assert any("give no swing from 0.05 to 20 V" in warning for warning in calibration.warnings), calibration.warnings
    assert calibrated(Path(folder), tmp_path / "out", capfd) == (0, [])
