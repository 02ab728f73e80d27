"""Track: keep a disc in the middle of the view that turns and bounces at 0.2 to 0.8 of the gaze's top speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenes.discs import Discs
from spikecam_env.envs.episode import Episode
from spikecam_env.envs.tasks.base import Task, View
from spikecam_env.envs.tasks.things import background, disc_of, number_of, wander


@dataclass(frozen=True)
class Track(Task):
    """speed: of the target, over the gaze's top speed (least, most); radius, start: [shorter sides]; room: of the box
    in which it bounces, from its middle to its walls [shorter sides]."""

    speed: tuple[float, float] = (0.2, 0.8)
    radius: float = 1 / 8
    start: tuple[float, float] = (0.15, 0.25)
    room: float = 1.0

    def draw(self, rng: np.random.Generator, view: View) -> Episode:
        """See `Task.draw`."""
        return Episode(self.plane(rng, view), "target", **self.common(view))

    def plane(self, rng: np.random.Generator, view: View) -> Discs:
        """The target and what is behind it."""
        speed = self.top_sides_s * rng.uniform(*self.speed)
        path = wander(rng, view, view.beside_middle(rng, *self.start), speed, self.duration_s, self.room)
        target = disc_of("islands", number_of(rng, view), self.radius * view.side, path)
        return Discs(view.shape, view.frame_rate_hz, background(number_of(rng, view), view.shape), {"target": target})
