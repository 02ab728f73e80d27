"""A task: the motor, the time, the action's numbers, and how an episode is drawn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from scenes.exposure import MOST_INTERVAL, expose
from scenes.flat.discs import Discs
from spikecam_env.checked import checked_numbers
from spikecam_env.envs.episode import Episode
from spikecam_env.errors import InputError
from spikecam_env.renamed import old_names


@dataclass(frozen=True)
class CameraUnits:
    """The camera that plays a task: units that turn sides and seconds into pixels and frames.

    Example:
        >>> view = CameraUnits((64, 64), 40_000.0, frames_per_step=40, pictures=range(1))
        >>> view.steps(0.5), view.middle
        (500, (31.5, 31.5))
    """

    shape: tuple[int, int]
    frame_rate_hz: float
    frames_per_step: int
    pictures: range
    """Numbers of the textures that this split may show (`tasks.things`)."""

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

    Its docstring says Scene, Observation, Action, Reward, End and Success, so that one file describes a task.

    Example:
        >>> from spikecam_env.envs.tasks import TASKS
        >>> view = CameraUnits((64, 64), 40_000.0, frames_per_step=40, pictures=range(1))
        >>> TASKS["Track"]().draw(np.random.default_rng(0), view).steps
        500
    """

    top_sides_s: float = 10.0
    """Top rate of the gaze [shorter sides/s]."""
    rise_s: float = 0.01
    """Time of the motor from rest to the top rate [s]."""
    duration_s: float = 0.5
    """Time of an episode at most [s]."""
    success_side: float = 1 / 8
    """Distance from the middle below which the target counts as looked at [shorter sides]."""
    mean_interval: tuple[float, float] | None = None
    """Shortest and longest mean interval of an episode [frames], drawn evenly in its logarithm; None is the light
    of the textures."""

    frames_per_step: ClassVar[int] = 40
    """Frames from action to action."""
    axes: ClassVar[int] = 2
    """Axes that the camera turns about: pan and tilt, or pan alone."""
    further: ClassVar[int] = 0
    """Numbers of the action after those of the axes."""
    answers: ClassVar[int] = 0
    """Answers that an action can give; `further` is then 1 (say) and one number an answer."""
    stream: ClassVar[int] = 0
    """Stream of random numbers: tasks whose draws begin alike have different ones, so that no task is tested on the
    episodes that another is trained on."""

    def draw(self, rng: np.random.Generator, view: CameraUnits) -> Episode:
        """An episode; everything in it follows from the generator."""
        raise NotImplementedError

    def in_its_light(self, scene: Discs, rng: np.random.Generator) -> Discs:
        """The scene of an episode, exposed to `mean_interval`; the generator is used for that alone."""
        if self.mean_interval is None:
            return scene
        shortest, longest = checked_numbers(self.mean_interval, "mean_interval", 2, 1.0, MOST_INTERVAL, unit="frames")
        if shortest > longest:
            raise InputError(f"mean_interval = {self.mean_interval}; give the shortest, then the longest [frames]")
        exposed = expose(scene, float(np.exp(rng.uniform(np.log(shortest), np.log(longest)))))
        assert isinstance(exposed, Discs)
        return exposed

    def common(self, view: CameraUnits) -> dict[str, Any]:
        """Keywords of every `Episode` of the task, scene and target apart."""
        return {"success_px": self.success_side * view.side, "steps": view.steps(self.duration_s)}


__getattr__ = old_names(__name__, {"View": "CameraUnits"})
