"""How well agents learn: every task, by the observation, the learner, the light and the level, over seeds.

A cell is a task, a sight, a learner, a light and a level.  Its result follows from the cell, the seed
and the steps of training.  Results are lines of a record, so that a study goes on where it was stopped.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeVar

import gymnasium
import numpy as np
from pydantic import Field
from tqdm import tqdm

from spikecam_env.agents import learner_sb3
from spikecam_env.agents.agent import Agent, shipped
from spikecam_env.agents.controllers import CONTROLLERS, check_reads, classical
from spikecam_env.agents.evaluation import stacked
from spikecam_env.agents.playing import episodes_along, episodes_of, judged, policy_of, score_of
from spikecam_env.agents.ppo import PPO
from spikecam_env.agents.training import SIGHTS, Study, agents_along, learner, train_agent
from spikecam_env.checked import checked_count, checked_number
from spikecam_env.envs.mujoco_tasks import MUJOCO_TASKS
from spikecam_env.envs.mujoco_tasks.task import checked_levels
from spikecam_env.envs.score import BASELINES, Policy
from spikecam_env.envs.tasks import TASKS
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.pool import spread
from spikecam_env.run_folder import run_folder
from spikecam_env.torch_settings import torch_settings
from spikecam_env.untrusted import Count, Declared, Name, Positive, Seed, Side, Whole, declared, parse_json, read_text
from spikecam_env.whole import write_text_whole

T = TypeVar("T")
R = TypeVar("R")

CLASSICAL = ("classical", "tracker")
"""Names of the task's classical player; the second is the older one."""
READY = dict.fromkeys((*CLASSICAL, "shipped"), "tfp")
READY |= {f"shipped-{sight}": sight for sight in ("rate", "clean")}
READY |= {f"{who}-{sight}": sight for who in CLASSICAL for sight in SIGHTS if sight != "tfp"}
READY |= dict.fromkeys(BASELINES, "tfp")
"""Players that learn nothing -> observation: the classical player through each camera, the shipped agent, trained on
`tfp`, and baselines, which look at no picture."""
LEARNERS = ("ppo", "sb3")
"""Our learner (`agents.ppo`), and that of stable-baselines3 with its defaults for pictures (`agents.learner_sb3`)."""


Level = Annotated[int, Field(ge=1, le=5)]


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
    level: Level | None = None
    """Of a MuJoCo task in the test episodes; None is the middle one."""
    trained_levels: Annotated[tuple[Level, Level], Field(strict=False)] | None = None
    """Lowest and highest level in training; None is that of the test."""
    shape: Annotated[tuple[Side, Side], Field(strict=False)] | None = None
    """(rows, columns) of the camera; None is the id's."""
    learner: Name = LEARNERS[0]
    """One of LEARNERS."""
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
        return self._under(self._light, self._levels)

    @property
    def learned(self) -> Study:
        """The problem of the learner."""
        return self._under(self.trained or self._light, self.trained_levels or self._levels)

    @property
    def folder(self) -> str:
        """Where its training is kept; cases that are played alone differently have it in common."""
        marks = [self.task, *(f"{size}" for size in self.shape or ())]
        marks += [f"{interval:g}" for interval in dict.fromkeys(self.trained or self._light or ())]
        if levels := self.trained_levels or self._levels:
            marks += [f"level{levels[0]}to{levels[1]}"]
        marks += [self.sight, *[self.learner] * (self.learner != LEARNERS[0]), *["imitating"] * self.imitate]
        marks += [f"{self.steps}steps"] * (self.steps > 0)
        return "-".join([*marks, str(self.seed)])

    @property
    def _light(self) -> tuple[float, float] | None:
        return None if self.interval is None else (self.interval, self.interval)

    @property
    def _levels(self) -> tuple[int, int] | None:
        return None if self.level is None else (self.level, self.level)

    def _under(self, light: tuple[float, float] | None, levels: tuple[int, int] | None) -> Study:
        options: dict[str, Any] = {} if self.shape is None else {"shape": self.shape}
        if levels is not None:
            options["level"] = levels
        name = Study(self.task).name
        if light is not None and name in MUJOCO_TASKS:
            options["mean_interval"] = light[0]
        elif light is not None:
            options["task"] = TASKS[name](mean_interval=light)
        return Study(self.task, READY.get(self.sight, self.sight), options, state=self.learner != "sb3")


