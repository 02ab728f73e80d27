"""`spikecam diagnose` as a user meets it, on a diagnosis that is made up."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path

import made_up
import pytest

from spikecam_env.cli.diagnose import summary
from spikecam_env.cli.main import run


@pytest.fixture
def campaign(tmp_path: Path, monkeypatch) -> Path:
    folder = tmp_path / "camera-17"
    folder.mkdir()
    (folder / "campaign.json").write_text("{}")
    asked = {}

    def diagnose(campaign, model, **options):
        asked.update(campaign=campaign, model=model, **options)
        return made_up.named()

    monkeypatch.setattr(import_module("spikecam_env.gap.diagnose"), "diagnose", diagnose)
    monkeypatch.setattr(made_up, "ASKED", asked, raising=False)
    return folder


def test_it_writes_three_files_and_prints_verdict_parameters_and_gap(campaign: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "out"
    command = ["diagnose", str(campaign), "--model", "scsim", "--out", str(out), "--seed", "7", "--jobs", "2"]
    assert run([*command, "--candidates", "photodiode_lag", "dead_time", "--exclude", "crosstalk"]) == 0
    assert {p.name for p in out.iterdir()} == {"diagnosis.json", "model.toml", "report.html"}
    assert json.loads((out / "diagnosis.json").read_text())["verdict"] == "named"
    printed = capsys.readouterr().out
    for said in (made_up.named().sentence, "6.12 ± 0.12 %", "97 % of the gap is removed", str(out / "report.html")):
        assert said in printed
    wanted = {
        "campaign": campaign, "model": "scsim", "candidates": ("photodiode_lag", "dead_time"),
        "exclude": ("crosstalk",), "seed": 7, "jobs": 2, "effort": 200.0, "static_only": False,
        "search": "forward", "progress": True,
    }  # fmt: skip
    assert wanted == made_up.ASKED


@pytest.mark.parametrize("verdict", sorted(made_up.EVERY))
def test_a_terminal_is_told_the_verdict_and_what_was_found(verdict: str) -> None:
    d = made_up.EVERY[verdict]()
    printed = summary(d)
    assert printed.startswith(f"{verdict}: {d.sentence}")
    for said in (*(e.name for e in d.effects), *d.parameters, *d.data):
        assert said in printed
    if verdict == "named":
        assert "6.12 ± 0.12 %" in printed and "5.93 … 6.32 %" in printed
    if verdict == "none":
        assert (
            "modulation (frequency 2000 Hz)" in printed
            and "0.07 %" in printed
            and "no bound from these recordings: blooming" in printed
        )


@pytest.mark.parametrize(
    "options, message",
    [
        (["--model", "scs"], "'scs'"),
        (["--candidates", "dead_tim"], "'dead_tim'"),
        (["--exclude", "lag"], "'lag'"),
        (["--jobs", "0"], "--jobs 0"),
        (["--effort", "0"], "--effort 0"),
    ],
)
def test_what_is_wrong_ends_in_one_line(options, message: str, campaign: Path, tmp_path: Path, capsys) -> None:
    assert run(["diagnose", str(campaign), "--out", str(tmp_path / "out"), *options]) == 2
    error = capsys.readouterr().err
    assert error.startswith("spikecam: ") and error.count("\n") == 1
    assert message in error
    assert not (tmp_path / "out").exists()


def test_a_folder_without_a_campaign_is_named(tmp_path: Path, capsys) -> None:
    assert run(["diagnose", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    assert f"{tmp_path} is no campaign" in capsys.readouterr().err
