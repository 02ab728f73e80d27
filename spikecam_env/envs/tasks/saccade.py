"""Saccade: several discs move; look at the one with spokes, and hold it, before the time is over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenes.flat.discs import Disc, Discs
from spikecam_env.envs.episode import Episode, Reaching
from spikecam_env.envs.tasks.base import CameraUnits, Task
from spikecam_env.envs.tasks.things import background, disc_of, number_of, wander

CUE = "spokes"
OTHERS = ("rings", "halves", "islands")
"""Textures of the discs to leave alone; half of the light is theirs too."""


@dataclass(frozen=True)
class Saccade(Task):
    """Look at the disc with spokes, and hold it.

    Scene:
        Four discs with different textures turn and bounce, at 0.2 to 0.5 of the gaze's top rate. One has spokes.
    Observation:
        By default a picture a step, (1, rows, columns) uint8: the share of the step's frames with a spike.
    Action:
        That of `Track`: pan and tilt.
    Reward:
        "progress" as of `Track`, towards the disc with spokes; 10 more for the success.
    End:
        Terminated by the success; truncated after 200 steps. A disc that leaves the picture may come back.
    Success:
        Its middle is within 1/16 side of the picture's for 20 ms without a break. Performance: 1 for a success.
    """

    duration_s: float = 0.2
    success_side: float = 1 / 16
    hold_s: float = 0.02
    """Time for which the disc is to be held [s]."""
    speed: tuple[float, float] = (0.2, 0.5)
    """Speed of the discs over the gaze's top rate: least, most."""
    radius: float = 1 / 9
    """Radius of the discs [shorter sides]."""
    start: tuple[float, float] = (0.25, 0.35)
    """Distance of the discs from the middle at first: least, most [shorter sides]."""
    room: float = 0.6
    """Distance from the middle to the walls at which the discs turn back [shorter sides]."""

    def draw(self, rng: np.random.Generator, view: CameraUnits) -> Episode:
        """See `Task.draw`."""
        first, kinds = rng.uniform(0, 2 * np.pi), rng.permutation([CUE, *OTHERS])
        x, y = view.middle
        discs: dict[str, Disc] = {}
        for number, kind in enumerate(kinds):
            direction = first + 2 * np.pi * number / len(kinds)
            distance = view.side * rng.uniform(*self.start)
            start = (float(x + distance * np.cos(direction)), float(y + distance * np.sin(direction)))
            speed = self.top_sides_s * rng.uniform(*self.speed)
            path = wander(rng, view, start, speed, self.duration_s, self.room)
            discs[str(kind)] = disc_of(str(kind), number_of(rng, view), self.radius * view.side, path)
        discs[CUE] = discs.pop(CUE)  # in front, so that it is never hidden
        scene = Discs(view.shape, view.frame_rate_hz, background(number_of(rng, view), view.shape), discs)
        return Reaching(self.in_its_light(scene, rng), CUE, **self.common(view), hold=view.steps(self.hold_s))
