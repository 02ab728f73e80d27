"""An episode without its pictures: where the camera looks, how fast it turns, and how the episode stands.

A course is a value; `after(action)` is the next one, a step later.  The environment (`envs.aiming`) plays courses and
shows pictures on the way.  `steps_of` plays them alone: for the oracle, who looks at places only, and for tests.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scenes.protocol import Gaze
from spikecam_env.envs.episode import Episode, Standing
from spikecam_env.envs.motor import Motor, turned
from spikecam_env.envs.task import distance_from_middle


@dataclass(frozen=True)
class Drive:
    """The drive that turns the camera, and the times at which it does."""

    motor: Motor
    """Motor of every axis."""
    axes: int
    """2, or 1 for a camera that only pans."""
    frames_per_step: int
    """Frames from action to action."""
    frame_rate_hz: float
    """Frames a second."""

    @property
    def step_s(self) -> float:
        """Time of a step [s]."""
        return self.frames_per_step / self.frame_rate_hz


@dataclass(frozen=True, eq=False)
class StepOutcome:
    """The end of a step, or of the block that reset exposes."""

    drive: Drive
    """Drive of the camera."""
    episode: Episode
    """The episode that is played."""
    gaze: Gaze
    """Path of the camera in the step [pixels]."""
    rate_px_s: tuple[float, float]
    """Rate of the gaze in the step, (pan, tilt) [pixels/s]."""
    standing: Standing
    """Where the episode stands."""

    @classmethod
    def begin(cls, drive: Drive, episode: Episode) -> StepOutcome:
        """After the first block, in which the camera is at rest."""
        gaze = Gaze((0.0, 0.0), (0.0, 0.0), (0.0, float(drive.frames_per_step)))
        return cls(drive, episode, gaze, (0.0, 0.0), _standing(episode, gaze, None))

    def after(self, action: Sequence[float]) -> StepOutcome:
        """A step later, after an action of axes + further numbers in [-1, 1]."""
        drive, first, top = self.drive, self.standing.frame, self.drive.motor.top_px_s
        stop = first + drive.frames_per_step
        episode = self.episode.acted(tuple(action[drive.axes :]), self.standing, stop)
        wanted = [number * top for number in action[: drive.axes]] + [0.0] * (2 - drive.axes)
        pan, tilt = drive.motor.after(self.rate_px_s, wanted, drive.step_s)
        gaze = turned(self.gaze.stop, (pan / top, tilt / top), top / drive.frame_rate_hz, (first, stop))
        return StepOutcome(drive, episode, gaze, (pan, tilt), _standing(episode, gaze, self.standing))

    @cached_property
    def end(self) -> bool | None:
        """See `Episode.end`."""
        return self.episode.end(self.standing)

    @cached_property
    def worth(self) -> float:
        """See `Episode.worth`."""
        return self.episode.worth(self.standing)

    @property
    def terminated(self) -> bool:
        """The episode is decided."""
        return self.end is not None

    @property
    def truncated(self) -> bool:
        """Its last step is over, and it is not decided."""
        return self.end is None and self.standing.step >= self.episode.steps + self.episode.beyond

    @property
    def is_success(self) -> bool:
        """See `Episode.is_success`."""
        return bool(self.episode.is_success(self.standing))

    @property
    def performance(self) -> float:
        """See `Episode.performance`."""
        return float(self.episode.performance(self.standing))


def steps_of(
    course: StepOutcome, act: Callable[[StepOutcome], NDArray[np.float32]], most: int | None = None
) -> Iterator[StepOutcome]:
    """The courses after each step, up to the one that is over, or `most` steps (default `Episode.steps`)."""
    last = course.episode.steps if most is None else most
    while not (course.terminated or course.truncated) and course.standing.step < last:
        course = course.after(np.clip(act(course), -1.0, 1.0).tolist())
        yield course


def _standing(episode: Episode, gaze: Gaze, last: Standing | None) -> Standing:
    stop = int(gaze.frames[1])
    place = episode.aim(stop, gaze)
    distance = distance_from_middle(place, episode.scene.shape)
    on = episode.is_on(stop, distance)
    if last is None:
        return Standing(stop, 0, place, distance, on, 0, 0)
    return Standing(stop, last.step + 1, place, distance, on, last.steps_on + on, (last.held + 1) * on)