class Result(Declared):
    """The score of a run of a study."""

    case: StudyRun
    score: Annotated[float, Field(ge=-100, le=100)]
    """Score on the test split."""
    success: Annotated[float, Field(ge=0, le=1)] | None = None
    """Share of test episodes that end in success; None in older records."""
    camera_bits_s: Annotated[float, Field(ge=0)] | None = None
    """What the camera sent in the test episodes [bits/s]; None in older records."""
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
    levels: Sequence[int] = (),
    trained_levels: tuple[int, int] | None = None,
    shape: tuple[int, int] | None = None,
    learners: Sequence[str] = LEARNERS[:1],
    imitate: bool = False,
) -> list[StudyRun]:
    """Every cell with every seed, all cells of the first seed first; who learns nothing plays once.

    Args:
        tasks: ids.
        sights: names of SIGHTS or READY.
        intervals: mean intervals at which each task is played [frames]; none is its own light.
        seeds: of training.
        steps: lengths of training, each a cell; none is that of `PPO`.
        episodes: of the test split; None is `playing.episodes_of` the task.
        trained: shortest and longest interval in training [frames]; None is the interval of the test.
        levels: at which each task is played, of MuJoCo tasks; none is the middle one.
        trained_levels: lowest and highest level in training; None is the level of the test.
        shape: (rows, columns) of the camera; None is the id's.
        learners: names of LEARNERS, each with every sight.
        imitate: our learner learns from the oracle (`agents.ppo`).

    Raises:
        InputError: for an unknown task, sight, learner or shipped agent, for steps, intervals and levels out of range,
            and for levels of tasks that have none.
    """
    for sight in sights:
        if sight not in (*SIGHTS, *READY):
            through = {f"{who}-{seen}": f"{who}-OBS" for who in CLASSICAL for seen in SIGHTS}
            raise unknown_name("observation", sight, {through.get(name, name) for name in (*SIGHTS, *READY)})
    for task in tasks:
        _check_task(Study(task), sights, bool(levels or trained_levels), trained)
    for each in (*levels, *([trained_levels] if trained_levels else [])):
        checked_levels(each)
    for name in learners:
        if name not in LEARNERS:
            raise unknown_name("learner", name, LEARNERS)
    if "sb3" in learners:
        learner_sb3.check_sb3()
    for length in steps:
        checked_count(length, "steps")
    for interval in (*intervals, *(trained or ())):
        checked_number(interval, "interval", 1.0, unit="frames")
    if trained is not None and trained[0] > trained[1]:
        raise InputError(f"intervals of training are {trained}; give the shortest, then the longest")
    played = [
        StudyRun(task=task, sight=sight, interval=interval, level=level, shape=shape, seed=seed, episodes=episodes)
        for seed in seeds
        for task in tasks
        for sight in sights
        for interval in (intervals or (None,))
        for level in (levels or (None,))
    ]
    runs: list[StudyRun] = []
    for case in played:
        if case.sight in READY:
            runs += [case] * (case.seed == played[0].seed)
            continue
        for who in learners:
            own: dict[str, Any] = {"trained": trained, "trained_levels": trained_levels, "learner": who}
            own |= {"imitate": imitate and who == LEARNERS[0]}
            runs += [case.model_copy(update={**own, "steps": length}) for length in steps or (PPO.steps,)]
    return runs


def _check_task(study: Study, sights: Sequence[str], has_levels: bool, trained: tuple[float, float] | None) -> None:
    """Raise InputError for a task that is not to be had as asked for."""
    is_mujoco = study.name in MUJOCO_TASKS
    if has_levels and not is_mujoco:
        raise InputError(f"{study.task} has no levels, MuJoCo tasks have: {', '.join(MUJOCO_TASKS)}; leave levels out")
    if trained is not None and is_mujoco:
        raise InputError(f"{study.task} is learned at one mean interval; leave --trained out")
    players = {sight.partition("-")[0] for sight in sights}
    if "shipped" in players and study.task not in shipped():
        raise unknown_name("agent", study.task, shipped())
    if players & {*CLASSICAL} and study.name not in CONTROLLERS:
        raise unknown_name("task of a classical controller", study.name, CONTROLLERS)
    for sight in sights:
        if sight.partition("-")[0] in CLASSICAL:
            check_reads(study.name, SIGHTS[READY[sight]]["obs"])


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
    if case.learner == "sb3":
        return learner_sb3.train_sb3(case.learned, out / case.folder, case.steps, case.seed)
    ppo = learner(case.steps, imitate=case.imitate)
    return tuple(train_agent(case.learned, out / case.folder, ppo, case.seed, points=points).training["curve"])


