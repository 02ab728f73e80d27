"""A spike camera that is to be turned to a place: reward, end, success and score, the same for every task."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from gymnasium.utils.seeding import np_random
from numpy.typing import ArrayLike, NDArray

from scenes.protocol import Gaze, Scene
from spikecam_env.envs.action import checked_action
from spikecam_env.envs.course import Drive, StepOutcome, steps_of
from spikecam_env.envs.episode import Episode, Standing
from spikecam_env.envs.motor import Motor
from spikecam_env.envs.oracle import oracle
from spikecam_env.envs.spike_camera import SpikeCameraEnv
from spikecam_env.envs.task import OUTCOME, REWARDS
from spikecam_env.errors import unknown_name

SUCCESS_SHARE = 1 / 8
"""Of the shorter side: a target nearer to the middle than this is being looked at, where a task says nothing else."""

DrawEpisode = Callable[[np.random.Generator, dict[str, Any]], Episode]
"""(generator, options of reset) -> an episode."""


class AimingEnv(SpikeCameraEnv):
    """An episode (`envs.episode`) before a spike camera.

    Action:
        The wanted gaze rate, one number an axis in [-1, 1] of `motor.top_px_s`, pan then tilt; then the task's further
        numbers, if it has any. The motor (`envs.motor`) limits the rate and its change.
    Reward:
        "progress" or "distance" of `envs.task`; OUTCOME more for a success that ends the episode.
    End:
        Terminated when the episode is decided, lost or done (`Episode.end`); truncated after its last step
        (`Episode.steps` and `beyond`).
    Info:
        That of `SpikeCameraEnv`, and target (2,) float64, its place in the picture [pixels]; distance_px, from the
        middle; is_success, the task is done as things stand; performance, 1 at best, of the episode if it ended here;
        gaze_rate (2,) float64 [pixels/s].

    Args:
        draw: see `DrawEpisode`.
        reward: "progress" or "distance".
        rise_s: time of the motor from rest to its top rate [s].
        axes: 2, or 1 for a camera that only pans.
        further: numbers of the action beyond the axes.
        camera: keywords of `SpikeCameraEnv`.
    """

    settles: ClassVar[tuple[str, ...]] = ("make_scene", "judge")
    answers: int = 0
    """Answers that an action can give: the action's last numbers, after the number that says one."""

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
        self._course: StepOutcome | None = None
        self._before: Any = None  # the course as it was a step ago
        self._bare: Any = None  # the scene as it is, without the filters of actions

    def set_top_rate(self, px_s: float) -> None:
        """Of the gaze [pixels/s]."""
        self.motor = Motor(px_s, self.rise_s)
        self.max_gaze_rate_px_s = px_s

    @property
    def course(self) -> StepOutcome:
        """Where the camera and its episode are; NotReadyError before the first reset."""
        if self._course is None:
            raise self._not_ready()
        return self._course

    @property
    def episode(self) -> Episode:
        """That is played; NotReadyError before the first reset."""
        return self.course.episode

    @property
    def standing(self) -> Standing:
        """Where the episode stands; NotReadyError before the first reset."""
        return self.course.standing

    @property
    def step_s(self) -> float:
        """Time of a step [s]."""
        return self._drive.step_s

    @property
    def gaze(self) -> tuple[float, float]:
        """Where the camera looks (pan, tilt) [pixels]."""
        return self._position

    @property
    def gaze_rate_px_s(self) -> NDArray[np.float64]:
        """(2,) of the last step [pixels/s]."""
        return np.array(self.course.rate_px_s)

    def opening(self, seed: int, options: dict[str, Any] | None = None) -> StepOutcome:
        """The beginning of the episode that `reset(seed=seed, options=options)` plays; nothing is exposed.

        Args:
            seed: of the episode.
            options: of the task, without `model` and `light`.
        """
        return StepOutcome.begin(self._drive, self._draw_episode(np_random(seed)[0], options or {}))

    @property
    def steps_played(self) -> int:
        """See `JudgedEnv.steps_played`."""
        return self.standing.step

    def best_action(self) -> NDArray[np.float32]:
        """See `envs.oracle`."""
        return oracle(self.course)

    def ends_of(self, seed: int, most: int | None = None) -> tuple[float, float]:
        """See `JudgedEnv.ends_of`; the oracle looks at places only, so courses are played alone (`envs.course`)."""
        course, still = self.opening(seed), np.zeros(self.action_space.shape or (), np.float32)
        nothing, best = ([course, *steps_of(course, act, most)][-1].performance for act in (lambda _: still, oracle))
        return nothing, best

    def begin(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """A new episode, with the camera at rest; see the class for the options."""
        super().begin(seed=seed, options=options)
        self._bare = self.scene

    def begun(self) -> tuple[NDArray[Any], dict[str, Any]]:
        """See `SpikeCameraEnv.begun`."""
        observation, info = super().begun()
        return observation, info | self._of_standing()

    def turn(self, action: ArrayLike) -> None:
        """The motor turns as fast as it can; the other numbers go to the episode."""
        self._before = self.course
        self._course = self.course.after(self._checked_action(action))
        self._scene, self._gaze = self.episode.through(self._bare), self.course.gaze

    def outcome(self) -> tuple[NDArray[Any], float, bool, bool, dict[str, Any]]:
        """See the class."""
        observation, info = self._shown()
        now = self.course
        reward = REWARDS[self.reward](self._before.worth, now.worth) + OUTCOME * (now.end is True)
        return observation, reward, now.terminated, now.truncated, info | self._of_standing()

    def close(self) -> None:
        """See `SpikeCameraEnv.close`."""
        self._course = self._before = self._bare = None
        super().close()

    @property
    def _drive(self) -> Drive:
        return Drive(self.motor, self.axes, self.frames_per_step, self.model.frame_rate_hz)

    def _begin(self, rng: np.random.Generator, options: dict[str, Any]) -> Scene:
        self._course = StepOutcome.begin(self._drive, self._draw_episode(rng, options))
        return self.episode.scene

    def _checked_action(self, action: ArrayLike) -> list[float]:
        """In [-1, 1]: values beyond are cut."""
        (count,) = self.action_space.shape or (0,)
        return checked_action(action, count)

    def _of_standing(self) -> dict[str, Any]:
        course = self.course
        return {
            "target": np.array(course.standing.place),
            "distance_px": float(course.standing.distance_px),
            "is_success": course.is_success,
            "performance": course.performance,
            "gaze_rate": self.gaze_rate_px_s,
        }


def _undecided(scene: Scene, frame: float, gaze: Gaze) -> tuple[float, bool]:
    """A judge that leaves it to the episode."""
    return 0.0, False
