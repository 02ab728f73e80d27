"""How well agents learn: every task, by the observation and by the light, over seeds.

A cell is a task, a sight and a light.  Its result follows from the cell, the seed and the steps of training.  Results
are lines of a record, so that a study goes on where it was stopped.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeVar

import gymnasium
import numpy as np
from pydantic import Field
from tqdm import tqdm

from spikecam_env.agents.agent import Agent, shipped
from spikecam_env.agents.playing import Actor, episodes_along, episodes_of, score_of
from spikecam_env.agents.ppo import PPO
from spikecam_env.agents.tracker import Tracker
from spikecam_env.agents.training import SIGHTS, Study, agents_along, learner, train_agent
from spikecam_env.checked import checked_count, checked_number
from spikecam_env.envs.tasks import TASKS
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.pool import spread
from spikecam_env.run_folder import run_folder
from spikecam_env.torch_settings import torch_settings
from spikecam_env.untrusted import Count, Declared, Name, Positive, Seed, Side, Whole, declared, parse_json, read_text
from spikecam_env.whole import write_text_whole

T = TypeVar("T")
R = TypeVar("R")

SEEN = {"": "tfp", "-rate": "rate", "-clean": "clean"}
READY = {f"{who}{ending}": sight for who in ("tracker", "shipped") for ending, sight in SEEN.items()}
"""Players that learn nothing -> observation: the classical tracker, and the shipped agent, trained on `tfp`."""


class StudyRun(Declared):
    """A cell and a seed."""

    task: Name
    """An id."""
    sight: Name
    """A name of `training.SIGHTS`, or of READY."""
    interval: Positive | None = None
    """Mean interval of a pixel in the test episodes [frames]; None is the task's own light."""
    trained: Annotated[tuple[Positive, Positive], Field(strict=False)] | None = None
    """Shortest and longest interval in training [frames]; None is that of the test."""
    shape: Annotated[tuple[Side, Side], Field(strict=False)] | None = None
    """(rows, columns) of the camera; None is the id's."""
    imitate: bool = False
    """Whether the oracle is imitated (`agents.ppo`)."""
    seed: Seed = 0
    steps: Whole = 0
    """Steps of training; 0 of READY."""
    episodes: Count | None = None
    """Episodes of the test split that judge; None is `playing.episodes_of` the task."""

    @property
    def cell(self) -> StudyRun:
        """Without the seed."""
        return self.model_copy(update={"seed": 0})

    @property
    def played(self) -> Study:
        """The problem of the test episodes."""
        return self._under(self._light)

    @property
    def learned(self) -> Study:
        """The problem of the learner."""
        return self._under(self.trained or self._light)

    @property
    def folder(self) -> str:
        """Where its training is kept; cases that are played alone differently have it in common."""
        marks = [self.task, *(f"{size}" for size in self.shape or ())]
        marks += [f"{interval:g}" for interval in dict.fromkeys(self.trained or self._light or ())]
        marks += [self.sight, *["imitating"] * self.imitate, *[f"{self.steps}steps"] * (self.steps > 0)]
        return "-".join([*marks, str(self.seed)])

    @property
    def _light(self) -> tuple[float, float] | None:
        return None if self.interval is None else (self.interval, self.interval)

    def _under(self, light: tuple[float, float] | None) -> Study:
        study = Study(self.task, READY.get(self.sight, self.sight))
        task = {} if light is None else {"task": TASKS[study.name](mean_interval=light)}
        shape = {} if self.shape is None else {"shape": self.shape}
        return replace(study, options=task | shape)


class Result(Declared):
    """The score of a run of a study."""

    case: StudyRun
    score: Annotated[float, Field(ge=-100, le=100)]
    """Score on the test split."""
    cpu_s: Annotated[float, Field(ge=0)] = 0.0
    """Processor time of training [s]."""
    curve: Annotated[tuple[dict[Name, float], ...], Field(strict=False)] = ()
    """Rows as of `training`."""
    along: Annotated[tuple[dict[Name, float], ...], Field(strict=False)] = ()
    """Steps and score of the agents on the way, on the first test episodes (`playing.episodes_along`)."""


POINTS = 12
"""Of a learning curve, evenly over its steps: of the 48 updates of a training by default, every fourth."""


def cases(
    tasks: Sequence[str],
    sights: Sequence[str],
    intervals: Sequence[float],
    seeds: Iterable[int],
    steps: Sequence[int] = (),
    episodes: int | None = None,
    *,
    trained: tuple[float, float] | None = None,
    shape: tuple[int, int] | None = None,
    imitate: bool = False,
) -> list[StudyRun]:
    """Every cell with every seed, all cells of the first seed first.

    Args:
        tasks: ids.
        sights: names of SIGHTS or READY.
        intervals: mean intervals at which each task is played [frames]; none is its own light.
        seeds: of training.
        steps: lengths of training, each a cell; none is that of `PPO`.
        episodes: of the test split; None is `playing.episodes_of` the task.
        trained: shortest and longest interval in training [frames]; None is the interval of the test.
        shape: (rows, columns) of the camera; None is the id's.
        imitate: learn from the oracle (`agents.ppo`).

    Raises:
        InputError: for an unknown task, sight or shipped agent, and for steps and intervals out of range.
    """
    for task in tasks:
        Study(task)  # refuses unknown names
    for sight in sights:
        if sight not in (*SIGHTS, *READY):
            raise unknown_name("observation", sight, (*SIGHTS, *READY))
    for length in steps:
        checked_count(length, "steps")
    for interval in (*intervals, *(trained or ())):
        checked_number(interval, "interval", 1.0, unit="frames")
    if trained is not None and trained[0] > trained[1]:
        raise InputError(f"intervals of training are {trained}; give the shortest, then the longest")
    runs = [
        StudyRun(task=task, sight=sight, interval=interval, shape=shape, seed=seed, episodes=episodes)
        if sight in READY
        else StudyRun(
            task=task,
            sight=sight,
            interval=interval,
            trained=trained,
            shape=shape,
            imitate=imitate,
            seed=seed,
            steps=length,
            episodes=episodes,
        )
        for seed in seeds
        for task in tasks
        for sight in sights
        for length in ((0,) if sight in READY else steps or (PPO.steps,))
        for interval in (intervals or (None,))
    ]
    for case in runs:
        if case.sight.startswith("shipped") and case.task not in shipped():
            raise unknown_name("agent", case.task, shipped())
    return runs


