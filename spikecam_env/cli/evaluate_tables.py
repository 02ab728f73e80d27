"""`spikecam evaluate table1 | table2 | table3 | table4 | still`: the paper's tables, and scenes at rest."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from spikecam_env.cli.options import Size
from spikecam_env.cli.without_effect import WithoutEffect
from spikecam_env.errors import InputError
from spikecam_env.numbers import Count, Range, WholeRange, Workers

if TYPE_CHECKING:
    from denoiser.evaluate.rows import Weights

MOST_SCENES = 1000
SHORTEST, LONGEST = 1.0, 1e4
"""Mean intervals [frames]; the longest is a spike in a quarter of a second at 40 kHz."""
FASTEST = 100.0
"""Pixels a frame; a picture of 400 is crossed in 4 frames."""


OWN_WEIGHTS = {"paper": "paper", "no_refine": "paper-no-refine", "best": "best"}
"""Name of the weights that an option gives."""


def _has_no_row_of(weights: str, options: TableOptions) -> bool:
    """Whether no row of a table is made with these weights."""
    from denoiser.evaluate.flow import FLOW_TABLE
    from denoiser.evaluate.rows import ROWS, weights_of
    from denoiser.evaluate.tables import TABLES

    rows = options.rows or {**TABLES, "flow": FLOW_TABLE}[options.table].rows
    return all(weights_of(ROWS[row].source) != weights for row in rows if row in ROWS)


@dataclass
class TableOptions:
    """Options of every table."""

    out: Path | None = None
    """Folder for the table as text, JSON and a page of pictures; a run that was stopped goes on in it."""
    rows: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ROW...", help_behavior_hint="(default: the table's)")] = ()
    """Rows to show, of noisy, tfp, ssml, spk2img-clean, spk2img-noisy, baseline-held, baseline-mus, baseline,
    paper-held, paper-mus, paper, fast, best, best-overlap, best-eased, best-map, best-bright, fast-bright, clean,
    light-held, light-mus, light; noisy is always there."""
    weights: Path | None = None
    """Folder whose paper.pt, paper-no-refine.pt, fast.pt, best.pt, spk2img-clean.pt, spk2img-noisy.pt and ssml.pt count
    before the shipped ones."""
    paper: Path | None = None
    """Weights of `paper` to evaluate instead of the shipped ones."""
    no_refine: Path | None = None
    """Weights of `paper` without its refine module, instead of the shipped ones."""
    best: Path | None = None
    """Weights of `best` to evaluate instead of the shipped ones."""
    jobs: Workers = 1
    """Worker processes, one thread each; 1 works in this one, with all threads."""

    without_effect: ClassVar = tuple(
        WithoutEffect((option,), partial(_has_no_row_of, name), f"no row is made with weights of {name}")
        for option, name in OWN_WEIGHTS.items()
    )

    @property
    def table(self) -> str:
        """Its name: `table1`, ..., `still`."""
        return type(self).__name__.lower().removesuffix("scenes")

    def given(self) -> Weights:
        """The files that were given."""
        from denoiser.evaluate.rows import Weights

        given = {name: getattr(self, option) for option, name in OWN_WEIGHTS.items()}
        if self.weights is not None and not self.weights.is_dir():
            raise InputError(f"--weights {self.weights}: there is no such folder")
        return Weights.found(self.weights, {name: path for name, path in given.items() if path is not None})

    def show(self, **options: Any) -> None:
        """Make the table and print it."""
        from denoiser.evaluate.table_report import report
        from denoiser.evaluate.tables import TableRequest, evaluate_table

        request = TableRequest(out=self.out, rows=self.rows, jobs=self.jobs, weights=self.given(), **options)
        print(report(evaluate_table(self.table, request, progress=True)), end="")
        if self.out is not None:
            print(f"wrote {self.table}.txt, {self.table}.json and {self.table}.png in {self.out}")


@dataclass
class OnScenes(TableOptions):
    """A table on PHM_N."""

    scenes: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME...", help_behavior_hint="(default: the ten)")] = ()
    """Other scenes of the catalogue; `spikecam scenes` lists them."""
    size: Size = (250, 400)
    """Rows and columns."""
    seeds: Annotated[int, WholeRange(1, MOST_SCENES)] = 3
    """Cameras before each scene, each with a fixed pattern and noise of its own; their spread is printed."""
    intervals: Annotated[tuple[float, ...], Range(SHORTEST, LONGEST)] = (10.0,)
    """Mean intervals between spikes [frames], each a group of the table; 3 10 40 100 go from bright to dim."""
    speeds: Annotated[tuple[float, ...], Range(0.0, FASTEST)] = (0.0,)
    """Speeds of the motion [pixels a frame], each a group of the table; 0 is the scene's own speed."""
    frames: Count | None = None
    """Frames of each stream, whose middle one is the picture; by default as many as the interval asks for."""
    pan: tuple[float, float] = (0.0, 0.0)
    """Speed of the camera's gaze to the right and down [pixels/frame]; then everything moves."""
    data: Path | None = None
    """Dataset of `spikecam dataset phm-n` to take streams from, instead of simulating them."""

    without_effect: ClassVar = (
        *TableOptions.without_effect,
        WithoutEffect(
            ("size", "seeds", "intervals", "speeds", "frames", "pan"),
            lambda c: c.data is not None,
            "--data has streams of its own",
        ),
    )

    def run(self) -> None:
        from denoiser.evaluate.phm import SCENES

        if self.data is not None:
            self.show(scenes=self.scenes or SCENES, data=self.data)
            return
        self.show(
            scenes=self.scenes or SCENES,
            shape=self.size,
            seeds=self.seeds,
            intervals=self.intervals,
            speeds=self.speeds,
            pan=self.pan,
            frames=self.frames,
        )


