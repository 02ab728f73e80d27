"""Track: keep a disc in the middle of the view that turns and bounces at 0.2 to 0.8 of the gaze's top speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenes.flat.discs import Discs
from spikecam_env.envs.episode import Episode
from spikecam_env.envs.tasks.base import CameraUnits, Task
from spikecam_env.envs.tasks.things import background, disc_of, number_of, wander


@dataclass(frozen=True)
class Track(Task):
    """Keep a disc in the middle of the view.

    Scene:
        A disc with bright islands turns and bounces before a soft background, at 0.2 to 0.8 of the gaze's top rate.
    Observation:
        By default a picture a step, (1, rows, columns) uint8: the share of the step's frames with a spike.
    Action:
        Two numbers in [-1, 1]: pan (to the right) and tilt (down), the wanted gaze rate over the top rate. That is 10
        sides/s, reached from rest in 10 ms. A step is 40 frames (1 ms).
    Reward:
        "progress": 20 times how much closer the disc has come to the middle, as a share of half the diagonal.
    End:
        Terminated when the disc's middle leaves the picture; truncated after 500 steps.
    Success:
        The disc's middle is within 1/8 side of the picture's. Performance: share of the 500 steps that end so.
    """

    speed: tuple[float, float] = (0.2, 0.8)
    """Speed of the disc over the gaze's top rate: least, most."""
    radius: float = 1 / 8
    """Radius of the disc [shorter sides]."""
    start: tuple[float, float] = (0.15, 0.25)
    """Distance of the disc from the middle at first: least, most [shorter sides]."""
    room: float = 1.0
    """Distance from the middle to the walls at which the disc turns back [shorter sides]."""

    def draw(self, rng: np.random.Generator, view: CameraUnits) -> Episode:
        """See `Task.draw`."""
        return Episode(self.plane(rng, view), "target", **self.common(view))

    def plane(self, rng: np.random.Generator, view: CameraUnits) -> Discs:
        """The target before its background, in its light."""
        speed = self.top_sides_s * rng.uniform(*self.speed)
        path = wander(rng, view, view.beside_middle(rng, *self.start), speed, self.duration_s, self.room)
        target = disc_of("islands", number_of(rng, view), self.radius * view.side, path)
        tile = background(number_of(rng, view), view.shape)
        return self.in_its_light(Discs(view.shape, view.frame_rate_hz, tile, {"target": target}), rng)
