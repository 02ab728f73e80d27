"""The paper's tables, and others: dim light, fast motion, scenes at rest.

    table1   PHM_N: noisy, the paper's pipelines, `paper`, `best`, the clean twin, under five reconstructions
    table2   the same on real recordings, by NIQE
    table3   PHM_N: the paper's ablation, refine module and MUS, each with and without
    table4   the same on real recordings
    still    collages at rest: the mean and the last of 400 frames, with and without a calibration of the camera

    result = evaluate_table("table1", TableRequest(out=Path("evaluation"), jobs=2))
    print(report(result))

A table that was stopped goes on where it was, in the same folder.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field, fields
from itertools import product
from pathlib import Path
from typing import Any

from denoiser.evaluate import held_out, phm, real
from denoiser.evaluate.case import ExposedStreams, StreamCase
from denoiser.evaluate.judge import COLUMNS, RowResult, judged, pictures_of
from denoiser.evaluate.page import LIGHT, save_pictures, write_page
from denoiser.evaluate.rows import ROWS, RowStreams, Weights, parameters, planes_a_pass, why_not
from denoiser.evaluate.table_report import report
from denoiser.evaluate.table_summary import groups
from denoiser.evaluate.work import Kind, WorkItem, evaluated, results_in
from denoiser.networks.reconstructor_recipe import LEARNED
from scenes.catalogue import SCENES
from spikecam_env.checked import checked_count, checked_memory, checked_numbers, checked_shape
from spikecam_env.datasets.plan import AT_REST, FASTEST_PAN
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.whole import made_folder

ABLATION = (
    "noisy",
    *("baseline-held", "baseline-mus", "baseline", "paper-held", "paper-mus", "paper"),
    *("clean", "light-held", "light-mus", "light"),
)
METHODS = (
    *("noisy", "tfp", "ssml", "spk2img-clean", "spk2img-noisy"),
    *("paper-mus", "paper", "picture", "fast", "best", "clean", "light"),
)
REAL_METHODS = METHODS[:-2]
REAL_ABLATION = ABLATION[:7]
BYTES = 12
"""A frame and pixel: noisy, clean and decoded spikes, rates and light in float32, and one byte to spare."""
LEAST_FRAMES = 2 * phm.WARM_UP
OF_A_DATASET = ("shape", "seeds", "intervals", "speeds", "pan", "frames")
"""Settings of a request that a dataset has of its own."""


@dataclass(frozen=True)
class Table:
    """A table of the paper, or another of the same cases."""

    title: str
    kind: Kind[Any]
    rows: tuple[str, ...]


def _judged(item: WorkItem[RowResult], made: RowStreams, exposed: ExposedStreams) -> dict[str, Any]:
    shown = pictures_of(made, exposed, {column: item.weights.path(column) for column in item.columns})
    if item.pictures is not None:
        save_pictures(item.pictures, item.case, made.row, shown, exposed.white)
        if exposed.light is not None:
            truth = exposed.light[exposed.middle - exposed.first]
            save_pictures(item.pictures, item.case, LIGHT, {LIGHT: truth}, exposed.white)
    return judged(shown, made, exposed, planes_a_pass(item.source, item.weights), still=item.kind == STILL)


PHM = Kind(RowResult, phm.expose, _judged)
REAL = Kind(RowResult, real.expose, _judged)
STILL = Kind(RowResult, held_out.expose_still, _judged)
TABLES = {
    "table1": Table("Table 1: PHM_N, pictures against the true light", PHM, METHODS),
    "table2": Table("Table 2: real recordings, NIQE (lower is better)", REAL, REAL_METHODS),
    "table3": Table("Table 3: PHM_N, the ablation of refine module and MUS", PHM, ABLATION),
    "table4": Table("Table 4: real recordings, the ablation by NIQE (lower is better)", REAL, REAL_ABLATION),
    "still": Table(
        "Still scenes, well lit", STILL, ("noisy", "paper", "picture", "picture-map", "best", "best-map", "clean")
    ),
}


@dataclass(frozen=True)
class TableRequest:
    """Contents and place of a table."""

    scenes: tuple[str, ...] = phm.SCENES
    """Of the catalogue."""
    still_scenes: int = 2
    """Scenes at rest of each class."""
    shape: tuple[int, int] | None = None
    """(rows, columns); default the table's."""
    seeds: int = 3
    """Cameras before each scene."""
    intervals: tuple[float, ...] = (10.0,)
    """Mean frames between spikes."""
    speeds: tuple[float, ...] = (0.0,)
    """[pixels/frame]; 0: the scene's own."""
    pan: tuple[float, float] = AT_REST
    """Velocity of the camera's gaze, to the right and down [pixels/frame]."""
    frames: int | None = None
    """Of each stream; default the table's."""
    rows: tuple[str, ...] = ()
    """Of `rows.ROWS`; default the table's."""
    data: Path | None = None
    """A dataset from which streams are taken."""
    real: Path = real.FOLDER
    """Folder of real recordings."""
    weights: Weights = field(default_factory=Weights)
    out: Path | None = None
    """Folder for results, pictures and the page; None: none."""
    jobs: int = 1
    """Processes."""


