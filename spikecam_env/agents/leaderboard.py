"""The leaderboard: entries are files of results that anyone can check, and a table of them.

An entry says task, level, camera, learner, budget and seeds of every row, and the command that gives it.  A row of the
table is an entry's task, camera and learner: the score is the mean over levels, then over seeds.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from spikecam_env.agents.over import mean_of_seeds
from spikecam_env.agents.playing import episodes_of
from spikecam_env.agents.study import Level, Result, by_cell, mean_known
from spikecam_env.untrusted import Count, Declared, Name, Seed, Whole, declared, read_json
from spikecam_env.version import __version__

FRAMES_A_STEP = 40
"""A millisecond of the camera at 40 kHz: a step of every task with levels."""


class EntryRow(Declared):
    """The runs of a cell of a study, one a seed."""

    task: Name
    level: Level | None
    camera: Name
    """Name of the observation, or of a player that learns nothing."""
    learner: Name
    frames: Whole
    """Frames that the camera exposed in training, of all environments; 0 of players that learn nothing."""
    episodes: Count
    """Test episodes of a score: those of seeds 0, 1, ..."""
    seeds: Annotated[tuple[Seed, ...], Field(strict=False, min_length=1)]
    scores: Annotated[tuple[float, ...], Field(strict=False, min_length=1)]
    """By seed."""
    successes: Annotated[tuple[float | None, ...], Field(strict=False, min_length=1)]
    """By seed."""
    camera_bits_s: float | None
    """What the camera sent in the test episodes [bits/s]."""


class Entry(Declared):
    """A file of the leaderboard."""

    name: Name
    version: Name
    """Of this package."""
    command: Name
    """That gives these rows."""
    rows: Annotated[tuple[EntryRow, ...], Field(strict=False, min_length=1)]


def entry_of(results: Sequence[Result], name: str, command: str) -> Entry:
    """The entry of a study.

    Args:
        results: of the study.
        name: of the entry.
        command: that gives these results.

    Example:
        >>> from spikecam_env.agents.study import StudyRun
        >>> runs = [Result(case=StudyRun(task="Return-v1", sight="tfp", level=1, steps=64), score=0.5)]
        >>> entry_of(runs, "mine", "spikecam evaluate agents --out study").rows[0].frames
        2560
    """
    rows = [
        EntryRow(
            task=cell.task,
            level=cell.level,
            camera=cell.sight,
            learner="none" if cell.steps == 0 else "imitation" if cell.imitate else cell.learner,
            frames=cell.steps * FRAMES_A_STEP,
            episodes=cell.episodes or episodes_of(cell.task),
            seeds=tuple(result.case.seed for result in its),
            scores=tuple(result.score for result in its),
            successes=tuple(result.success for result in its),
            camera_bits_s=mean_known(result.camera_bits_s for result in its),
        )
        for cell, its in by_cell(results).items()
    ]
    return Entry(name=name, version=__version__, command=command, rows=tuple(rows))


def read_entries(folder: Path) -> list[Entry]:
    """The entries of a folder, by the names of their files.

    Raises:
        InputError: for a file that is no entry.

    Example:
        >>> read_entries(Path())
        []
    """
    return [declared(Entry, read_json(path), str(path)) for path in sorted(folder.glob("*.json"))]


def leaderboard(entries: Sequence[Entry]) -> list[dict[str, Any]]:
    """Rows of the table, best of a task first: successes by level, 1 to 5, and the mean score, over seeds.

    Example:
        >>> from spikecam_env.agents.study import StudyRun
        >>> runs = [Result(case=StudyRun(task="Return-v1", sight="oracle", level=n), score=1.0) for n in (1, 2)]
        >>> leaderboard([entry_of(runs, "ends", "spikecam evaluate agents --out study")])[0]["score"]
        '1.000'
    """
    groups: dict[tuple[str, str, str, str], list[EntryRow]] = {}
    for entry in entries:
        for row in entry.rows:
            groups.setdefault((row.task, entry.name, row.camera, row.learner), []).append(row)
    lines = [_line(whose, rows) for whose, rows in groups.items()]
    return sorted(lines, key=lambda line: (line["task"], -float(line["score"].split(" ")[0])))


def _line(whose: tuple[str, str, str, str], rows: list[EntryRow]) -> dict[str, Any]:
    task, entry, camera, learner = whose
    bits = mean_known(row.camera_bits_s for row in rows)
    rows = sorted(rows, key=lambda row: row.level or 0)
    return {
        "task": task,
        "entry": entry,
        "sees": camera,
        "learner": learner,
        "frames [million]": rows[0].frames / 1e6,
        "seeds": len(rows[0].seeds),
        "episodes": min(row.episodes for row in rows),
        "score": str(mean_of_seeds(np.mean([row.scores for row in rows], axis=0))),
        "success by level": ", ".join(f"{_said(row.level)}: {_said(mean_known(row.successes))}" for row in rows),
        "camera [Mbit/s]": None if bits is None else bits / 1e6,
    }


def _said(number: float | None) -> str:
    return "-" if number is None else f"{number:.3g}"
