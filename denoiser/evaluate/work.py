"""The one runner of evaluations: rows of cases, in this process or in several; each result is saved at once.

    cases x rows -> records          an evaluation lists its cases and rows; its `Kind` exposes a case and judges a row

A unit of work is one source (`rows.ROWS`) of one case: its rows share a run of its network.  Results in the file are
not made again, unless the weights have changed since.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Generic, TypeVar

from tqdm import tqdm

from denoiser.evaluate.case import CaseRecord, ExposedStreams, Key, StreamCase
from denoiser.evaluate.rows import ROWS, RowStreams, Weights, streams, weights_of
from denoiser.networks.reconstructor_recipe import LEARNED
from spikecam_env.errors import InputError, shown
from spikecam_env.pool import spread
from spikecam_env.run_folder import run_folder
from spikecam_env.threads import use_one_thread
from spikecam_env.untrusted import declared, parse_json, read_text
from spikecam_env.whole import write_text_whole

FORMAT = "spikecam-evaluation/1"
R = TypeVar("R", bound=CaseRecord)


@dataclass(frozen=True)
class Kind(Generic[R]):
    """A kind of evaluation: functions of modules, which go to other processes by name."""

    record: type[R]
    """Of a row of a case."""
    expose: Callable[[StreamCase], ExposedStreams]
    judge: Callable[[WorkItem[R], RowStreams, ExposedStreams], dict[str, Any]]
    """Entries of the record but for those of every `CaseRecord`."""


@dataclass(frozen=True)
class WorkItem(Generic[R]):
    """Some rows of one source of one case."""

    kind: Kind[R]
    case: StreamCase
    source: str
    rows: tuple[str, ...]
    weights: Weights
    columns: tuple[str, ...] = ()
    """Pictures of a table (`judge.COLUMNS`)."""
    pictures: Path | None = None
    """A folder for PNG files of the rows' pictures, or None."""

    def identity(self) -> dict[str, str | None]:
        """Digests of the weights behind its rows and pictures, by name."""
        names = [weights_of(self.source), *(c for c in self.columns if c in LEARNED)]
        return {name: self.weights.digest(name) for name in names if name is not None}


@dataclass(frozen=True)
class Results(Generic[R]):
    """Records of a results file (JSON lines, settings first), or of none."""

    path: Path | None
    settings: dict[str, Any]
    records: dict[Key, R]

    @classmethod
    def opened(cls, path: Path, settings: dict[str, Any], record: type[R]) -> Results[R]:
        """The records of the file, if it exists; InputError where it is damaged, or of other settings."""
        if not path.exists():
            return cls(path, settings, {})
        head, *lines = read_text(path).rstrip("\n").split("\n")
        found = parse_json(head, str(path))
        if not isinstance(found, dict) or found.get("format") != FORMAT:
            raise InputError(f"{path} is no {FORMAT} file; choose another folder")
        if different := [name for name in settings if found.get(name) != settings[name]]:
            was = ", ".join(f"{name} {shown(found.get(name))} (asked: {settings[name]})" for name in different)
            raise InputError(f"{path} holds results of other settings: {was}; ask for the same, or another folder")
        records = [
            declared(record, parse_json(line, str(path)), f"{path}, line {i}") for i, line in enumerate(lines, 2)
        ]
        return cls(path, settings, {record.key: record for record in records})

    def add(self, records: Iterable[R]) -> None:
        """Take records in, and write the file."""
        self.records.update({record.key: record for record in records})
        if self.path is not None:
            head = json.dumps({"format": FORMAT, **self.settings})
            write_text_whole(self.path, "\n".join([head, *(r.model_dump_json() for r in self.records.values())]) + "\n")

    def write(self, result: dict[str, Any], report: str) -> None:
        """Write the result as NAME.json and the report as NAME.txt beside the records, where these have a file."""
        if self.path is not None:
            text = json.dumps(_plain(result), indent=1, allow_nan=False) + "\n"
            write_text_whole(self.path.with_suffix(".json"), text)
            write_text_whole(self.path.with_suffix(".txt"), report)

    def has(self, item: WorkItem[R]) -> bool:
        """Whether all rows of the item have a record, of the same weights."""
        found = [self.records.get(item.case.key(row)) for row in item.rows]
        identity, columns = item.identity(), set(item.columns)
        return all(r is not None and r.weights == identity and columns <= set(r.pictures) for r in found)


