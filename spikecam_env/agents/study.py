"""How well agents learn: every task, by what the agent sees and by the light, over seeds.

A cell is a task, a sight and a light.  Its result follows from the cell, the seed and the steps of training.  Results
are lines of a record, so that a study goes on where it was stopped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any, TypeVar

import gymnasium
import numpy as np
from pydantic import Field
from tqdm import tqdm

from spikecam_env.agents.agent import Agent, shipped
from spikecam_env.agents.playing import Actor, episodes_of, score_of
from spikecam_env.agents.ppo import PPO
from spikecam_env.agents.tracker import Tracker
from spikecam_env.agents.training import SIGHTS, Study, train_agent
from spikecam_env.checked import checked_number
from spikecam_env.datasets.ray_cluster import connected
from spikecam_env.envs.tasks.low_light import LowLight
from spikecam_env.errors import unknown_name
from spikecam_env.untrusted import Count, Declared, Name, Positive, Seed, Whole, declared, parse_json, read_text
from spikecam_env.whole import write_text_whole

T = TypeVar("T")
R = TypeVar("R")

SEEN = {"": "tfp", "-rate": "rate", "-clean": "clean"}
READY = {f"{who}{ending}": sight for who in ("tracker", "shipped") for ending, sight in SEEN.items()}
"""Who learns nothing in a study, by what is seen: the classical tracker, and the shipped agent, trained on `tfp`."""


class Case(Declared):
    """A cell and a seed.

    task      an id
    sight     a name of `training.SIGHTS`, or of READY
    interval  mean interval of a pixel [frames], of LowLight alone; None is the task's own light
    steps     of training; 0 of READY
    episodes  of the test split that judge; None is `playing.episodes_of` the task
    """

    task: Name
    sight: Name
    interval: Positive | None = None
    seed: Seed = 0
    steps: Whole = 0
    episodes: Count | None = None

    @property
    def cell(self) -> tuple[str, str, float | None]:
        """Without the seed."""
        return self.task, self.sight, self.interval

    @property
    def study(self) -> Study:
        """What is put before the learner."""
        light = {} if self.interval is None else {"task": LowLight(mean_interval=(self.interval, self.interval))}
        return Study(self.task, READY.get(self.sight, self.sight), light)

    @property
    def folder(self) -> str:
        """Where its training is kept."""
        light = "" if self.interval is None else f"-{self.interval:g}"
        return f"{self.task}{light}-{self.sight}-{self.seed}"


class Result(Declared):
    """score: on the test split; cpu_s: of training [s]; curve: as of `training`."""

    case: Case
    score: Annotated[float, Field(ge=-100, le=100)]
    cpu_s: Annotated[float, Field(ge=0)] = 0.0
    curve: Annotated[tuple[dict[Name, float], ...], Field(strict=False)] = ()


def cases(
    tasks: Sequence[str],
    sights: Sequence[str],
    intervals: Sequence[float],
    seeds: Iterable[int],
    steps: int | None,
    episodes: int | None = None,
) -> list[Case]:
    """Every cell with every seed, all cells of the first seed first; `intervals` are of LowLight."""
    for task in tasks:
        Study(task)  # refuses unknown names
    for sight in sights:
        if sight not in (*SIGHTS, *READY):
            raise unknown_name("observation", sight, (*SIGHTS, *READY))
    for interval in intervals:
        checked_number(interval, "interval", 1.0, unit="frames")
    found = [
        Case(task=task, sight=sight, interval=interval, seed=seed, steps=_steps(sight, steps), episodes=episodes)
        for seed in seeds
        for task in tasks
        for sight in sights
        for interval in (intervals if task.startswith("LowLight") and intervals else (None,))
    ]
    for case in found:
        if case.sight.startswith("shipped") and case.task not in shipped():
            raise unknown_name("agent", case.task, shipped())
    return found


def measure(case: Case, out: Path) -> Result:
    """Train, unless nothing is to be learned, and play the test episodes; out: folder in which its run is kept."""
    curve: tuple[dict[str, float], ...] = ()
    if case.sight not in READY:
        folder = out / case.folder
        folder.mkdir(parents=True, exist_ok=True)
        curve = tuple(train_agent(case.study, folder, PPO(steps=case.steps), case.seed).training["curve"])
    env = case.study.make(split="test")
    try:
        score = score_of(actor_of(case, out, env), env, case.episodes or episodes_of(case.task))
    finally:
        env.close()
    return Result(case=case, score=score, cpu_s=curve[-1]["cpu_s"] if curve else 0.0, curve=curve)


def actor_of(case: Case, out: Path, env: gymnasium.Env[Any, Any]) -> Actor:
    """That plays a case: the tracker, the shipped agent, or the one whose training is kept in `out`."""
    inner: Any = env.unwrapped
    if case.sight.startswith("tracker"):
        return Tracker(inner)
    return Agent.load(case.task if case.sight in READY else out / case.folder / "agent.pt")


def study(wanted: Sequence[Case], out: Path, *, jobs: int = 1, ray: str | None = None) -> list[Result]:
    """What the record in `out` lacks is measured and written to it; the results of `wanted`."""
    known = {result.case: result for result in read_record(out / RECORD)}
    missing = [case for case in wanted if case not in known]
    work = partial(measure, out=out)
    for result in tqdm(spread(work, missing, jobs, ray), total=len(missing), desc="agents", unit="run", disable=None):
        known[result.case] = result
        lines = "".join(result.model_dump_json() + "\n" for result in known.values())
        write_text_whole(out / RECORD, lines)
    return [known[case] for case in wanted]


RECORD = "record.jsonl"


def read_record(path: Path) -> list[Result]:
    """Lines of a record; none where there is no file.  Raises InputError for anything else in it."""
    if not path.exists():
        return []
    lines = enumerate(read_text(path).splitlines(), 1)
    return [declared(Result, parse_json(line, f"{path} line {n}"), f"{path} line {n}") for n, line in lines]


def spread(work: Callable[[T], R], items: Iterable[T], jobs: int, ray: str | None) -> Iterator[R]:
    """Results in any order: of this process, of `jobs` processes, or of a Ray cluster (its address, or "local")."""
    if ray is not None:
        cluster = connected(ray, jobs)
        task = cluster.remote(num_cpus=1)(_done)
        waiting = [task.remote(work, item) for item in items]
        try:
            while waiting:
                done, waiting = cluster.wait(waiting)
                yield cluster.get(done[0])
        finally:
            cluster.shutdown()
    elif jobs == 1:
        yield from map(work, items)
    else:
        with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
            yield from (done.result() for done in as_completed([pool.submit(work, item) for item in items]))


def _done(work: Callable[[T], R], item: T) -> R:
    return work(item)


def summary(results: Sequence[Result]) -> list[dict[str, Any]]:
    """A row a cell: mean score, its standard deviation over seeds, how many there are, processor minutes a seed."""
    cells: dict[tuple[str, str, float | None], list[Result]] = {}
    for result in results:
        cells.setdefault(result.case.cell, []).append(result)
    return [_row(cell, found) for cell, found in cells.items()]


def _row(cell: tuple[str, str, float | None], found: list[Result]) -> dict[str, Any]:
    task, sight, interval = cell
    scores = np.array([result.score for result in found])
    return {
        "task": task,
        "sees": sight,
        "interval [frames]": interval,
        "score": float(scores.mean()),
        "sd": float(scores.std(ddof=1)) if len(scores) > 1 else None,
        "seeds": len(scores),
        "steps": found[0].case.steps,
        "cpu [min]": float(np.mean([result.cpu_s for result in found]) / 60),
    }


def _steps(sight: str, steps: int | None) -> int:
    return 0 if sight in READY else steps or PPO.steps
