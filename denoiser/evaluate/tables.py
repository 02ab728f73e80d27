"""The paper's tables, and what it has none for: dim light, fast motion, scenes at rest.

    table1   PHM_N: noisy, the paper's pipelines, `paper`, `best`, the clean twin, under five reconstructions
    table2   the same on real recordings, by NIQE
    table3   PHM_N: the paper's ablation, refine module and MUS, each with and without
    table4   the same on real recordings
    still    collages at rest: the mean and the last of 400 frames, with and without a calibration of the camera

    result = evaluate_table("table1", Asked(out=Path("evaluation"), jobs=2))
    print(report(result))

A table that was stopped goes on where it was, in the same folder.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

from tqdm import tqdm

from denoiser.evaluate import phm, real, still
from denoiser.evaluate.exposed import CLASSICAL, StreamCase
from denoiser.evaluate.judge import COLUMNS, RowResult
from denoiser.evaluate.page import write_page
from denoiser.evaluate.rows import ROWS, Weights, parameters, why_not
from denoiser.evaluate.table_report import report
from denoiser.evaluate.table_summary import groups
from denoiser.evaluate.work import Results, tasks, undone, work
from scenes.catalogue import SCENES
from spikecam_env.checked import checked_count, checked_memory, checked_shape
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.run_folder import run_folder
from spikecam_env.whole import made_folder, write_text_whole

ABLATION = (
    "noisy",
    *("baseline-held", "baseline-mus", "baseline", "paper-held", "paper-mus", "paper"),
    *("clean", "light-held", "light-mus", "light"),
)
METHODS = (
    "noisy",
    "tfp",
    "ssml",
    "spk2img-clean",
    "spk2img-noisy",
    "paper-mus",
    "paper",
    "fast",
    "best",
    "clean",
    "light",
)
REAL_METHODS = METHODS[:-2]
REAL_ABLATION = ABLATION[:7]
BYTES = 12
"""A frame and pixel: noisy, clean and decoded spikes, rates and light in float32, and one byte to spare."""
LEAST_FRAMES = 2 * phm.WARM_UP


@dataclass(frozen=True)
class Table:
    """kind: of its cases (`exposed.Case`)."""

    title: str
    kind: str
    rows: tuple[str, ...]


TABLES = {
    "table1": Table("Table 1: PHM_N, pictures against the true light", "phm", METHODS),
    "table2": Table("Table 2: real recordings, NIQE (lower is better)", "real", REAL_METHODS),
    "table3": Table("Table 3: PHM_N, the ablation of refine module and MUS", "phm", ABLATION),
    "table4": Table("Table 4: real recordings, the ablation by NIQE (lower is better)", "real", REAL_ABLATION),
    "still": Table("Still scenes, well lit", "still", ("noisy", "paper", "best", "best-map", "clean")),
}


@dataclass(frozen=True)
class TableRequest:
    """What a table is made of; what is not said is the table's own.

    scenes: of the catalogue; at rest, how many a class are `still_scenes`.  shape: (rows, columns).  seeds: cameras
    before each scene.  intervals: mean frames between spikes.  speeds: [pixels/frame], 0 the scene's own.  frames: of
    each stream.  rows: of `rows.ROWS`.  data: a dataset to take streams from.  real: folder of real recordings.
    out: folder for results, pictures and the page; None prints only.  jobs: processes.
    """

    scenes: tuple[str, ...] = phm.SCENES
    still_scenes: int = 2
    shape: tuple[int, int] | None = None
    seeds: int = 3
    intervals: tuple[float, ...] = (10.0,)
    speeds: tuple[float, ...] = (0.0,)
    frames: int | None = None
    rows: tuple[str, ...] = ()
    data: Path | None = None
    real: Path = real.FOLDER
    weights: Weights = field(default_factory=Weights)
    out: Path | None = None
    jobs: int = 1


def evaluate_table(name: str, asked: TableRequest | None = None, *, progress: bool = False) -> dict[str, Any]:
    """A table of `TABLES`; `report` shows the result as text.

    Returns table, title, rows, settings, groups (see `table_summary.groups`), scenes (every record), missing (why rows,
    columns or recordings are not there), parameters (weights of the rows' networks) and figures (see
    `figures.figures`).
    Raises InputError for unknown names, too few frames, a folder of recordings that is not there, and a folder in which
    another run is at work, or that holds results of other settings.
    """
    if name not in TABLES:
        raise unknown_name("table", name, TABLES)
    table, asked = TABLES[name], asked or TableRequest()
    rows = _rows(table, asked)
    asked.weights.check()
    cases, missing = _cases(table, asked)
    _check_memory(cases)
    missing |= {row: why for row in rows if (why := why_not(ROWS[row].source, asked.weights))}
    missing |= {c: why for c in COLUMNS if c not in CLASSICAL and (why := asked.weights.missing(c))}
    here = [row for row in rows if row not in missing]
    columns = [column for column in COLUMNS if column not in missing]
    sizes = {row: parameters(ROWS[row].source, asked.weights) for row in here}
    if asked.out is None:
        records = _made(cases, here, columns, asked, Results.opened(None, {}), None, progress)
        return _result(name, rows, cases, records, missing, sizes)
    with run_folder(asked.out, "a table") as folder:
        results = Results.opened(folder / f"{name}.jsonl", _settings(asked))
        with made_folder(folder / "pictures", "pictures") as pictures:
            records = _made(cases, here, columns, asked, results, pictures, progress)
        result = _result(name, rows, cases, records, missing, sizes)
        write_text_whole(folder / f"{name}.json", json.dumps(result, indent=1) + "\n")
        write_text_whole(folder / f"{name}.txt", report(result))
        write_page(folder / f"{name}.png", pictures, cases, rows, records)
    return result


def _rows(table: Table, asked: TableRequest) -> list[str]:
    for row in asked.rows:
        if row not in ROWS:
            raise unknown_name("row", row, ROWS)
    if table.kind == "real" and (lightless := [r for r in asked.rows if ROWS[r].source in ("clean", "light")]):
        raise InputError(f"row {lightless[0]!r} needs the true light, which real recordings do not have")
    wanted = {"noisy", *(asked.rows or table.rows)}
    return [row for row in ROWS if row in wanted]


def _cases(table: Table, asked: TableRequest) -> tuple[list[StreamCase], dict[str, str]]:
    """The cases, and by name why others are not there."""
    if table.kind == "real":
        if asked.real != real.FOLDER and not asked.real.is_dir():
            raise InputError(f"there is no folder {asked.real}; give the folder of the recordings")
        paths = [asked.real / name for name in real.RECORDINGS]
        missing = {path.name: f"there is no recording {path}" for path in paths if not path.is_file()}
        return [case for path in paths if path.is_file() for case in real.real_cases(path)], missing
    checked_count(asked.seeds, "seeds")
    if table.kind == "still":
        shape, frames = checked_shape(asked.shape or still.SHAPE), checked_count(asked.frames or still.FRAMES)
        names = still.still_scenes(checked_count(asked.still_scenes, "scenes"))
        return [StreamCase("still", n, seed, shape, frames, 0.0) for n in names for seed in range(asked.seeds)], {}
    if asked.data is not None:
        return [case for case in phm.dataset_cases(asked.data) if case.scene in asked.scenes], {}
    for scene in asked.scenes:
        if scene not in SCENES:
            raise unknown_name("scene", scene, SCENES)
    return [
        StreamCase(
            "phm", scene, seed, checked_shape(asked.shape or (250, 400)), _frames(asked, interval), interval, speed
        )
        for interval, speed, scene, seed in product(asked.intervals, asked.speeds, asked.scenes, range(asked.seeds))
    ], {}


def _check_memory(cases: list[StreamCase]) -> None:
    """Raises InputError where a stream and what is made of it are more than the memory."""
    for case in cases:
        size = case.frames * case.shape[0] * case.shape[1] * BYTES
        checked_memory(size, f"{case.scene}, {case.frames} frames of {case.shape[0]} x {case.shape[1]},")


def _frames(asked: TableRequest, interval: float) -> int:
    if asked.frames is not None and asked.frames < LEAST_FRAMES:
        raise InputError(
            f"frames = {asked.frames}; it must be at least {LEAST_FRAMES}: the picture is of the middle frame, and "
            f"noisy and clean streams forget their common start in {phm.WARM_UP}"
        )
    return asked.frames or phm.default_frames(interval)


def _settings(asked: TableRequest) -> dict[str, Any]:
    """What all results of a file share; scenes, seeds, intervals, speeds and rows can be added to it."""
    return {
        "shape": None if asked.shape is None else list(asked.shape),
        "frames": asked.frames,
        "data": None if asked.data is None else str(asked.data),
    }


def _made(
    cases: list[StreamCase],
    rows: list[str],
    columns: list[str],
    asked: TableRequest,
    results: Results,
    pictures: Path | None,
    progress: bool,
) -> list[RowResult]:
    """All records, those that were there and those made now, in the order of cases and rows."""
    drawn = {case.scene: case for case in reversed(cases)}  # the first of each scene
    wanted = [
        task
        for case in cases
        for task in tasks(case, rows, columns, asked.weights, pictures if case is drawn[case.scene] else None)
    ]
    todo = undone(wanted, results)
    bar = tqdm(
        total=len(wanted), initial=len(wanted) - len(todo), desc="evaluate", unit="stream", leave=False,
        disable=not progress,
    )  # fmt: skip
    with bar:
        for records in work(todo, asked.jobs):
            results.add(records)
            bar.update()
    keys = [(c.scene, c.seed, c.interval, c.speed, row) for c in cases for row in rows]
    return [results.records[key] for key in keys]


def _result(
    name: str,
    rows: list[str],
    cases: list[StreamCase],
    records: list[RowResult],
    missing: dict[str, str],
    sizes: dict[str, int | None],
) -> dict[str, Any]:
    return {
        "table": name,
        "title": TABLES[name].title,
        "rows": rows,
        "settings": {
            "scenes": list(dict.fromkeys(case.scene for case in cases)),
            "seeds": len({case.seed for case in cases}),
            "seeds_are_instants": TABLES[name].kind == "real",
            "shapes": [list(shape) for shape in dict.fromkeys(case.shape for case in cases)],
            "frames": list(dict.fromkeys(case.frames for case in cases)),
            "data": sorted({case.folder for case in cases if case.folder}),
        },
        "missing": missing,
        "parameters": sizes,
        "groups": groups(records),
        "scenes": [record.model_dump() for record in records],
    }