def _played(case: StudyRun, curve: tuple[dict[str, float], ...], out: Path) -> Result:
    episodes = case.episodes or episodes_of(case.task)
    with (
        closing(environment_of(case, split="test")) as env,
        torch_settings(threads=1),  # more pay for no network here, and where others work too they wait for each other
    ):
        reached = judged(player_of(case, out, env), env, range(episodes))
        along = _along(case, env, episodes_along(episodes), out)
    return Result(
        case=case,
        score=reached.score,
        success=reached.success,
        camera_bits_s=reached.camera_bits_s,
        cpu_s=curve[-1]["cpu_s"] if curve else 0.0,
        curve=curve,
        along=along,
    )


def _along(case: StudyRun, env: gymnasium.Env[Any, Any], episodes: int, out: Path) -> tuple[dict[str, float], ...]:
    """Of a case whose agent was trained: the score of the agents on the way."""
    if case.sight in READY or case.learner != LEARNERS[0]:
        return ()
    agents = agents_along(out / case.folder)
    return tuple({"steps": steps, "score": score_of(Agent.load(path), env, episodes)} for steps, path in agents.items())


def environment_of(case: StudyRun, **options: Any) -> gymnasium.Env[Any, Any]:
    """The environment of a case's test, as its player sees it.

    Args:
        case: of the study.
        options: further keywords of the environment, e.g. split="test".

    Example:
        >>> env = environment_of(StudyRun(task="Catch-v1", sight="tfp", learner="sb3"), split="test")
        >>> env.observation_space.shape
        (4, 64, 64)
    """
    return stacked(case.played.make(**options), learner_sb3.STACK if case.learner == "sb3" else 1)


def player_of(case: StudyRun, out: Path, env: gymnasium.Env[Any, Any]) -> Policy:
    """The player of a case: a baseline, the classical one, the shipped agent, or the one whose training is in `out`.

    Args:
        case: of the study.
        out: folder of the study.
        env: of `environment_of` the case.

    Example:
        >>> case = StudyRun(task="Catch-v1", sight="oracle")
        >>> env = environment_of(case, split="test")
        >>> observation, info = env.reset(seed=0)
        >>> player_of(case, Path(), env)(observation, env.unwrapped).shape
        (1,)
    """
    who, folder = case.sight.partition("-")[0], out / case.folder
    if who in BASELINES:
        return BASELINES[who]
    if who in CLASSICAL:
        return policy_of(classical(env))[0]
    if case.learner == "sb3":
        return policy_of(learner_sb3.load_sb3(folder))[0]
    return policy_of(Agent.load(case.task if case.sight in READY else folder / "agent.pt"))[0]


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


def by_cell(results: Iterable[Result]) -> dict[StudyRun, list[Result]]:
    """The results of every cell, one a seed.

    Example:
        >>> runs = [Result(case=StudyRun(task="Catch-v1", sight="tfp", seed=seed), score=0.5) for seed in (0, 1)]
        >>> [len(its) for its in by_cell(runs).values()]
        [2]
    """
    cells: dict[StudyRun, list[Result]] = {}
    for result in results:
        cells.setdefault(result.case.cell, []).append(result)
    return cells


def summary(results: Sequence[Result]) -> list[dict[str, Any]]:
    """A row a cell: mean score, its standard deviation over seeds, how many there are, processor minutes a seed."""
    rows = [_row(cell, of_seeds) for cell, of_seeds in by_cell(results).items()]
    empty = {name for name in WHERE_KNOWN if all(row[name] is None for row in rows)}
    return [{name: value for name, value in row.items() if name not in empty} for row in rows]


WHERE_KNOWN = ("learner", "level", "success", "camera [Mbit/s]", "learned at [levels]")
"""Columns that are left out where no row has them."""


def mean_known(values: Iterable[float | None]) -> float | None:
    """The mean of those that are known, None where none is.

    Example:
        >>> mean_known([1.0, None, 2.0]), mean_known([None])
        (1.5, None)
    """
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _row(cell: StudyRun, of_seeds: list[Result]) -> dict[str, Any]:
    scores = np.array([result.score for result in of_seeds])
    bits = mean_known(result.camera_bits_s for result in of_seeds)
    return {
        "task": cell.task,
        "sees": cell.sight,
        "learner": None if cell.learner == LEARNERS[0] else cell.learner,
        "interval [frames]": cell.interval,
        "level": cell.level,
        "score": float(scores.mean()),
        "sd": float(scores.std(ddof=1)) if len(scores) > 1 else None,
        "seeds": len(scores),
        "success": mean_known(result.success for result in of_seeds),
        "camera [Mbit/s]": None if bits is None else bits / 1e6,
        "steps": cell.steps,
        "cpu [min]": float(np.mean([result.cpu_s for result in of_seeds]) / 60),
        "learned at [frames]": cell.trained and "{:g} to {:g}".format(*cell.trained),
        "learned at [levels]": cell.trained_levels and "{} to {}".format(*cell.trained_levels),
    }
