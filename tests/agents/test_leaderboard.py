"""The leaderboard: its page has every entry, entries can be checked, and the suite can be made."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from spikecam_env.agents.leaderboard import entry_of, leaderboard, read_entries
from spikecam_env.agents.study import Result, StudyRun, cases
from spikecam_env.agents.suite import SUITES
from spikecam_env.cli.main import run as command
from spikecam_env.errors import InputError
from tools.leaderboard import PAGE, with_table


def result(level: int, seed: int, score: float) -> Result:
    case = StudyRun(task="Return-v1", sight="tfp", level=level, trained_levels=(1, 5), seed=seed, steps=1000)
    return Result(case=case, score=score, success=score, camera_bits_s=1e6 * level)


def test_the_page_has_the_table_of_its_entries() -> None:
    page = PAGE.read_text("utf-8")
    assert page == with_table(page), "run python -m tools.leaderboard"


def test_a_score_is_the_mean_over_levels_then_over_seeds() -> None:
    runs = [result(1, 0, 1.0), result(2, 0, 0.5), result(1, 1, 0.5), result(2, 1, 0.0)]
    (row,) = leaderboard([entry_of(runs, "mine", "spikecam evaluate agents --out study")])
    assert row["score"].startswith("0.500 +- ") and row["success by level"] == "1: 0.75, 2: 0.25"
    assert (row["frames [million]"], row["seeds"], row["camera [Mbit/s]"]) == (0.04, 2, 1.5)


def test_a_file_that_is_no_entry_is_refused(tmp_path: Path) -> None:
    (tmp_path / "entry.json").write_text(json.dumps({"name": "mine", "rows": []}))
    with pytest.raises(InputError, match=r"entry\.json"):
        read_entries(tmp_path)


def test_a_study_writes_its_entry_with_the_command_that_gives_it(tmp_path: Path, capsys) -> None:
    line = ["evaluate", "agents", "--tasks", "Catch-v1", "--observations", "oracle", "--size", "16", "16"]
    line += ["--seeds", "1", "--episodes", "2", "--points", "0"]
    assert command([*line, "--entry", "mine", "--out", str(tmp_path)]) == 0
    (entry,) = read_entries(tmp_path)
    assert entry.rows[0].scores == (1.0,) and entry.rows[0].frames == 0
    first = (tmp_path / "mine.json").read_text()
    assert command(entry.command.split()[1:]) == 0 and (tmp_path / "mine.json").read_text() == first


def test_the_suite_has_a_training_for_every_camera_learner_and_seed() -> None:
    suite = SUITES["v1"]
    wanted = cases(
        suite.tasks,
        [sight for sight in suite.observations if sight != "classical"],
        [],
        range(suite.seeds),
        suite.steps,
        levels=suite.levels,
        trained_levels=suite.trained_levels,
        learners=suite.learners,
    )
    folders = {case.folder for case in wanted if case.steps}
    assert len(folders) == len(suite.tasks) * 4 * len(suite.learners) * suite.seeds


def test_an_unknown_suite_ends_in_a_line(tmp_path: Path, capsys) -> None:
    assert command(["evaluate", "agents", "--suite", "v9", "--out", str(tmp_path)]) == 2
    assert "v1" in capsys.readouterr().err
