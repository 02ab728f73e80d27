"""A task before a spike camera, with episodes that have numbers: training's and test's are never the same."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from spikecam_env.checked import checked_shape
from spikecam_env.envs.aiming import AimingEnv
from spikecam_env.envs.episode import Episode
from spikecam_env.envs.keywords import check_settled
from spikecam_env.envs.own_length import OwnLength
from spikecam_env.envs.reset_options import Rule, checked_options
from spikecam_env.envs.tasks import TASKS
from spikecam_env.envs.tasks.base import CameraUnits, Task
from spikecam_env.envs.tasks.splits import checked_split, drawn_number, episode_generator
from spikecam_env.envs.tasks.things import TEST_PICTURES, TRAIN_PICTURES
from spikecam_env.errors import InputError, shown, unknown_name

PICTURES = {"train": TRAIN_PICTURES, "test": TEST_PICTURES}
"""Split -> numbers of its textures."""


class TaskEnv(OwnLength, AimingEnv):
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
        self.split = checked_split(split)
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

    def _draw(self, rng: np.random.Generator, options: dict[str, Any]) -> Episode:
        rules: dict[str, Rule] = {"split": checked_split, "episode": lambda value, name: value}
        given = checked_options(options, rules)
        split = given.get("split", self.split)
        number = drawn_number(rng, split, given)
        episode = self.task.draw(episode_generator(split, number, self.task.stream), self._view_of(split))
        return replace(episode, number=number)

    def _view_of(self, split: str) -> CameraUnits:
        return CameraUnits(self.shape, self.model.frame_rate_hz, self.frames_per_step, PICTURES[split])

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
