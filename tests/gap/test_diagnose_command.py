"""`spikecam diagnose` as a user meets it, on a diagnosis that is made up."""

from __future__ import annotations

import json
from dataclasses import replace
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
    asked, answer = {}, replace(made_up.named(), evidence=None)  # a page without its pictures

    def diagnose(campaign, model, **options):
        asked.update(campaign=campaign, model=model, **options)
        return answer

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
        "bounds": "linear", "settings": None, "progress": True,
    }  # fmt: skip
    assert wanted == made_up.ASKED


def test_settings_come_from_a_file(campaign: Path, tmp_path: Path) -> None:
    file = tmp_path / "settings.toml"
    file.write_text("deviance.tie = 8\n\n[twins]\nto_confirm = 3\n")
    assert run(["diagnose", str(campaign), "--out", str(tmp_path / "out"), "--settings", str(file)]) == 0
    assert made_up.ASKED["settings"].changed() == {
        "deviance.tie": 8, "twins.to_confirm": 3,
    }  # fmt: skip


@pytest.mark.parametrize(
    "text, said",
    [
        ("deviance.ties = 8.0", "unknown setting 'deviance.ties'; choose one of deviance.accept, "
                                "deviance.tie (deviance.tie?)"),
        ("tie = 8.0", "unknown setting 'tie'; choose one of deviance.tie"),
        ("judging.tie = 8.0", "unknown setting 'judging.tie'; choose one of deviance.tie (deviance.tie?)"),
        ("devaince.accepts = 8.0", "unknown setting 'devaince.accepts'"),
        ("deviance = 8.0", "unknown setting 'deviance'"),
        ("deviance.tie = 'x'", "deviance.tie = 'x'; it must be a finite number above 0"),
        ("deviance.tie = true", "deviance.tie = True; it must be"),
        ("deviance.tie = nan", "deviance.tie = nan; it must be"),
        ("deviance.tie = -6.0", "deviance.tie = -6.0; it must be"),
        ("deviance.tie = {}", "deviance.tie = {}; it must be"),
        ("judging.alarm = 1.5", "judging.alarm = 1.5; it must be a number above 0 and up to 1"),
        ("twins.to_confirm = 2.0", "twins.to_confirm = 2.0; it must be a whole number, 1 or more"),
        ("twins.drawn_units = 1", "twins.drawn_units = 1; it must be a whole number, 2 or more"),
        ("unit.usual = 0.9", "unit.usual = 0.9; it must be a finite number of at least 1"),
        ("unit.usual = [1.8]", "unit.usual = [1.8]; it must be"),
        ("deviance.stop = 1.0", "deviance.stop is a constant of the diagnosis now, not a setting; leave it out"),
        ("[fitting]\nmost_steps = 4", "fitting.most_steps is a constant"),
        ("deviance", "is not a TOML file"),
    ],
)  # fmt: skip
def test_settings_that_are_none_are_refused_in_one_line(
    text: str, said: str, campaign: Path, tmp_path: Path, capsys
) -> None:
    file = tmp_path / "settings.toml"
    file.write_text(text)
    assert run(["diagnose", str(campaign), "--out", str(tmp_path / "out"), "--settings", str(file)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"spikecam: {file}") and error.count("\n") == 1 and len(error) < 1000
    assert said in error and not (tmp_path / "out").exists()


@pytest.mark.parametrize("verdict", sorted(made_up.EVERY))
def test_a_terminal_shows_the_verdict_and_the_effects(verdict: str) -> None:
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
def test_a_wrong_option_ends_in_one_line(options, message: str, campaign: Path, tmp_path: Path, capsys) -> None:
    assert run(["diagnose", str(campaign), "--out", str(tmp_path / "out"), *options]) == 2
    error = capsys.readouterr().err
    assert error.startswith("spikecam: ") and error.count("\n") == 1
    assert message in error
    assert not (tmp_path / "out").exists()


def test_a_folder_without_a_campaign_is_named(tmp_path: Path, capsys) -> None:
    assert run(["diagnose", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    assert f"{tmp_path} is no campaign" in capsys.readouterr().err