def measure(cases: Sequence[StudyRun], out: Path, points: int = POINTS) -> list[Result]:
    """Results of cases with one training: train, unless nothing is to be learned, and play the test episodes of each.

    Args:
        cases: that differ in their test episodes alone.
        out: folder in which the run is kept.
        points: agents on the way that are played too.
    """
    curve = _curve(cases[0], out, points)
    return [_played(case, curve, out) for case in cases]


def _curve(case: StudyRun, out: Path, points: int) -> tuple[dict[str, float], ...]:
    """The curve of its training, which is done first or completed."""
    if case.sight in READY:
        return ()
    ppo = learner(case.steps, imitate=case.imitate)
    return tuple(train_agent(case.learned, out / case.folder, ppo, case.seed, points=points).training["curve"])


def _played(case: StudyRun, curve: tuple[dict[str, float], ...], out: Path) -> Result:
    episodes = case.episodes or episodes_of(case.task)
    with (
        closing(case.played.make(split="test")) as env,
        torch_settings(threads=1),  # more pay for no network here, and where others work too they wait for each other
    ):
        score = score_of(actor_of(case, out, env), env, episodes)
        along = _along(case, env, episodes_along(episodes), out)
    return Result(case=case, score=score, cpu_s=curve[-1]["cpu_s"] if curve else 0.0, curve=curve, along=along)


def _along(case: StudyRun, env: gymnasium.Env[Any, Any], episodes: int, out: Path) -> tuple[dict[str, float], ...]:
    """Of a case whose agent was trained: the score of the agents on the way."""
    if case.sight in READY:
        return ()
    agents = agents_along(out / case.folder)
    return tuple({"steps": steps, "score": score_of(Agent.load(path), env, episodes)} for steps, path in agents.items())


def actor_of(case: StudyRun, out: Path, env: gymnasium.Env[Any, Any]) -> Actor:
    """The player of a case: the tracker, the shipped agent, or the one whose training is kept in `out`."""
    inner: Any = env.unwrapped
    if case.sight.startswith("tracker"):
        return Tracker(inner)
    return Agent.load(case.task if case.sight in READY else out / case.folder / "agent.pt")


def study(
    wanted: Sequence[StudyRun], out: Path, *, points: int = POINTS, jobs: int = 1, ray: str | None = None
) -> list[Result]:
    """Measure the cases that the record in a folder lacks, and add each to it when it is done.

    Args:
        wanted: the cases.
        out: the folder, made if needed, for the record and every run.
        points: agents on the way that are played too, for learning curves.
        jobs: processes that work at the same time.
        ray: address of a Ray cluster that works instead, or "local".

    Returns:
        A result for each of `wanted`.

    Raises:
        InputError: where another run is at work in `out`, its record is damaged, or there is no such cluster.
    """
    with run_folder(out, "a study"):
        known = {result.case: result for result in read_record(out / RECORD)}
        missing: dict[str, list[StudyRun]] = {}
        for case in wanted:
            if case not in known:
                missing.setdefault(case.folder, []).append(case)
        runs = spread(partial(measure, out=out, points=points), missing.values(), jobs, ray)
        for results in tqdm(runs, total=len(missing), desc="agents", unit="run", disable=None):
            known |= {result.case: result for result in results}
            lines = "".join(result.model_dump_json() + "\n" for result in known.values())
            write_text_whole(out / RECORD, lines)
        return [known[case] for case in wanted]


RECORD = "record.jsonl"


def read_record(path: Path) -> list[Result]:
    """Lines of a record; none where there is no file.

    Raises:
        InputError: for anything else in it.
    """
    if not path.exists():
        return []
    lines = enumerate(read_text(path).splitlines(), 1)
    return [declared(Result, parse_json(line, f"{path} line {n}"), f"{path} line {n}") for n, line in lines]


def summary(results: Sequence[Result]) -> list[dict[str, Any]]:
    """A row a cell: mean score, its standard deviation over seeds, how many there are, processor minutes a seed."""
    cells: dict[StudyRun, list[Result]] = {}
    for result in results:
        cells.setdefault(result.case.cell, []).append(result)
    return [_row(cell, of_seeds) for cell, of_seeds in cells.items()]


def _row(cell: StudyRun, of_seeds: list[Result]) -> dict[str, Any]:
    scores = np.array([result.score for result in of_seeds])
    return {
        "task": cell.task,
        "sees": cell.sight,
        "interval [frames]": cell.interval,
        "score": float(scores.mean()),
        "sd": float(scores.std(ddof=1)) if len(scores) > 1 else None,
        "seeds": len(scores),
        "steps": cell.steps,
        "cpu [min]": float(np.mean([result.cpu_s for result in of_seeds]) / 60),
        "learned at [frames]": cell.trained and "{:g} to {:g}".format(*cell.trained),
    }
