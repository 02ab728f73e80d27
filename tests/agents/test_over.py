"""Studies of several lights: their cells, their table, their picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spikecam_env.agents.over import LIGHT, draw_over, mean_of_seeds, rows_over
from spikecam_env.agents.study import Result, StudyRun, cases
from spikecam_env.cli.main import run as command


def result(sight: str, interval: float, seed: int, score: float, steps: int = 100) -> Result:
    case = StudyRun(task="Track-v1", sight=sight, interval=interval, trained=(20, 400), seed=seed, steps=steps)
    return Result(case=case, score=score, cpu_s=60.0)


def test_intervals_of_the_mean_hold_it_as_often_as_they_say() -> None:
    """Of 2000 sets of five normal numbers: 95 %, within four standard errors."""
    sets = np.random.default_rng(0).normal(3.0, 2.0, (2000, 5))
    held = np.mean([abs(mean_of_seeds(values).mean - 3.0) <= mean_of_seeds(values).half for values in sets])
    print(f"{100 * held:.1f} % hold the mean")
    assert abs(held - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 2000)


def test_rows_over_light_have_every_sight_and_its_gain_seed_by_seed() -> None:
    scores = {("root_tfp", 0): 0.5, ("root_tfp", 1): 0.7, ("root_rate", 0): 0.6, ("root_rate", 1): 0.8}
    results = [result(sight, 20, seed, score) for (sight, seed), score in scores.items()]
    results += [result("root_tfp", 400, 0, 0.25)]
    bright, dark = rows_over(results, LIGHT)
    assert bright["root_rate"].startswith("0.700 +- ") and bright["root_rate - root_tfp"] == "0.100 +- 0.000"
    assert dark["root_tfp"] == "0.250" and dark["root_rate"] is None and dark["root_rate - root_tfp"] is None
    assert [row["interval [frames]"] for row in (bright, dark)] == ["20", "400"]


def test_several_lengths_of_training_are_trainings_of_their_own() -> None:
    wanted = cases(["Track-v1", "Saccade-v1"], ["tfp", "tracker"], [20, 50], [0], [64, 128], trained=(20, 400))
    learned = [case for case in wanted if case.sight == "tfp"]
    assert len(learned) == 8 and len({case.folder for case in learned}) == 4
    assert len(wanted) - len(learned) == 4, "who learns nothing is played once"
    assert {case.learned.options["task"].mean_interval for case in learned} == {(20, 400)}
    assert {type(case.played.options["task"]).__name__ for case in learned} == {"Track", "Saccade"}


def test_the_picture_has_a_panel_for_every_length(tmp_path: Path) -> None:
    results = [
        result("tfp", light, seed, 0.1 * seed, steps) for light in (20, 50) for seed in (0, 1) for steps in (9, 99)
    ]
    draw_over(results, LIGHT, tmp_path / "light.png")
    assert (tmp_path / "light.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    "wrong, said",
    [
        (["--intervals", "0.5"], "interval"),
        (["--trained", "400", "20"], "shortest"),
        (["--steps", "0"], "steps"),
        (["--points", "-1"], "points"),
        (["--observations", "root_tpf"], "root_tfp"),
    ],
)
def test_wrong_options_end_in_a_line(wrong: list[str], said: str, tmp_path: Path, capsys) -> None:
    assert command(["evaluate", "agents", "--tasks", "Track-v1", "--out", str(tmp_path / "out"), *wrong]) == 2
    printed = capsys.readouterr().err
    assert said in printed and "Traceback" not in printed
    assert not (tmp_path / "out").exists()


def test_a_study_over_light_writes_its_table_and_picture_and_goes_on(tmp_path: Path, capsys) -> None:
    line = [
        "evaluate",
        "agents",
        "--tasks",
        "Track-v1",
        "--observations",
        "root_tfp",
        "tracker",
        "--intervals",
        "20",
        "50",
    ]
    line += ["--trained", "20", "50", "--size", "16", "16", "--seeds", "1", "--steps", "2", "--episodes", "1"]
    line += ["--imitate", "--points", "0", "--out", str(tmp_path)]
    assert command(line) == 0
    first = capsys.readouterr().out
    assert command(line) == 0 and capsys.readouterr().out == first
    figures = (tmp_path / "light.md").read_text()
    rows = [[cell.strip() for cell in row.strip("|").split("|")] for row in figures.splitlines()]
    assert rows[0][2:5] == ["interval [frames]", "root_tfp", "tracker"] and len({len(row) for row in rows}) == 1
    assert [row[2] for row in rows[2:]] == ["20", "50"] and all(row[4] for row in rows[2:]), "trackers beside agents"
    assert all(cell in first for row in rows[2:] for cell in row)
    assert (tmp_path / "light.png").stat().st_size > 1000
