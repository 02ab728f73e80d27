"""The base of MuJoCo tasks: time, motors, levels, episodes with numbers, and the verdict.

    reset: arrange(rng, level)      step: drive(action), physics of a millisecond, verdict()

Inputs of the physics stay the same within a step, so that a camera can have the poses between its ends exactly
(`scenes.mujoco.replay`).  A level is a row of a table in the task's file: how fast, how bright, how much clutter.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from scenes.mujoco import MujocoPictures, import_mujoco
from scenes.mujoco.cameras import Projection
from spikecam_env.checked import checked_shape, checked_whole
from spikecam_env.envs.action import checked_action
from spikecam_env.envs.own_length import OwnLength
from spikecam_env.envs.reset_options import Rule, checked_options
from spikecam_env.envs.task import OUTCOME, PROGRESS
from spikecam_env.envs.tasks.splits import checked_split, drawn_number, episode_generator
from spikecam_env.errors import InputError, NotReadyError, shown, unknown_name
from spikecam_env.types import Floats

STEP_S = 0.001
"""Time from action to action [s]."""
LEVELS = (1, 2, 3, 4, 5)
MIDDLE_LEVEL = 3
EYE = "eye"
"""Name of the camera in every model."""
BOUNCE = 'solref="-2.5e6 -160" solimp=".99 .99 .001"'
"""Stiffness [1/s^2] and damping [1/s] of a hard contact (MJCF): it lasts 2 ms, and a ball keeps 0.85 of its speed."""
RENDERED_SIDE = 256
"""Longer side of a picture for people [pixels]."""


@dataclass(frozen=True)
class Verdict:
    """How an episode stands at the end of a step."""

    end: bool | None
    """None while it goes on; then whether the task is done."""
    performance: float
    """Of the episode if it ended here, 0 to 1."""
    worth: float
    """How good things are, 1 at best; the reward is made of its changes."""


class MujocoTask(OwnLength):
    """Physics of a task, without a camera; a subclass adds the model, `arrange`, `drive`, `verdict`, `target`.

    Observation:
        What its own encoders measure, (n,) float32; the picture is the camera's (`make_task`).
    Reward:
        PROGRESS times the change of `Verdict.worth`; OUTCOME more for a success that ends the episode.
    End:
        Terminated when the verdict ends it; truncated after `most_steps`.
    Options:
        For this episode split; episode, its number within the split; level.
    Info:
        performance, is_success, target (2,) [pixels], distance_px, level, episode_number; see `JudgedEnv`.
    Render:
        `rgb_array`: the scene in colour.

    Args:
        level: 1 to 5, or the lowest and the highest, of which every episode draws one.
        split: "train" or "test".
        shape: (rows, columns) of the picture in which `target` is given.
        render_mode: "rgb_array" or None.

    Raises:
        InputError: for a value out of range or unknown, and where MuJoCo is missing.
        NotReadyError: for a step or a render before the first reset.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 25}  # noqa: RUF012
    dt = STEP_S
    most_steps: ClassVar[int]
    """Steps of an episode at most."""
    actions: ClassVar[int]
    """Numbers of an action."""
    sensed_numbers: ClassVar[int]
    """Numbers that the encoders measure."""
    answers: ClassVar[int] = 0
    """Answers that an action can give, its last numbers, after the number that says one."""
    stream: ClassVar[int]
    """Stream of random numbers, another of every task."""
    camera_defaults: ClassVar[Mapping[str, Any]] = MappingProxyType({})
    """Keywords of `make_task` that are other than usual, such as block_frames; given ones go before them."""

    def __init__(
        self,
        *,
        level: int | tuple[int, int] = MIDDLE_LEVEL,
        split: str = "train",
        shape: tuple[int, int] = (64, 64),
        render_mode: str | None = None,
    ) -> None:
        mujoco = import_mujoco()
        self.levels, self.split, self.shape = checked_levels(level), checked_split(split), checked_shape(shape)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise unknown_name("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self.model = mujoco.MjModel.from_xml_string(self.xml(), self.assets())
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self._lamps = _Lamps(self.model)
        self._substeps = round(STEP_S / self.model.opt.timestep)
        self.action_space = spaces.Box(-1.0, 1.0, (self.actions,), np.float32)
        self.observation_space = spaces.Box(-np.inf, np.inf, (self.sensed_numbers,), np.float32)
        self._pictures: MujocoPictures | None = None
        self._twin: MujocoTask | None = None  # that plays episodes without a camera
        self._verdict: Verdict | None = None
        self._steps = 0
        self.level, self._number = self.levels[0], 0

    def xml(self) -> str:
        """The model (MJCF), with a camera named EYE and a timestep that divides STEP_S."""
        raise NotImplementedError

    def assets(self) -> dict[str, bytes]:
        """Files that the model names, such as textures, by their names."""
        return {}

    def arrange(self, rng: np.random.Generator, level: int) -> float:
        """Put all in place for an episode of this level, in model and data, which are as loaded but for what this
        method changed before; everything follows from `rng`.

        Returns:
            Brightness of all lamps, 1 as in the model.
        """
        raise NotImplementedError

    def drive(self, action: list[float]) -> None:
        """Set controls and forces for the next step; action: numbers in [-1, 1]."""
        raise NotImplementedError

    def watch(self) -> None:
        """Called after every step of the physics, for what is over within a step, such as contact."""

    def verdict(self) -> Verdict:
        """How things stand."""
        raise NotImplementedError

    def best_action(self) -> NDArray[np.float32]:
        """See `JudgedEnv.best_action`."""
        raise NotImplementedError

    def target(self) -> tuple[Floats, Floats]:
        """(3,) the place that matters, and (3,) where the agent is, in the world [m]."""
        raise NotImplementedError

    def sensed(self) -> Floats:
        """(sensed_numbers,) that encoders measure, of the order of 1."""
        raise NotImplementedError

    @property
    def steps_played(self) -> int:
        """See `JudgedEnv.steps_played`."""
        return self._steps

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """A new episode."""
        super().reset(seed=seed)
        rules: dict[str, Rule] = {
            "split": checked_split,
            "episode": lambda value, name: value,
            "level": lambda value, name: checked_levels(value)[0],
        }
        given = checked_options(options, rules)
        split = given.get("split", self.split)
        self._number = drawn_number(self.np_random, split, given)
        lowest, highest = self.levels
        drawn = int(self.np_random.integers(lowest, highest + 1))
        self.level = given.get("level", drawn)
        mujoco = import_mujoco()
        mujoco.mj_resetData(self.model, self.data)
        brightness = self.arrange(episode_generator(split, self._number, self.stream), self.level)
        self._lamps.shine(brightness)
        mujoco.mj_forward(self.model, self.data)
        self._steps = 0
        self._verdict = self.verdict()
        return self._observed(), self._info()

    def step(self, action: ArrayLike) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """A millisecond."""
        before = self._begun()
        mujoco = import_mujoco()
        self.drive(checked_action(action, self.actions))
        for _ in range(self._substeps):
            mujoco.mj_step(self.model, self.data)
            self.watch()
        self._steps += 1
        now = self._verdict = self.verdict()
        reward = PROGRESS * (now.worth - before.worth) + OUTCOME * (now.end is True)
        over = now.end is not None
        truncated = not over and self._steps >= self.most_steps
        return self._observed(), float(reward), over, truncated, self._info()

    def ends_of(self, seed: int, most: int | None = None) -> tuple[float, float]:
        """See `JudgedEnv.ends_of`."""
        if self._twin is None:
            self._twin = type(self)(level=self.levels, split=self.split, shape=self.shape)
        other, still = self._twin, np.zeros(self.actions, np.float32)
        nothing, best = (other.played(seed, act, most) for act in (lambda: still, other.best_action))
        return nothing, best

    def played(self, seed: int, act: Any, most: int | None = None) -> float:
        """Play the episode of a seed, without a camera.

        Args:
            seed: of the episode.
            act: () -> action of the next step.
            most: steps at most.

        Returns:
            The performance at its end.
        """
        self.reset(seed=seed)
        over = False
        while not over and self._steps < (most or self.most_steps):
            _, _, terminated, truncated, _ = self.step(act())
            over = terminated or truncated
        return float(self._begun().performance)

    def render(self) -> NDArray[np.uint8] | None:
        """(H, W, 3) uint8 in colour, or None without a render mode."""
        if self.render_mode is None:
            return None
        self._begun()
        if self._pictures is None:
            factor = max(1, RENDERED_SIDE // max(self.shape))
            self._pictures = MujocoPictures(self.model, (self.shape[0] * factor, self.shape[1] * factor), EYE)
        return self._pictures.colour(self.data)

    def close(self) -> None:
        """Give OpenGL's context back; may be called again."""
        if self._pictures is not None:
            self._pictures.close()

    def places(self, points: Floats) -> Floats:
        """(..., 2) x, y [pixels] at which points (..., 3) of the world are seen."""
        camera, (rows, columns) = self.model.camera(EYE).id, self.shape
        right, up, back = self.data.cam_xmat[camera].reshape(3, 3).T
        scale = np.full(2, rows / 2 / np.tan(np.radians(self.model.cam_fovy[camera]) / 2))
        centre = np.array([columns - 1, rows - 1]) / 2
        axes = np.stack([right, up, -back])
        lens = Projection(self.data.cam_xpos[camera], axes, scale, centre, near=1e-6, far=np.inf, orthographic=False)
        return lens.places(lens.in_camera(points))

    def _begun(self) -> Verdict:
        if self._verdict is None:
            raise NotReadyError("the environment has not begun; call reset first")
        return self._verdict

    def _observed(self) -> NDArray[np.float32]:
        return np.asarray(self.sensed(), np.float32)

    def _info(self) -> dict[str, Any]:
        now = self._begun()
        target, agent = self.places(np.stack(self.target()))
        return {
            "performance": float(now.performance),
            "is_success": now.end is True,
            "target": np.clip(target, -1.0, max(self.shape)),
            "distance_px": float(np.hypot(*(target - agent))),
            "level": self.level,
            "episode_number": self._number,
        }


def checked_levels(level: Any) -> tuple[int, int]:
    """The lowest and the highest level.

    Raises:
        InputError: for anything but a level, or a lowest and a highest one.

    Example:
        >>> checked_levels(3), checked_levels((1, 5))
        ((3, 3), (1, 5))
    """
    both = level if isinstance(level, (tuple, list)) else (level, level)
    if len(both) != 2:
        raise InputError(f"level is {shown(level)}; give one from 1 to 5, or the lowest and the highest")
    lowest, highest = (checked_whole(one, "level", LEVELS[0], LEVELS[-1]) for one in both)
    if lowest > highest:
        raise InputError(f"level is {shown(level)}; give the lowest, then the highest")
    return lowest, highest


class _Lamps:
    """The brightness of a model's lamps, beside that with which it was loaded."""

    def __init__(self, model: Any) -> None:
        head = model.vis.headlight
        self._colours = [head.ambient, head.diffuse, head.specular]
        self._colours += [model.light_ambient, model.light_diffuse, model.light_specular]
        self._loaded = [np.array(colour) for colour in self._colours]

    def shine(self, brightness: float) -> None:
        """Set them; 1 is as loaded."""
        for colour, loaded in zip(self._colours, self._loaded, strict=True):
            colour[:] = brightness * loaded
