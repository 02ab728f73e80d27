"""A classical player of Return: balls are bright spots that move, and their way says where they cross.

    pixel(t) = f (s + w t + (g + a) t^2 / 2) / (D - v t)      D: distance at t = 0 [m], f: focal length [pixels]

    c        = s + w T + (g + a) T^2 / 2,   T = AWAY / v      place at which the ball crosses [m]

For each speed v of the levels, pixels are linear in the start s, the crossing c and the bend a, which have normal
priors.  All balls of an episode have one speed, that with the most evidence.  Of all spots the one that most likely
crosses within reach counts: other balls cross beyond.  t is the middle of a picture's exposure, whatever the camera.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from spikecam_env.agents.controllers.timing import PictureTiming
from spikecam_env.envs.mujoco_tasks.return_ball import AWAY, BEND, HALF, LEVEL, REACH, STARTS
from spikecam_env.envs.mujoco_tasks.task import EYE, STEP_S
from spikecam_env.types import Floats

BLUR_PX = 1.0
"""Sigma of the noise filter [pixels]: a far ball's radius."""
LEFT, LEFT_LONG = 0.5, 0.9
"""Of old pictures in the means over two and ten steps, a step later; the lowest of the latter is a pixel without a
ball."""
LEAST_RATE = 0.01
"""Of a pixel whose noise grows as the square root of its rate [spikes/frame]."""
AROUND_PX = 4.0
"""Sigma of the surroundings that a ball is brighter than [pixels]."""
EXCESS = 9.0
"""Least excess of a spot [median absolute excesses]."""
SPOTS = 10
"""Spots of a picture that are followed at most."""
GATE_PX = 3.0
"""Farthest that a spot is from the place of its track in the next picture of a step later."""
FASTEST_PX = 1.0
"""Farther in each step more: a ball of level 5 from 40 cm aside moves by less until it is 30 cm away [pixels/step]."""
PLACE_PX = 0.7
"""Error of a spot's place (sigma)."""
LEAST, LEAST_SLOW = 5, 3
"""Places of a track that is believed; of a camera whose pictures are more than SLOW_STEPS apart."""
SLOW_STEPS = 2.0
LEAST_PX = 1.5
"""Motion of a track that is believed [pixels]."""
LOST = 8
"""Steps and, of a slow camera, a picture without a spot after which a track ends."""
SAME = 1e-6
"""Of times: as good as the same."""
FRAME_PX = 2.0
"""Spots as near to the paddle's frame are the frame's."""
BEYOND = 0.4
"""Sigma of the place at which any ball crosses [m]."""


class Crossing(NamedTuple):
    """Where a spot crosses the paddle's plane, if it is a ball."""

    place: Floats
    """(left, up) [m]."""
    error: Floats
    """(2,) sigma [m]."""
    evidence: float
    """Logarithm; of a speed."""

    @property
    def within_reach(self) -> float:
        """Logarithm of the density that it is the ball that can be returned."""
        spread = np.square(self.error) + REACH**2 / 3
        return float(-0.5 * np.sum(np.square(self.place) / spread + np.log(spread)))

    @property
    def may_be_reached(self) -> bool:
        """Whether it crosses within reach, or within two sigma of that."""
        return bool(np.all(np.abs(self.place) < REACH + 2 * self.error))


class SpotTrack(NamedTuple):
    """A spot that was followed."""

    time_s: list[float]
    places: list[Floats]
    """(x, y) [pixels]."""


