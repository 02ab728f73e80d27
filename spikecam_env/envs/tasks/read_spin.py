"""ReadSpin: look at a spinning disc, and say how fast it spins; time costs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from scenes.discs import Discs
from spikecam_env.envs.episode import Episode, Standing
from spikecam_env.envs.tasks.base import Task, View
from spikecam_env.envs.tasks.things import background, disc_of, number_of, wander

RPM = (1000.0, 2000.0, 4000.0, 8000.0)
"""The speeds to tell apart [turns a minute]: 4 to 33 turns in an episode of a quarter of a second; the fastest turns by
48 degrees in a step of 40 frames at 40 kHz, about half of its bright sector."""
SAID = 0.5
"""The largest of the action's numbers after the gaze is the answer if it is above this; else nothing is said."""


@dataclass(frozen=True)
class ReadSpin(Task):
    """speed: of the disc's centre, over the gaze's top speed; radius, start, room: as of `Track`."""

    duration_s: float = 0.25
    speed: tuple[float, float] = (0.05, 0.2)
    radius: float = 0.2
    start: tuple[float, float] = (0.2, 0.3)
    room: float = 0.6

    further: ClassVar[int] = len(RPM)
    stream: ClassVar[int] = 3

    def draw(self, rng: np.random.Generator, view: View) -> Episode:
        """See `Task.draw`."""
        speed = self.top_sides_s * rng.uniform(*self.speed)
        path = wander(rng, view, view.beside_middle(rng, *self.start), speed, self.duration_s, self.room)
        truth, angle = int(rng.integers(self.further)), float(rng.uniform(0, 2 * np.pi))
        texture, rpm = self.shown(rng, truth)
        disc = disc_of(texture, number_of(rng, view), self.radius * view.side, path, rpm, angle)
        scene = Discs(view.shape, view.frame_rate_hz, background(number_of(rng, view), view.shape), {"disc": disc})
        return Reading(scene, "disc", **self.common(view), truth=truth, answers=self.further)

    def shown(self, rng: np.random.Generator, truth: int) -> tuple[str, float]:
        """(texture, turns a minute) of the disc whose answer is number `truth`."""
        return "sectors", RPM[truth]


@dataclass(frozen=True, eq=False)
class Reading(Episode):
    """truth: number of the right answer; answers: how many there are; answer: the agent's, None as long as it says
    nothing."""

    truth: int = 0
    answers: int = len(RPM)
    answer: int | None = None

    def acted(self, rest: tuple[float, ...], first: int, stop: int) -> Reading:
        """With the answer that is given."""
        best = int(np.argmax(rest))
        return replace(self, answer=best if rest[best] > SAID else None)

    def rest(self, standing: Standing, first: int, stop: int) -> tuple[float, ...]:
        """The right answer, when the disc is looked at; silence before."""
        return tuple(float(standing.on_target and number == self.truth) for number in range(self.answers))

    def end(self, standing: Standing) -> bool | None:
        """An answer ends it; it is right only while the disc is looked at."""
        return None if self.answer is None else self.is_success(standing)

    def is_success(self, standing: Standing) -> bool:
        """Said, right, and seen."""
        return self.answer == self.truth and standing.on_target

    def performance(self, standing: Standing) -> float:
        """Of a success, the share of the time that is left."""
        return float(self.is_success(standing)) * (1 - standing.step / self.steps)
