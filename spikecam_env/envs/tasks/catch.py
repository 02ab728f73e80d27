"""Catch: a ball flies towards a bright line and crosses it 5 to 20 ms after it is first seen; be there.

The camera rides on the paddle, which slides along the line: its place is the middle column.  It pans and does not tilt.
A galvanometer mirror turns as fast as this motor does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scenes.flat.discs import Discs, PiecewisePath
from scenes.protocol import Gaze
from spikecam_env.envs.episode import Episode, Standing
from spikecam_env.envs.tasks.base import CameraUnits, Task
from spikecam_env.envs.tasks.things import BRIGHT, background, disc_of, number_of


@dataclass(frozen=True)
class Catch(Task):
    """Be where a ball crosses a line.

    Scene:
        A ball flies towards a bright line, and crosses it 5 to 20 ms after it is first seen.
    Observation:
        By default a picture a step, (1, rows, columns) uint8: the share of the step's frames with a spike.
    Action:
        One number in [-1, 1]: pan, the wanted gaze rate over the top rate. That is 100 sides/s, reached from rest in 2
        ms. A step is 20 frames (0.5 ms).
    Reward:
        "progress": 20 times how much closer the place of the crossing has come to the middle column, as a share of half
        the diagonal; 10 more for the success.
    End:
        Terminated when the ball crosses; 60 steps at most.
    Success:
        The ball crosses within 1/16 side of the middle column. A ball that crosses early crosses near: a motor that
        starts 2.5 ms after the first picture is in time. Performance: 1 for a success.
    """

    top_sides_s: float = 100.0
    rise_s: float = 0.002
    duration_s: float = 0.03
    success_side: float = 1 / 16
    """Half the paddle's width [shorter sides]."""
    crossing_s: tuple[float, float] = (0.005, 0.02)
    """Earliest and latest crossing [s]."""
    away: tuple[float, float] = (0.12, 0.45)
    """Distance of the crossing from the paddle's first place: nearest, farthest [shorter sides]. The farthest is less
    where the motor cannot be in time."""
    radius: float = 1 / 16
    """Radius of the ball [shorter sides]."""
    start: float = 0.1
    """Row in which the ball is first seen [shorter sides]."""
    line: float = 0.85
    """Row of the line [shorter sides]."""
    spread: float = 0.2
    """Largest distance from the middle column at which the ball is first seen [shorter sides]."""

    frames_per_step: ClassVar[int] = 20
    axes: ClassVar[int] = 1

    def draw(self, rng: np.random.Generator, view: CameraUnits) -> Episode:
        """See `Task.draw`."""
        seconds = rng.uniform(*self.crossing_s)
        away = min(self.away[1], self.reach(seconds - REACTION_S))
        to = view.middle[0] + rng.choice([-1.0, 1.0]) * view.side * rng.uniform(self.away[0], max(away, self.away[0]))
        begin = np.array([view.middle[0] + view.side * rng.uniform(-self.spread, self.spread), self.start * view.side])
        crossing = np.array([to, self.line * view.side])
        frames = view.frames(seconds) + view.frames_per_step  # the first block is reset's
        path = PiecewisePath.straight(
            (float(begin[0]), float(begin[1])), tuple((crossing - begin) / frames), 2 * frames
        )
        ball = disc_of("plain", number_of(rng, view), self.radius * view.side, path)
        tile = background(number_of(rng, view), view.shape).copy()
        row = int(self.line * view.side)
        tile[row : row + max(1, int(LINE_SIDES * view.side))] = BRIGHT
        scene = Discs(view.shape, view.frame_rate_hz, tile, {"ball": ball})
        return Meeting(
            self.in_its_light(scene, rng), "ball", **self.common(view), crossing=(float(crossing[0]), frames)
        )

    def reach(self, seconds: float) -> float:
        """How far the motor comes from rest to wherever it is then [shorter sides]."""
        rising = min(seconds, self.rise_s)
        return self.top_sides_s * (rising**2 / (2 * self.rise_s) + (seconds - rising))


REACTION_S = 0.0025
"""Time that an agent has to see where the ball goes, at least [s]: five steps, in which the slowest ball moves by one
to two of its radii."""
LINE_SIDES = 1 / 64
"""Thickness of the line [shorter sides]: a row of 64 x 64 pixels."""


@dataclass(frozen=True, eq=False)
class Meeting(Episode):
    """An episode that ends when the ball crosses the line."""

    crossing: tuple[float, float] = (0.0, 0.0)
    """(x in an unmoved picture [pixels], frame)."""

    def aim(self, frame: float, gaze: Gaze) -> tuple[float, float]:
        """Where the ball crosses, as seen now; from then on, as it was seen then."""
        place, when = self.crossing
        return place - gaze.at(min(frame, when))[0], (self.scene.shape[0] - 1) / 2

    def end(self, standing: Standing) -> bool | None:
        """The ball has crossed."""
        return None if not self._crossed(standing) else standing.on_target

    def is_success(self, standing: Standing) -> bool:
        """It has, and was met."""
        return self._crossed(standing) and standing.on_target

    def performance(self, standing: Standing) -> float:
        """1 where it was met."""
        return float(self.is_success(standing))

    def _crossed(self, standing: Standing) -> bool:
        return standing.frame >= self.crossing[1]
