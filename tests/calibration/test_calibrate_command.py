"""`spikecam calibrate` as a user meets it."""

from __future__ import annotations

from pathlib import Path

from campaigns import flats

from spikecam_env.cli.main import run
from spikecam_env.sensor import SensorModel


def test_calibrate_writes_a_model_maps_and_a_report(tmp_path: Path, capsys) -> None:
    flats(tmp_path / "flats", SensorModel.preset("physical"), levels=(0.0, 0.2, 0.6), frames=1500, shape=(8, 8))
    assert run(["calibrate", str(tmp_path / "flats"), "--out", str(tmp_path / "out")]) == 0
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"model.toml", "maps.h5", "report.html"}
    printed = capsys.readouterr().out
    assert "alpha/phi, mean" in printed
    assert "not identified" in printed


def test_what_is_wrong_with_a_campaign_ends_in_one_line(tmp_path: Path, capsys) -> None:
    assert run(["calibrate", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("spikecam: ")
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
