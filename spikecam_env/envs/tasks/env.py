"""A task before a spike camera, with episodes that have numbers: training's and test's are never the same."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from spikecam_env.checked import checked_shape, checked_whole
from spikecam_env.envs.aiming import AimingEnv
from spikecam_env.envs.episode import Episode
from spikecam_env.envs.tasks import TASKS
from spikecam_env.envs.tasks.base import Task, View
from spikecam_env.envs.tasks.things import TEST_PICTURES, TRAIN_PICTURES
from spikecam_env.errors import unknown_name

SPLITS: dict[str, tuple[range, range]] = {
    "train": (range(1_000_000), TRAIN_PICTURES),
    "test": (range(1_000_000, 1_001_000), TEST_PICTURES),
}
"""Split -> (numbers of its episodes, numbers of its textures).  An episode follows from its number."""


class TaskEnv(AimingEnv):
    """Plays a task; observation, reward, end and info as of `AimingEnv`.

    task               a name of `tasks.TASKS`, or a `Task`, e.g. `LowLight(mean_interval=(50, 50))`
    shape              (rows, columns)
    split              "train" or "test", of the episodes that `reset` draws
    reward             "progress" or "distance"
    frames_per_step    default the task's
    camera             keywords of `AimingEnv` and `SpikeCameraEnv`

    Options of reset: split, as above, for this episode; episode, its number, instead of one drawn from the split.
    The camera's unit and noise follow from the seed, not from the number.
    Info: episode_number; `episode` would be in the way of wrappers and learners, which keep statistics under that name.

    >>> env = TaskEnv("Track", shape=(32, 32), split="test")
    >>> spikes, info = env.reset(seed=0, options={"episode": 3})
    >>> spikes.shape, info["episode_number"]
    ((40, 32, 32), 3)
    """

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
        self.task = _task(task)
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

    def _draw(self, rng: np.random.Generator, options: dict[str, Any]) -> Episode:
        for name in options:
            if name not in ("split", "episode"):
                raise unknown_name("option of reset", name, ("split", "episode"))
        numbers, pictures = SPLITS[_split(options.get("split", self.split))]
        drawn = int(rng.integers(numbers.start, numbers.stop))
        number = checked_whole(options.get("episode", drawn), "episode", 0, SPLITS["test"][0].stop - 1)
        if "episode" in options:
            pictures = next(pictures for numbers, pictures in SPLITS.values() if number in numbers)
        view = View(self.shape, self.model.frame_rate_hz, self.frames_per_step, pictures)
        episode = self.task.draw(np.random.default_rng([number, self.task.stream]), view)
        return replace(episode, number=number)

    def _of_standing(self) -> dict[str, Any]:
        return super()._of_standing() | {"episode_number": self.episode.number}


def _task(task: str | Task) -> Task:
    if isinstance(task, Task):
        return task
    if task not in TASKS:
        raise unknown_name("task", task, TASKS)
    return TASKS[task]()


def _split(split: str) -> str:
    if split not in SPLITS:
        raise unknown_name("split", split, SPLITS)
    return split