def evaluate_table(name: str, request: TableRequest | None = None, *, progress: bool = False) -> dict[str, Any]:
    """Make a table; `report` shows the result as text.

    Args:
        name: of `TABLES`.
        request: contents; default those of the paper.
        progress: shows a bar.

    Returns:
        table, title, rows, settings, groups (see `table_summary.groups`), scenes (every record), missing (why rows,
        columns or recordings are missing), parameters (weights of the rows' networks).

    Raises:
        InputError: unknown names, too few frames, a folder of recordings that does not exist; another run at work in
            `out`, or results of other settings in it.
    """
    if name not in TABLES:
        raise unknown_name("table", name, TABLES)
    table, request = TABLES[name], request or TableRequest()
    rows = rows_of(table, request)
    request.weights.check()
    cases, missing = cases_of(table, request)
    check_memory(cases)
    missing |= {row: why for row in rows if (why := why_not(ROWS[row].source, request.weights))}
    missing |= {c: why for c in COLUMNS if c in LEARNED and (why := request.weights.missing(c))}
    here = [row for row in rows if row not in missing]
    columns = [column for column in COLUMNS if column not in missing]
    sizes = {row: parameters(ROWS[row].source, request.weights) for row in here}
    with results_in(request.out, name, settings_of(request), RowResult) as results:
        folder = nullcontext() if request.out is None else made_folder(request.out / "pictures", "pictures")
        with folder as pictures:
            records = evaluated(
                table.kind, cases, here, request.weights, results,
                columns=columns, jobs=request.jobs, pictures=pictures, progress=progress,
            )  # fmt: skip
        result = _result(name, rows, cases, records, missing, sizes)
        results.write(result, report(result))
        if pictures is not None:
            write_page(pictures.parent / f"{name}.png", pictures, cases, rows, records)
    return result


def rows_of(table: Table, request: TableRequest) -> list[str]:
    """The rows that are asked for, in the order of `rows.ROWS`; InputError for unknown ones."""
    for row in request.rows:
        if row not in ROWS:
            raise unknown_name("row", row, ROWS)
    if table.kind == REAL and (lightless := [r for r in request.rows if ROWS[r].source in ("clean", "light")]):
        raise InputError(f"row {lightless[0]!r} needs the true light, which real recordings do not have")
    wanted = {"noisy", *(request.rows or table.rows)}
    return [row for row in ROWS if row in wanted]


def cases_of(table: Table, request: TableRequest) -> tuple[list[StreamCase], dict[str, str]]:
    """The cases, and by name why others are missing."""
    if table.kind == REAL:
        if request.real != real.FOLDER and not request.real.is_dir():
            raise InputError(f"there is no folder {request.real}; give the folder of the recordings")
        paths = [request.real / name for name in real.RECORDINGS]
        missing = {path.name: f"there is no recording {path}" for path in paths if not path.is_file()}
        return [case for path in paths if path.is_file() for case in real.real_cases(path)], missing
    checked_count(request.seeds, "seeds")
    if table.kind == STILL:
        shape, frames = (
            checked_shape(request.shape or held_out.STILL_SHAPE),
            checked_count(request.frames or held_out.STILL_FRAMES),
        )
        names = held_out.still_scenes(checked_count(request.still_scenes, "scenes"))
        return [StreamCase(n, seed, shape, frames, 0.0) for n in names for seed in range(request.seeds)], {}
    if request.data is not None:
        for option in fields(request):
            if option.name in OF_A_DATASET and getattr(request, option.name) != option.default:
                raise InputError(f"{option.name} is that of the dataset {request.data}; leave it out")
        return [case for case in phm.dataset_cases(request.data) if case.scene in request.scenes], {}
    right, down = checked_numbers(request.pan, "pan", 2, -FASTEST_PAN, FASTEST_PAN, unit="pixels/frame")
    pan = (right, down)
    for scene in request.scenes:
        if scene not in SCENES:
            raise unknown_name("scene", scene, SCENES)
    return [
        StreamCase(
            scene,
            seed,
            checked_shape(request.shape or (250, 400)),
            _frames(request, interval),
            interval,
            speed,
            pan=pan,
        )
        for interval, speed, scene, seed in product(
            request.intervals, request.speeds, request.scenes, range(request.seeds)
        )
    ], {}


def check_memory(cases: list[StreamCase]) -> None:
    """InputError where a stream and its pictures need more than the memory."""
    for case in cases:
        size = case.frames * case.shape[0] * case.shape[1] * BYTES
        checked_memory(size, f"{case.scene}, {case.frames} frames of {case.shape[0]} x {case.shape[1]},")


def _frames(request: TableRequest, interval: float) -> int:
    if request.frames is not None and request.frames < LEAST_FRAMES:
        raise InputError(
            f"frames = {request.frames}; it must be at least {LEAST_FRAMES}: the picture is of the middle frame, and "
            f"noisy and clean streams forget their common start in {phm.WARM_UP}"
        )
    return request.frames or phm.default_frames(interval)


def settings_of(request: TableRequest) -> dict[str, Any]:
    """The settings that all results of a file share; scenes, seeds, intervals, speeds and rows can be added to it."""
    return {
        "shape": None if request.shape is None else list(request.shape),
        "frames": request.frames,
        "data": None if request.data is None else str(request.data),
        "pan": None if request.pan == AT_REST else list(request.pan),
    }


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
            "seeds_are_instants": TABLES[name].kind == REAL,
            "shapes": [list(shape) for shape in dict.fromkeys(case.shape for case in cases)],
            "frames": list(dict.fromkeys(case.frames for case in cases)),
            "data": sorted({case.folder for case in cases if case.folder}),
        },
        "missing": missing,
        "parameters": sizes,
        "groups": groups(records),
        "scenes": [record.model_dump() for record in records],
    }
