"""`spikecam blind-trial` where there is no checkout."""

from __future__ import annotations

from pathlib import Path

from spikecam_env.cli.main import run


def test_an_installed_package_says_what_a_trial_needs_in_one_line(tmp_path: Path, capsys) -> None:
    out = tmp_path / "trial"
    assert run(["blind-trial", "--out", str(out), "--world", str(tmp_path / "tests" / "hidden_world")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "clone the repository" in said and "--world" in said
    assert not out.exists()
