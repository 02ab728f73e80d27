"""A task before a spike camera, with episodes that have numbers: training's and test's are never the same."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from gymnasium.envs.registration import EnvSpec

from spikecam_env.checked import checked_shape, checked_whole
from spikecam_env.envs.aiming import AimingEnv
from spikecam_env.envs.episode import Episode
from spikecam_env.envs.keywords import check_settled
from spikecam_env.envs.reset_options import Rule, checked_options
from spikecam_env.envs.tasks import TASKS
from spikecam_env.envs.tasks.base import CameraUnits, Task
from spikecam_env.envs.tasks.things import TEST_PICTURES, TRAIN_PICTURES
from spikecam_env.errors import InputError, shown, unknown_name

SPLITS: dict[str, tuple[range, range]] = {
    "train": (range(1_000_000), TRAIN_PICTURES),
    "test": (range(1_000_000, 1_001_000), TEST_PICTURES),
}
"""Split -> (numbers that its episodes follow from, numbers of its textures).  Users count within a split, from 0."""


class TaskEnv(AimingEnv):
    """Plays a task; reward, end and info as of `AimingEnv`.  The observation is "tfp" where `obs` says nothing else.

    `spec.max_episode_steps` is `most_steps`; the task's time is `Task.duration_s`, whatever `frames_per_step` is.

    Options:
        split, for this episode; episode, its number within the split (train: 0 to 999 999, test: 0 to 999), instead of
        one drawn from the split. The camera's unit and noise follow from the seed, not from the number.
    Info:
        episode_number, which the option `episode` takes (learners keep statistics under the name `episode`).

    Args:
        task: a name of `tasks.TASKS`, or a `Task`, e.g. `LowLight(mean_interval=(50, 50))`.
        shape: (rows, columns).
        split: "train" or "test", of the episodes that `reset` draws.
        reward: "progress" or "distance".
        frames_per_step: default the task's.
        max_gaze_rate_px_s: default the task's.
        camera: keywords of `AimingEnv` and `SpikeCameraEnv`.

    Example:
        >>> env = TaskEnv("Track", shape=(32, 32), split="test")
        >>> picture, info = env.reset(seed=0, options={"episode": 3})
        >>> picture.shape, info["episode_number"], env.most_steps
        ((1, 32, 32), 3, 500)
    """

    usual_obs: ClassVar[str] = "tfp"
    settles: ClassVar[tuple[str, ...]] = ("draw", "rise_s", "axes", "further")
    _spec: EnvSpec | None = None

    def __init__(
        self,
        task: str | Task = "Track",
        *,
        shape: tuple[int, int] = (64, 64),
        split: str = "train",
        reward: str = "progress",
        frames_per_step: int | None = None,
        max_gaze_rate_px_s: float | None = None,
        **camera: Any,
    ) -> None:
        check_settled(type(self), camera)
        self.task = _task(task)
        self.answers = self.task.answers
        self.split = _split(split)
        top = self.task.top_sides_s * min(checked_shape(shape))
        super().__init__(
            self._draw,
            reward=reward,
            rise_s=self.task.rise_s,
            axes=self.task.axes,
            further=self.task.further,
            shape=shape,
            frames_per_step=self.task.frames_per_step if frames_per_step is None else frames_per_step,
            max_gaze_rate_px_s=top if max_gaze_rate_px_s is None else max_gaze_rate_px_s,
            **camera,
        )

    @property
    def most_steps(self) -> int:
        """Steps of an episode at most."""
        return self._view_of(self.split).steps(self.task.duration_s)

    @property
    def spec(self) -> EnvSpec | None:
        """Specification by `gymnasium.make`, with the task's own number of steps, which learners need."""
        return self._spec

    @spec.setter
    def spec(self, made_of: EnvSpec | None) -> None:
        self._spec = copy(made_of)
        if self._spec is not None:
            self._spec.max_episode_steps = self.most_steps

    def _draw(self, rng: np.random.Generator, options: dict[str, Any]) -> Episode:
        rules: dict[str, Rule] = {"split": lambda value, name: _split(value), "episode": lambda value, name: value}
        given = checked_options(options, rules)
        split = given.get("split", self.split)
        numbers, _ = SPLITS[split]
        drawn = int(rng.integers(numbers.start, numbers.stop))
        number = _within(split, given["episode"]) if "episode" in given else drawn - numbers.start
        rng = np.random.default_rng([numbers.start + number, self.task.stream])
        return replace(self.task.draw(rng, self._view_of(split)), number=number)

    def _view_of(self, split: str) -> CameraUnits:
        return CameraUnits(self.shape, self.model.frame_rate_hz, self.frames_per_step, SPLITS[split][1])

    def _of_standing(self) -> dict[str, Any]:
        return super()._of_standing() | {"episode_number": self.episode.number}


def _task(task: str | Task) -> Task:
    if isinstance(task, Task):
        return task
    if not isinstance(task, str):
        raise InputError(
            f"task is {shown(task)}; give a name, {', '.join(TASKS)}, or a Task, e.g. Track(duration_s=1.0)"
        )
    if task not in TASKS:
        raise unknown_name("task", task, TASKS)
    return TASKS[task]()


def _split(split: str) -> str:
    if not isinstance(split, str) or split not in SPLITS:
        raise unknown_name("split", split, SPLITS)
    return split


def _within(split: str, number: Any) -> int:
    """A number of an episode that the split has."""
    last = len(SPLITS[split][0]) - 1
    try:
        return checked_whole(number, "episode", 0, last)
    except InputError:
        has = f"the {split} split has episodes 0 to {last}"
        raise InputError(f"episode = {shown(number)}; {has}, and it must be one of them") from None
