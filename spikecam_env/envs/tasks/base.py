"""What a task is: the motor, the time, the action's numbers, and how an episode is drawn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from spikecam_env.envs.episode import Episode


@dataclass(frozen=True)
class View:
    """What a task knows of the camera that plays it: units to turn sides and seconds into pixels and frames.

    pictures  numbers of the textures that this split may show (`tasks.things`)

    >>> view = View((64, 64), 40_000.0, frames_per_step=40, pictures=range(1))
    >>> view.steps(0.5), view.middle
    (500, (31.5, 31.5))
    """

    shape: tuple[int, int]
    frame_rate_hz: float
    frames_per_step: int
    pictures: range

    @property
    def side(self) -> float:
        """The shorter side [pixels]."""
        return float(min(self.shape))

    @property
    def middle(self) -> tuple[float, float]:
        """(x, y) of the picture [pixels]."""
        return (self.shape[1] - 1) / 2, (self.shape[0] - 1) / 2

    def frames(self, seconds: float) -> float:
        """As many frames."""
        return seconds * self.frame_rate_hz

    def steps(self, seconds: float) -> int:
        """As many whole steps, 1 or more."""
        return max(1, round(self.frames(seconds) / self.frames_per_step))

    def speed(self, sides_s: float) -> float:
        """Shorter sides a second in pixels a frame."""
        return sides_s * self.side / self.frame_rate_hz

    def beside_middle(self, rng: np.random.Generator, least: float, most: float) -> tuple[float, float]:
        """(x, y) between so many shorter sides from the middle [pixels]."""
        distance, direction = self.side * rng.uniform(least, most), rng.uniform(0, 2 * np.pi)
        x, y = self.middle
        return float(x + distance * np.cos(direction)), float(y + distance * np.sin(direction))


@dataclass(frozen=True)
class Task:
    """The base of all tasks; a subclass adds its own numbers and `draw`.

    top_sides_s   the gaze's top rate [shorter sides/s]
    rise_s        of the motor, from rest to it [s]
    duration_s    of an episode at most [s]
    success_side  how near to the middle the target counts as looked at [shorter sides]

    frames_per_step  from action to action
    axes             that the camera turns about: pan and tilt, or pan alone
    further          numbers of the action after those
    answers          answers that an action can give: `further` is then 1 (say) and one number an answer
    stream           of random numbers: tasks that begin their draws with the same thing have different ones, so that
                     none is tested on what another is trained on

    >>> from spikecam_env.envs.tasks import TASKS
    >>> view = View((64, 64), 40_000.0, frames_per_step=40, pictures=range(1))
    >>> TASKS["Track"]().draw(np.random.default_rng(0), view).steps
    500
    """

    top_sides_s: float = 10.0
    rise_s: float = 0.01
    duration_s: float = 0.5
    success_side: float = 1 / 8

    frames_per_step: ClassVar[int] = 40
    axes: ClassVar[int] = 2
    further: ClassVar[int] = 0
    answers: ClassVar[int] = 0
    stream: ClassVar[int] = 0

    def draw(self, rng: np.random.Generator, view: View) -> Episode:
        """An episode; everything in it follows from the generator."""
        raise NotImplementedError

    def common(self, view: View) -> dict[str, Any]:
        """What every `Episode` of the task is made with, scene and target apart."""
        return {"success_px": self.success_side * view.side, "steps": view.steps(self.duration_s)}
