"""Rows of cases, in this process or in several; each result is saved at once.

A unit of work is one source (`rows.ROWS`) of one case: its rows share a run of its network.  Results in the file are
not made again, unless the weights have changed since.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from denoiser.evaluate import phm, real, still
from denoiser.evaluate.exposed import CLASSICAL, ExposedStreams, StreamCase
from denoiser.evaluate.judge import RowResult, display, judged, pictures_of
from denoiser.evaluate.rows import ROWS, Weights, planes_a_pass, streams, weights_of
from spikecam_env.errors import InputError, shown
from spikecam_env.pool import spread
from spikecam_env.threads import use_one_thread
from spikecam_env.untrusted import declared, parse_json, read_text
from spikecam_env.whole import whole_file, write_text_whole

FORMAT = "spikecam-evaluation/1"
_EXPOSE: dict[str, Callable[[StreamCase], ExposedStreams]] = {
    "phm": phm.expose,
    "real": real.expose,
    "still": still.expose,
}
LIGHT = "light"
"""Name of the picture of the true light."""


@dataclass(frozen=True)
class WorkItem:
    """Some rows of one source of one case."""

    case: StreamCase
    source: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    weights: Weights
    pictures: Path | None = None
    """A folder for PNG files of the rows' pictures, or None."""


@dataclass(frozen=True)
class Results:
    """Records of a results file (JSON lines, settings first), or of none."""

    path: Path | None
    settings: dict[str, Any]
    records: dict[tuple[Any, ...], RowResult]

    @classmethod
    def opened(cls, path: Path | None, settings: dict[str, Any]) -> Results:
        """The records of the file, if it exists; InputError where it is damaged, or of other settings."""
        if path is None or not path.exists():
            return cls(path, settings, {})
        head, *lines = read_text(path).rstrip("\n").split("\n")
        found = parse_json(head, str(path))
        if not isinstance(found, dict) or found.get("format") != FORMAT:
            raise InputError(f"{path} is no {FORMAT} file; choose another folder")
        if different := [name for name in settings if found.get(name) != settings[name]]:
            was = ", ".join(f"{name} {shown(found.get(name))} (asked: {settings[name]})" for name in different)
            raise InputError(f"{path} holds results of other settings: {was}; ask for the same, or another folder")
        records = [
            declared(RowResult, parse_json(line, str(path)), f"{path}, line {i}") for i, line in enumerate(lines, 2)
        ]
        return cls(path, settings, {record.key: record for record in records})

    def add(self, records: Iterable[RowResult]) -> None:
        """Take records in, and write the file."""
        self.records.update({record.key: record for record in records})
        if self.path is not None:
            head = json.dumps({"format": FORMAT, **self.settings})
            write_text_whole(self.path, "\n".join([head, *(r.model_dump_json() for r in self.records.values())]) + "\n")


def tasks(
    case: StreamCase, rows: Sequence[str], columns: Sequence[str], weights: Weights, pictures: Path | None
) -> list[WorkItem]:
    """The work on a case, a task for each source of its rows."""
    return [
        WorkItem(case, source, tuple(r for r in rows if ROWS[r].source == source), tuple(columns), weights, pictures)
        for source in dict.fromkeys(ROWS[row].source for row in rows)
    ]


def undone(wanted: Sequence[WorkItem], results: Results) -> list[WorkItem]:
    """The tasks that have rows without a result, or one of other weights."""
    return [task for task in wanted if not all(_is_done(task, row, results) for row in task.rows)]


def work(todo: Sequence[WorkItem], jobs: int = 1) -> Iterator[list[RowResult]]:
    """Records of the tasks as they are done, in so many processes (1: in this one); InputError where one dies."""
    return spread(do, todo, jobs, prepare=_one_thread)


def do(task: WorkItem) -> list[RowResult]:
    """One task, done here."""
    exposed = _EXPOSE[task.case.kind](task.case)
    made = streams(task.source, list(task.rows), task.case, exposed, task.weights)
    columns = {column: task.weights.path(column) for column in task.columns}
    records = []
    for row, (spikes, planes) in made.items():
        planes = planes if ROWS[row].shows_planes else None
        shown = pictures_of(spikes, planes, exposed, columns)
        passes = planes_a_pass(task.source, task.weights)
        found = judged(shown, spikes, planes, exposed, passes, still=task.case.kind == "still")
        records.append(RowResult(**_key(task.case), row=row, weights=_identity(task), **found))
        _save_pictures(task, row, shown, exposed)
    return records


def picture_path(folder: Path, case: StreamCase, row: str, column: str) -> Path:
    """File of a row's picture in a column."""
    return folder / f"{case.scene.replace(' ', '-')}-{row}-{column}.png"


def _save_pictures(task: WorkItem, row: str, shown: dict[str, np.ndarray], exposed: ExposedStreams) -> None:
    if task.pictures is None:
        return
    for column, found in shown.items():
        _save(picture_path(task.pictures, task.case, row, column), display(found, exposed.white))
    if exposed.light is not None:
        truth = exposed.light[exposed.middle - exposed.first]
        _save(picture_path(task.pictures, task.case, LIGHT, LIGHT), display(truth, exposed.white))


def _save(path: Path, shown: np.ndarray) -> None:
    from PIL import Image

    with whole_file(path) as beside:
        Image.fromarray((255 * shown + 0.5).astype(np.uint8)).save(beside)


def _key(case: StreamCase) -> dict[str, Any]:
    return {"scene": case.scene, "seed": case.seed, "interval": case.interval, "speed": case.speed}


def _identity(task: WorkItem) -> dict[str, str | None]:
    names = [weights_of(task.source), *(c for c in task.columns if c not in CLASSICAL)]
    return {name: task.weights.digest(name) for name in names if name is not None}


def _is_done(task: WorkItem, row: str, results: Results) -> bool:
    found = results.records.get((*_key(task.case).values(), row))
    return found is not None and found.weights == _identity(task) and set(task.columns) <= set(found.pictures)


def _one_thread() -> None:
    import torch

    use_one_thread()
    torch.set_num_threads(1)