class ReturnController:
    """Acts like an `Agent`.

    Args:
        env: a bare `Return`.
        timing: of the pictures, which are grey; default: those of the spike camera's block.

    Example:
        >>> import gymnasium
        >>> env = gymnasium.make("spikecam_env/Return-v1", obs="tfp", obs_state=True, obs_inner=True)
        >>> observation, info = env.reset(seed=0)
        >>> ReturnController(env.unwrapped).act(observation).tolist()
        [0.0, 0.0]
        >>> env.close()
    """

    def __init__(self, env: Any, timing: PictureTiming | None = None) -> None:
        self._timing = PictureTiming.of(env) if timing is None else timing
        camera = env.model.camera(EYE)
        rows, columns = env.shape
        self._focal = rows / 2 / np.tan(np.radians(float(camera.fovy[0])) / 2)
        self._middle = np.array([(columns - 1) / 2, (rows - 1) / 2])
        self._eye = -float(camera.pos[0])
        self._gravity = np.array([0.0, float(env.model.opt.gravity[2])])
        self.begin()

    def begin(self) -> None:
        """Forget all observations."""
        self._tracks: list[SpotTrack] = []
        self._now: Any = None  # (rows, columns), as `_slow` and `_floor`; of no picture yet
        self._slow: Any = None
        self._floor: Any = None
        self._step, self._newest, self._apart = 0, -np.inf, 1.0  # [steps], of the newest picture and from the last one
        self._aim = np.zeros(2)

    def act(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """The place to which the paddle goes: where the most likely ball crosses."""
        middle = self._timing.middle_step(observation, self._step)
        self._step += 1
        if middle > self._newest + SAME:
            self._apart = middle - self._newest if np.isfinite(self._newest) else 1.0
            self._newest = middle
            self._look(observation)
        return np.clip(self._aim / REACH, -1, 1).astype(np.float32)

    def _look(self, observation: dict[str, NDArray[Any]]) -> None:
        """Follow the spots of a new picture, and set the aim."""
        left, up = REACH * np.asarray(observation["inner"], np.float64)[:2]
        paddle = self._middle + self._focal / self._eye * np.array([-left, -up])
        self._follow(self._spots(observation["picture"][0].astype(np.float32) / 255, paddle))
        balls = [track for track in self._tracks if self._is_ball(track)]
        reached = [ball for ball in self._crossings(balls) if ball.may_be_reached] if balls else []
        if reached:
            left, up = max(reached, key=lambda crossing: crossing.within_reach).place
            self._aim = np.array([-left, up])

    def _is_ball(self, track: SpotTrack) -> bool:
        """Whether a track is long enough, has moved, and no ball would have passed by now."""
        slowest = min(numbers.speed for numbers in LEVEL.values())
        moved = float(np.hypot(*(track.places[-1] - track.places[0])))
        least = LEAST if self._apart <= SLOW_STEPS else LEAST_SLOW
        return len(track.time_s) >= least and moved >= LEAST_PX and slowest * track.time_s[-1] < AWAY

    def _spots(self, picture: NDArray[np.float32], paddle: Floats) -> list[Floats]:
        """Places (x, y) brighter than their surroundings, and than they ever were."""
        smooth = cv2.GaussianBlur(picture, (0, 0), BLUR_PX)
        self._now = smooth if self._now is None else smooth + LEFT**self._apart * (self._now - smooth)
        self._slow = smooth if self._slow is None else smooth + LEFT_LONG**self._apart * (self._slow - smooth)
        self._floor = self._slow if self._floor is None else np.minimum(self._floor, self._slow)
        excess = (self._now - self._floor) / np.sqrt(self._floor + LEAST_RATE)
        excess = excess - cv2.GaussianBlur(excess, (0, 0), AROUND_PX)
        least = EXCESS * float(np.median(np.abs(excess)))
        peaks = (excess >= cv2.dilate(excess, np.ones((5, 5), np.uint8))) & (excess > least)
        rows, columns = np.nonzero(peaks)
        best = np.argsort(-excess[rows, columns])[:SPOTS]
        places = [np.array([columns[n], rows[n]], np.float64) for n in best]
        half = self._focal / self._eye * HALF
        return [place for place in places if abs(np.abs(place - paddle).max() - half) > FRAME_PX]

    def _follow(self, spots: list[Floats]) -> None:
        """Each track takes the nearest spot; other spots begin tracks."""
        left = LEFT**self._apart
        free, now = list(spots), max(0.0, self._newest - self._apart * left / (1 - left)) * STEP_S
        gate, lost_s = GATE_PX + FASTEST_PX * (self._apart - 1), (LOST + 2 * (self._apart - 1)) * STEP_S
        for n, track in enumerate(self._tracks):
            away = [float(np.hypot(*(spot - track.places[-1]))) for spot in free]
            if away and min(away) < gate:
                spot = free.pop(int(np.argmin(away)))
                self._tracks[n] = SpotTrack([*track.time_s, now], [*track.places, spot])
        kept = [track for track in self._tracks if now - track.time_s[-1] <= lost_s + SAME]
        self._tracks = kept + [SpotTrack([now], [spot]) for spot in free]

    def _crossings(self, balls: list[SpotTrack]) -> list[Crossing]:
        """Of each ball, by the speed with the most evidence of all."""
        latest = max(ball.time_s[-1] for ball in balls)
        speeds = [numbers.speed for numbers in LEVEL.values() if numbers.speed * latest < AWAY]
        fits = [[self._fit(ball, speed) for ball in balls] for speed in speeds]
        return max(fits, key=lambda its: sum(fit.evidence for fit in its))

    def _fit(self, ball: SpotTrack, speed: float) -> Crossing:
        """Least squares with priors; see the head of this file."""
        time_s, pixels = np.array(ball.time_s), self._middle - np.array(ball.places)  # left, up
        end, bend = AWAY / speed, BEND * speed**2 / 2
        scale = self._focal / (AWAY + self._eye - speed * time_s)
        share = time_s / end
        curve = (time_s**2 - time_s * end) / 2
        matrix = scale[:, None] * np.stack([1 - share, share, curve], axis=1) / PLACE_PX
        prior = np.array([STARTS / 3**0.5, BEYOND, bend])
        known = (pixels - scale[:, None] * curve[:, None] * self._gravity) / PLACE_PX
        precision = matrix.T @ matrix + np.diag(prior**-2)
        solved = np.linalg.solve(precision, matrix.T @ known)
        misfit = np.sum((known - matrix @ solved) ** 2) + np.sum((solved / prior[:, None]) ** 2)
        volume = np.linalg.slogdet(precision)[1] + 2 * np.log(prior).sum()
        error = float(np.sqrt(np.linalg.inv(precision)[1, 1]))
        return Crossing(solved[1], np.full(2, error), float(-misfit / 2 - volume))
