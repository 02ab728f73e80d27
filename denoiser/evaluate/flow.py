"""Optical flow from streams: the error of OpenCV's DIS between two pictures of a row, and of flows that others found.

    picture at frame t, picture at t + dt  ->  DIS  ->  flow (H, W, 2)     against the true one

Pictures are TFP 21 and 41 of a row's spikes, and its rate planes.  dt is 10 and 20 frames, and t goes on by dt, as
SCFlow's windows do (`spikecam_env.datasets.scflow`).  The error of a pixel is the distance of its end point from the
true one; its mean over all pixels, or over those that move, and over the pairs, is the AEE.

Source of DIS: Kroeger et al., ECCV 2016, as cv2.DISOpticalFlow, preset MEDIUM.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from denoiser.evaluate import phm
from denoiser.evaluate.case import ExposedStreams, Planes, ScoredPictures, StreamCase
from denoiser.evaluate.flow_page import save_flow, write_flow_page
from denoiser.evaluate.flow_report import MEASURES, STILL, flow_groups, flow_report
from denoiser.evaluate.judge import plain
from denoiser.evaluate.rows import ROWS, RowStreams, why_not
from denoiser.evaluate.tables import Table, TableRequest, cases_of, check_memory, rows_of, settings_of
from denoiser.evaluate.work import Kind, WorkItem, evaluated, results_in
from scenes.derived.faster import MOVES
from scenes.film.found_motion import LEAST_SIDE, dis_flow
from spikecam_env.datasets.export import true_flows
from spikecam_env.datasets.scflow import INTERVALS, first_frames, flow_file, read_flo
from spikecam_env.errors import InputError
from spikecam_env.names import distinct
from spikecam_env.streams import middleTFP
from spikecam_env.types import Pictures
from spikecam_env.whole import made_folder

WINDOWS = (21, 41)
"""Frames of the pictures of spikes (TFP)."""
PLANE = "rate plane"
"""Name of the picture that is a rate plane."""
WHITE = 99.8
"""Percentile of the first picture that is white to DIS; all above it is cut."""
DRAWN = INTERVALS[-1]
"""Flows over so many frames are drawn, of the pair in the middle."""
ENTERED = "flow"
"""Name of the picture of a row that another program found."""
METHODS = ("noisy", "fast", "best", "best-bright", "clean")


@dataclass(frozen=True)
class ExposedFlow(ExposedStreams):
    """A case's streams and the true flows (H, W, 2) [pixels] by their frames, from each pair's first frame."""

    true: Mapping[int, Sequence[Pictures]] = field(default_factory=dict)


def evaluate_flow(
    request: TableRequest | None = None, flows: Sequence[Path] = (), *, progress: bool = False
) -> dict[str, Any]:
    """Measure the error of optical flow by row and scene; `flow_report.flow_report` shows the result as text.

    Args:
        request: scenes, cameras, light, rows and place of the results; default the ten scenes of PHM_N.
        flows: folders of .flo files that another program found, named and numbered as the truth of `spikecam export
            --layout scflow` is; each is a row under its folder's name.
        progress: shows a bar.

    Returns:
        title, rows, settings, missing (why rows are missing), groups (see `flow_groups`), scenes (every record).

    Raises:
        InputError: as of `evaluate_table`; recordings too short for a pair, pictures too small for DIS, flows of more
            than one group of cases, and files that are no flows of the right size.
    """
    request = request or TableRequest()
    rows = rows_of(FLOW_TABLE, request)
    request.weights.check()
    cases, _ = cases_of(FLOW_TABLE, request)
    check_memory(cases)
    _check(cases, rows, flows)
    missing = {row: why for row in rows if (why := why_not(ROWS[row].source, request.weights))}
    here = [row for row in rows if row not in missing]
    with results_in(request.out, "flow", settings_of(request), ScoredPictures) as results:
        folder = nullcontext() if request.out is None else made_folder(request.out / "flows", "pictures")
        with folder as pictures:
            records = evaluated(
                FLOW, cases, here, request.weights, results, jobs=request.jobs, pictures=pictures, progress=progress
            )
            for found in flows:
                records += [_entered(case, found, pictures) for case in cases]
        result = {
            "title": FLOW_TABLE.title,
            "rows": [*rows, *map(_row_of, flows)],
            "settings": {
                "shapes": [list(shape) for shape in dict.fromkeys(case.shape for case in cases)],
                "frames": list(dict.fromkeys(case.frames for case in cases)),
                "pan": [list(pan) for pan in dict.fromkeys(case.pan for case in cases)],
                "pairs": {str(dt): len(first_frames(cases[0].frames, dt)) for dt in INTERVALS},
            },
            "missing": missing,
            "groups": flow_groups(records),
            "scenes": [record.model_dump() for record in records],
        }
        results.write(result, flow_report(result))
        if pictures is not None:
            write_flow_page(pictures.parent / "flow.png", pictures, cases, records, DRAWN)
    return result


def dis(first: Planes, second: Planes) -> Pictures:
    """(H, W, 2) flow [pixels] from one picture (H, W) to another of the same light, by OpenCV's DIS.

    Example:
        >>> picture = np.add.outer(np.sin(np.arange(40) / 3), np.cos(np.arange(60) / 4)).astype(np.float32) + 2
        >>> flow = dis(picture, np.roll(picture, 2, axis=1))
        >>> np.median(flow[10:30, 10:50], axis=(0, 1)).round(1).tolist()
        [2.0, 0.0]
    """
    white = float(np.percentile(first, WHITE)) or float(first.max()) or 1.0
    return dis_flow(*(np.rint(np.clip(picture / white, 0, 1) * 255).astype(np.uint8) for picture in (first, second)))


def end_point_errors(found: Pictures, true: Pictures, frames: int) -> dict[str, float | None]:
    """`MEASURES` of a flow (H, W, 2) over so many frames: mean distance from the true end points [pixels].

    Example:
        >>> true = np.zeros((2, 2, 2))
        >>> true[0] = 3.0, 4.0
        >>> end_point_errors(np.zeros((2, 2, 2)), true, 10)
        {'all': 2.5, 'moving': 5.0}
    """
    errors = np.linalg.norm(np.asarray(found, np.float64) - true, axis=-1)
    moving = np.linalg.norm(true, axis=-1) > MOVES * frames
    return {"all": float(errors.mean()), "moving": float(errors[moving].mean()) if moving.any() else None}


def named(picture: str, frames: int) -> str:
    """Name of a picture's score in a record: `TFP 21, 10`."""
    return f"{picture}, {frames}"