@dataclass
class OnRecordings(TableOptions):
    """A table on real recordings."""

    recordings: Path | None = None
    """Folder of the real recordings, with wall.npz and helicopter_low_light.npz."""

    def run(self) -> None:
        self.show(**({} if self.recordings is None else {"real": self.recordings}))


@dataclass
class Table1(OnScenes):
    """The paper's table 1: noisy, the pipelines, both modes and the clean twin, against the true light.

    example:  spikecam evaluate table1 --jobs 2 --out evaluation
    """


@dataclass
class Table2(OnRecordings):
    """The paper's table 2: the same rows on real recordings, by NIQE.

    example:  spikecam evaluate table2 --out evaluation
    """


@dataclass
class Table3(OnScenes):
    """The paper's table 3: `paper` with and without its refine module and its multi-stage update.

    example:  spikecam evaluate table3 --jobs 2 --out evaluation
    """


@dataclass
class Table4(OnRecordings):
    """The paper's table 4: the ablation on real recordings, by NIQE.

    example:  spikecam evaluate table4 --out evaluation
    """


@dataclass
class Flow(OnScenes):
    """Error of optical flow over 10 and 20 frames.

    That of OpenCV's DIS on pictures of noisy, denoised and clean streams, and that of flows of another program.

    example:  spikecam evaluate flow --size 192 320 --seeds 1 --out evaluation
              spikecam evaluate flow --data phm --flows scflow-noisy scflow-best
    """

    seeds: Annotated[int, WholeRange(1, MOST_SCENES)] = 1
    """Cameras before each scene, each with a fixed pattern and noise of its own; their spread is printed."""
    flows: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FOLDER...", help_behavior_hint="(default: none)")] = ()
    """Folders of .flo files of another program, each a row under its folder's name: SCENE/dt=10/motion_vector/0000.flo
    and on, as `spikecam export --layout scflow` numbers the truth."""

    def show(self, **options: Any) -> None:
        from denoiser.evaluate.flow import evaluate_flow
        from denoiser.evaluate.flow_report import flow_report
        from denoiser.evaluate.tables import TableRequest

        request = TableRequest(out=self.out, rows=self.rows, jobs=self.jobs, weights=self.given(), **options)
        print(flow_report(evaluate_flow(request, self.flows, progress=True)), end="")
        if self.out is not None:
            print(f"wrote flow.txt, flow.json and flow.png in {self.out}")


@dataclass
class StillScenes(TableOptions):
    """Scenes in which nothing moves: the mean of 400 frames, with and without a calibration of the camera.

    example:  spikecam evaluate still --out evaluation
    """

    scenes: Annotated[int, WholeRange(1, MOST_SCENES)] = 2
    """Scenes at each of two light levels."""
    size: Size = (96, 96)
    """Rows and columns."""
    seeds: Annotated[int, WholeRange(1, MOST_SCENES)] = 3
    """Cameras before each scene."""
    frames: Count = 400
    """Frames whose mean is judged."""

    def run(self) -> None:
        self.show(still_scenes=self.scenes, shape=self.size, seeds=self.seeds, frames=self.frames)
