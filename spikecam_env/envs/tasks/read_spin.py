"""ReadSpin: look at a spinning disc, and say which of 1000, 2000, 4000, 8000 rpm it has; time costs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from scenes.flat.discs import Discs
from spikecam_env.envs.episode import Episode, Standing
from spikecam_env.envs.task import OUTCOME, PROGRESS
from spikecam_env.envs.tasks.base import CameraUnits, Task
from spikecam_env.envs.tasks.things import background, disc_of, number_of, wander

RPM = (1000.0, 2000.0, 4000.0, 8000.0)
"""The speeds to distinguish [turns a minute]: 4 to 33 turns in an episode of a quarter of a second; the fastest turns
by 48 degrees in a step of 40 frames at 40 kHz, about half of its bright sector."""
LOCK_SHARE = 1 / 3
"""Time without answers after a wrong one, as a share of the episode's: three answers at most, fewer than the speeds."""


@dataclass(frozen=True)
class ReadSpin(Task):
    """Look at a spinning disc, and say how fast it spins.

    Scene:
        A dark disc with one bright sector spins at 1000, 2000, 4000 or 8000 rpm. Its centre wanders at 0.05 to 0.2 of
        the gaze's top rate. It may leave the picture and come back.
    Observation:
        By default a picture a step, (1, rows, columns) uint8: the share of the step's frames with a spike.
    Action:
        Seven numbers in [-1, 1]: pan, tilt, say, and one for each speed. A say above 0 gives an answer: the speed with
        the largest number. An answer counts if the disc's centre is within 1/8 side of the picture's middle as the step
        begins, and is ignored otherwise. A step is 40 frames (1 ms).
    Reward:
        "progress" as of `Track`; 10 more for the right answer, and 10 / 3 less for a wrong one.
    End:
        Terminated by the right answer; truncated after 250 steps. A wrong answer locks answers for a third of these.
    Success:
        The right answer. Performance: share of the time that is left then, less 1/3 for each wrong answer. So a guess
        is worth nothing on average, or less (formula scoring: 1 / (answers - 1) for a wrong answer).
    """

    duration_s: float = 0.25
    speed: tuple[float, float] = (0.05, 0.2)
    """Speed of the disc's centre over the gaze's top rate: least, most."""
    radius: float = 0.2
    """Radius of the disc [shorter sides]."""
    start: tuple[float, float] = (0.2, 0.3)
    """Distance of the disc's centre from the middle at first: least, most [shorter sides]."""
    room: float = 0.6
    """Distance from the middle to the walls at which the disc turns back [shorter sides]."""

    answers: ClassVar[int] = len(RPM)
    further: ClassVar[int] = 1 + answers
    stream: ClassVar[int] = 3

    def draw(self, rng: np.random.Generator, view: CameraUnits) -> Episode:
        """See `Task.draw`."""
        speed = self.top_sides_s * rng.uniform(*self.speed)
        path = wander(rng, view, view.beside_middle(rng, *self.start), speed, self.duration_s, self.room)
        truth, angle = int(rng.integers(self.answers)), float(rng.uniform(0, 2 * np.pi))
        texture, rpm = self.shown(rng, truth)
        disc = disc_of(texture, number_of(rng, view), self.radius * view.side, path, rpm, angle)
        scene = Discs(view.shape, view.frame_rate_hz, background(number_of(rng, view), view.shape), {"disc": disc})
        return ReadSpinEpisode(
            self.in_its_light(scene, rng), "disc", **self.common(view), truth=truth, answers=self.answers
        )

    def shown(self, rng: np.random.Generator, truth: int) -> tuple[str, float]:
        """(texture, turns a minute) of the disc whose answer is number `truth`."""
        return "sectors", RPM[truth]


@dataclass(frozen=True, eq=False)
class ReadSpinEpisode(Episode):
    """An episode with a question."""

    truth: int = 0
    """Number of the right answer."""
    answers: int = len(RPM)
    """How many answers can be given."""
    wrong: int = 0
    """Wrong answers so far."""
    heard_from: int = 0
    """First step whose answer counts."""
    is_right: bool = False
    """Whether the right answer was given."""

    def acted(self, rest: tuple[float, ...], standing: Standing, stop: int) -> ReadSpinEpisode:
        """With the answer that was given, if it counts."""
        say, *numbers = rest
        step = standing.step + 1
        if say <= 0.0 or step < self.heard_from or not standing.on_target:
            return self
        if int(np.argmax(numbers)) == self.truth:
            return replace(self, is_right=True)
        return replace(self, wrong=self.wrong + 1, heard_from=step + 1 + round(LOCK_SHARE * self.steps))

    def rest(self, standing: Standing, first: int, stop: int) -> tuple[float, ...]:
        """The right answer, said while the disc is looked at."""
        return (1.0 if standing.on_target else -1.0, *(float(n == self.truth) for n in range(self.answers)))

    def worth(self, standing: Standing) -> float:
        """Closeness, less the share of OUTCOME that wrong answers cost."""
        return super().worth(standing) - OUTCOME / PROGRESS * self._cost

    def end(self, standing: Standing) -> bool | None:
        """See `Episode.end`."""
        return True if self.is_right else None

    def is_success(self, standing: Standing) -> bool:
        """See `Episode.is_success`."""
        return self.is_right

    def performance(self, standing: Standing) -> float:
        """Of a success, the share of the time that is left; less the cost of wrong answers."""
        return float(self.is_right) * (1 - standing.step / self.steps) - self._cost

    @property
    def _cost(self) -> float:
        """Of the wrong answers, as a share of a success."""
        return self.wrong / (self.answers - 1)