def _expose(case: StreamCase) -> ExposedFlow:
    """All pairs are judged, from the first picture's first frame on."""
    scene, noisy, clean = phm.scene_and_streams(case, case.frames)
    last = max(starts[-1] + dt for dt in INTERVALS if (starts := first_frames(case.frames, dt)))
    reach = max(WINDOWS) // 2
    first, stop = first_frames(case.frames, INTERVALS[0])[0] - reach, last + reach + 1
    true = {dt: true_flows(scene, case.frames, dt) for dt in INTERVALS}
    return ExposedFlow(noisy, clean, None, first, stop, (first + stop) // 2, 1.0, true)


@lru_cache(maxsize=16)
def _true(case: StreamCase, frames: int) -> Sequence[Pictures]:
    return true_flows(phm.scene_of(case), case.frames, frames)


def _judged(item: WorkItem[ScoredPictures], made: RowStreams, exposed: ExposedStreams) -> dict[str, Any]:
    """The mean errors of all pairs, of pictures of the spikes and of the rate planes."""
    assert isinstance(exposed, ExposedFlow)
    scores: dict[str, dict[str, float | None]] = {}
    for dt, true in exposed.true.items():
        frames = first_frames(item.case.frames, dt)
        for picture in _pictures_of(made):
            found = [
                dis(*(_picture(made, picture, t - exposed.first) for t in (frame, frame + dt))) for frame in frames
            ]
            scores[named(picture, dt)] = _mean_errors(found, true, dt)
            if item.pictures is not None and dt == DRAWN:
                save_flow(item.pictures, item.case, made.row, picture, found[len(found) // 2], true[len(true) // 2])
        if made.row == "noisy":
            scores[named(STILL, dt)] = _mean_errors([np.zeros_like(flow) for flow in true], true, dt)
    return {"pictures": scores}


FLOW = Kind(ScoredPictures, _expose, _judged)
FLOW_TABLE = Table("Optical flow: mean end-point error [pixels], all pixels and those that move", FLOW, METHODS)


def _pictures_of(made: RowStreams) -> list[str]:
    planes = [] if made.planes is None else [PLANE]
    return [*(f"TFP {window}" for window in WINDOWS), *planes]


def _picture(made: RowStreams, picture: str, at: int) -> Planes:
    """The picture of a judged frame."""
    if picture == PLANE and made.planes is not None:
        plane: Planes = made.planes[at]
        return plane
    return middleTFP(made.spikes, at, int(picture.removeprefix("TFP ")))


def _mean_errors(found: Sequence[Pictures], true: Sequence[Pictures], dt: int) -> dict[str, float | None]:
    """Means over the pairs; of moving pixels over the pairs in which something moves."""
    errors = [end_point_errors(flow, its, dt) for flow, its in zip(found, true, strict=True)]
    known = {name: [e for error in errors if (e := error[name]) is not None] for name in MEASURES}
    return {name: plain(float(np.mean(values))) if values else None for name, values in known.items()}


def _entered(case: StreamCase, folder: Path, pictures: Path | None) -> ScoredPictures:
    """The record of a case whose flows are files of another program."""
    scores: dict[str, dict[str, float | None]] = {}
    for dt, found in _flows_in(folder, case).items():
        true = _true(case, dt)
        scores[named(ENTERED, dt)] = _mean_errors(found, true, dt)
        if pictures is not None and dt == DRAWN:
            save_flow(pictures, case, _row_of(folder), ENTERED, found[len(found) // 2], true[len(true) // 2])
    of: dict[str, Any] = {name: getattr(case, name) for name in ("scene", "seed", "interval", "speed")}
    return ScoredPictures(**of, row=_row_of(folder), weights={}, pictures=scores)


def _row_of(folder: Path) -> str:
    """Name of the row of a folder of flows: its own, of "." too."""
    return os.path.basename(os.path.abspath(folder)) or "flows"


def _flows_in(folder: Path, case: StreamCase) -> dict[int, list[Pictures]]:
    """Flows of a case by their frames, as another program wrote them; InputError where there are none, or not all."""
    places = {dt: flow_file(folder, case.scene, dt, 0).parent for dt in INTERVALS}
    if not any(place.is_dir() for place in places.values()):
        raise InputError(f"{folder} has no flow of {case.scene}; it needs {' or '.join(map(str, places.values()))}")
    return {
        dt: [
            read_flo(flow_file(folder, case.scene, dt, number), case.shape)
            for number in range(len(first_frames(case.frames, dt)))
        ]
        for dt, place in places.items()
        if place.is_dir()
    }


def _check(cases: Sequence[StreamCase], rows: Sequence[str], flows: Sequence[Path]) -> None:
    """InputError for cases that have no flow, and for flows that could be of more than one group of cases."""
    if not cases:
        raise InputError("no scene to evaluate; name some that the dataset holds with --scenes")
    for case in cases:
        if min(case.shape) < LEAST_SIDE:
            raise InputError(f"pictures of {case.shape[0]} x {case.shape[1]}; DIS needs {LEAST_SIDE} x {LEAST_SIDE}")
        if not all(first_frames(case.frames, dt) for dt in INTERVALS):
            raise InputError(f"{case.scene} has {case.frames} frames; flow over {INTERVALS[-1]} frames needs more")
    distinct((*rows, *map(_row_of, flows)), "row")
    if flows and len({(case.seed, case.interval, case.speed) for case in cases}) > 1:
        raise InputError("--flows are of one camera, interval and speed; give one of --seeds, --intervals and --speeds")
    for found in flows:
        if not found.is_dir():
            raise InputError(f"--flows {found}: there is no such folder")
        for case in cases:
            _flows_in(found, case)