@contextmanager
def results_in(
    out: str | os.PathLike[str] | None, name: str, settings: dict[str, Any], record: type[R]
) -> Iterator[Results[R]]:
    """The results of an evaluation, which goes on where it was stopped in the same folder.

    Args:
        out: the folder, made if needed, which the evaluation has to itself; None: no files.
        name: of the evaluation: NAME.jsonl in the folder has the records.
        settings: that all records of a file share; cases and rows can be added to it.
        record: class of the records.

    Yields:
        The results; its `write` makes the other files.

    Raises:
        InputError: another run at work in the folder, or results of other settings in it.
        WriteError: the folder or its files cannot be written.
    """
    if out is None:
        yield Results(None, settings, {})
    else:
        with run_folder(Path(out), "an evaluation") as folder:
            yield Results.opened(folder / f"{name}.jsonl", settings, record)


def evaluated(
    kind: Kind[R],
    cases: Sequence[StreamCase],
    rows: Sequence[str],
    weights: Weights,
    results: Results[R],
    *,
    columns: Sequence[str] = (),
    jobs: int = 1,
    pictures: Path | None = None,
    progress: bool = True,
) -> list[R]:
    """All records, of earlier runs and of this one, in the order of cases and rows.

    Args:
        kind: of the cases.
        cases: whose streams are judged.
        rows: of `rows.ROWS`.
        weights: of the rows and columns.
        results: takes the records in.
        columns: pictures of a table.
        jobs: processes; 1: this one.
        pictures: folder for the pictures of the first case of each scene.
        progress: shows a bar.

    Raises:
        InputError: as of `kind.expose`, and where a process dies.
    """
    drawn = {case.scene: case for case in reversed(cases)}  # the first of each scene
    wanted = [
        WorkItem(
            kind, case, source, tuple(row for row in rows if ROWS[row].source == source), weights, tuple(columns),
            pictures if case is drawn[case.scene] else None,
        )
        for case in cases
        for source in dict.fromkeys(ROWS[row].source for row in rows)
    ]  # fmt: skip
    todo = [item for item in wanted if not results.has(item)]
    bar = tqdm(
        total=len(wanted), initial=len(wanted) - len(todo), desc="evaluate", unit="stream", leave=False,
        disable=not progress,
    )  # fmt: skip
    with bar:
        for records in work(todo, jobs):
            results.add(records)
            bar.update()
    return [results.records[case.key(row)] for case in cases for row in rows]


def work(todo: Sequence[WorkItem[R]], jobs: int = 1) -> Iterator[list[R]]:
    """Records of the items as they are done, in so many processes (1: in this one); InputError where one dies."""
    return spread(do, todo, jobs, prepare=_one_thread)


def do(item: WorkItem[R]) -> list[R]:
    """One item, done here."""
    case = item.case
    exposed = _exposed(item.kind.expose, case)
    made = streams(item.source, list(item.rows), case, exposed, item.weights)
    of: dict[str, Any] = {name: getattr(case, name) for name in ("scene", "seed", "interval", "speed")}
    of["weights"] = item.identity()
    return [item.kind.record(**of, row=row.row, **item.kind.judge(item, row, exposed)) for row in made]


@lru_cache(maxsize=1)
def _exposed(expose: Callable[[StreamCase], ExposedStreams], case: StreamCase) -> ExposedStreams:
    """The last case is kept, whose other sources come next."""
    return expose(case)


def _one_thread() -> None:
    import torch

    use_one_thread()
    torch.set_num_threads(1)


def _plain(value: Any) -> Any:
    """For JSON, which knows neither infinity nor NaN."""
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
