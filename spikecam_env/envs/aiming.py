"""A spike camera that is to be turned to a place: reward, end, success and score, the same for every task."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from scenes.protocol import Gaze, Scene
from spikecam_env.envs.episode import Episode, Standing
from spikecam_env.envs.motor import Motor
from spikecam_env.envs.spike_camera import SpikeCameraEnv
from spikecam_env.envs.task import REWARDS, distance_from_middle
from spikecam_env.errors import InputError, NotReadyError, unknown_name

OUTCOME = 10.0
"""Reward, beside the other, of a success that ends an episode; a failure that ends one takes nothing."""

SUCCESS_SHARE = 1 / 8
"""Of the shorter side: a target nearer to the middle than this is being looked at, where a task says nothing else."""

DrawEpisode = Callable[[np.random.Generator, dict[str, Any]], Episode]
"""(generator, options of reset) -> an episode."""


class AimingEnv(SpikeCameraEnv):
    """An episode (`envs.episode`) before a spike camera.

    Action        the wanted gaze rate, one number an axis in [-1, 1] of `motor.top_px_s`, pan then tilt; after them
                  the task's further numbers, if it has any.  What the motor makes of it: `envs.motor`.
    Reward        `reward`: "progress" or "distance", see `envs.task`; OUTCOME more for a success that ends the episode.
    Terminated    the episode is decided: lost or done (`Episode.end`).
    Truncated     its last step is over (`Episode.steps`) and it is not decided.
    Info          target (2,) float64, where it is seen [pixels]; distance_px, from the middle; is_success, the task is
                  done as things stand; performance, 0 to 1, of the episode if it ended here; gaze_rate (2,) float64
                  [pixels/s]; what `SpikeCameraEnv` has.

    draw      see `DrawEpisode`
    reward    "progress" or "distance"
    rise_s    of the motor, from rest to its top rate [s]
    axes      2, or 1 for a camera that only pans
    further   numbers of the action beyond the axes
    camera    keywords of `SpikeCameraEnv`
    """

    def __init__(
        self,
        draw: DrawEpisode,
        *,
        reward: str = "distance",
        rise_s: float = 0.0,
        axes: int = 2,
        further: int = 0,
        **camera: Any,
    ) -> None:
        super().__init__(self._begin, _undecided, **camera)
        if reward not in REWARDS:
            raise unknown_name("reward", reward, REWARDS)
        self.reward, self.axes = reward, axes
        self.rise_s = rise_s
        self.set_top_rate(self.max_gaze_rate_px_s)
        self.action_space = spaces.Box(-1.0, 1.0, (axes + further,), np.float32)
        self._draw_episode = draw
        self._episode: Episode | None = None
        self._standing: Standing | None = None
        self._bare: Any = None  # the scene as it is, without what an action puts before the camera
        self._rate = np.zeros(2)

    def set_top_rate(self, px_s: float) -> None:
        """Of the gaze [pixels/s]."""
        self.motor = Motor(px_s, self.rise_s)
        self.max_gaze_rate_px_s = px_s

    @property
    def episode(self) -> Episode:
        """That is played; NotReadyError before the first reset."""
        if self._episode is None:
            raise self._not_ready()
        return self._episode

    @property
    def standing(self) -> Standing:
        """Where the episode stands; NotReadyError before the first reset."""
        if self._standing is None:
            raise NotReadyError("the environment has no episode yet; call reset first")
        return self._standing

    @property
    def step_s(self) -> float:
        """Time of a step [s]."""
        return self.frames_per_step / self.model.frame_rate_hz

    @property
    def gaze(self) -> tuple[float, float]:
        """Where the camera looks (pan, tilt) [pixels]."""
        return self._position

    @property
    def gaze_rate_px_s(self) -> NDArray[np.float64]:
        """(2,) of the last step [pixels/s]."""
        return self._rate.copy()

    def begin(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """A new episode, with the camera at rest; see the class for the options."""
        self._rate, self._standing = np.zeros(2), None
        super().begin(seed=seed, options=options)
        self._bare = self.scene

    def begun(self) -> tuple[NDArray[Any], dict[str, Any]]:
        """See `SpikeCameraEnv.begun`."""
        observation, info = super().begun()
        self._standing = self._stands(None)
        return observation, info | self._of_standing()

    def turn(self, action: ArrayLike) -> None:
        """The motor does what it can; the other numbers go to the episode."""
        super().turn(self._command(action))

    def outcome(self) -> tuple[NDArray[Any], float, bool, bool, dict[str, Any]]:
        """See the class."""
        observation, _, _, _, info = super().outcome()
        reward, terminated, truncated = self._assess()
        return observation, reward, terminated, truncated, info | self._of_standing()

    def close(self) -> None:
        """See `SpikeCameraEnv.close`."""
        self._episode = self._standing = self._bare = None
        super().close()

    def _begin(self, rng: np.random.Generator, options: dict[str, Any]) -> Scene:
        self._episode = self._draw_episode(rng, options)
        return self._episode.scene

    def _command(self, action: ArrayLike) -> NDArray[np.float64]:
        """(2,): the rate that the motor reaches, in units of its top rate; the other numbers go to the episode."""
        given = np.asarray(action, np.float64)
        if given.shape != self.action_space.shape or not np.isfinite(given).all():
            raise InputError(f"action is {action!r}; it must be {_numbers(self.action_space.shape)} in [-1, 1]")
        given = np.minimum(np.maximum(given, -1.0), 1.0)
        first, rest = self.sensor.frame, tuple(float(number) for number in given[self.axes :])
        self._episode = self.episode.acted(rest, first, first + self.frames_per_step)
        self._scene = self._episode.through(self._bare)
        wanted = np.zeros(2)
        wanted[: self.axes] = given[: self.axes] * self.motor.top_px_s
        self._rate = self.motor.after(self._rate, wanted, self.step_s)
        return self._rate / self.motor.top_px_s

    def _assess(self) -> tuple[float, bool, bool]:
        """(reward, terminated, truncated) of a step."""
        last = self.standing
        self._standing = now = self._stands(last)
        end = self.episode.end(now)
        reward = REWARDS[self.reward](self.episode.worth(last), self.episode.worth(now))
        return reward + OUTCOME * (end is True), end is not None, end is None and now.step >= self.episode.steps

    def _stands(self, last: Standing | None) -> Standing:
        stop = self.sensor.frame
        place = self.episode.aim(stop, self._gaze)
        distance = distance_from_middle(place, self.shape)
        on = self.episode.is_on(stop, distance)
        if last is None:
            return Standing(stop, 0, place, distance, on, 0, 0)
        return Standing(stop, last.step + 1, place, distance, on, last.steps_on + on, (last.held + 1) * on)

    def _of_standing(self) -> dict[str, Any]:
        standing, episode = self.standing, self.episode
        return {
            "target": np.array(standing.place),
            "distance_px": float(standing.distance_px),
            "is_success": bool(episode.is_success(standing)),
            "performance": float(episode.performance(standing)),
            "gaze_rate": self.gaze_rate_px_s,
        }


def _undecided(scene: Scene, frame: float, gaze: Gaze) -> tuple[float, bool]:
    """A judge that leaves it to the episode."""
    return 0.0, False


def _numbers(shape: tuple[int, ...] | None) -> str:
    """As messages have it."""
    count = shape[0] if shape else 0
    return {1: "one finite number", 2: "two finite numbers", 3: "three finite numbers"}.get(
        count, f"{count} finite numbers"
    )
