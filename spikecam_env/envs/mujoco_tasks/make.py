"""A MuJoCo task by its name, with a spike camera before it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from scenes.mujoco import MujocoLight
from scenes.mujoco.light import MOTION_PER_KEY
from spikecam_env.envs.mujoco_tasks.balance import Balance
from spikecam_env.envs.mujoco_tasks.dodge import Dodge
from spikecam_env.envs.mujoco_tasks.read import Read
from spikecam_env.envs.mujoco_tasks.return_ball import Return
from spikecam_env.envs.mujoco_tasks.task import EYE, MIDDLE_LEVEL, MujocoTask
from spikecam_env.envs.observations import CameraView
from spikecam_env.envs.wrappers.any_env import SpikeCamera
from spikecam_env.errors import unknown_name

MUJOCO_TASKS: dict[str, type[MujocoTask]] = {"Return": Return, "Dodge": Dodge, "Balance": Balance, "Read": Read}
"""By name."""
SUPERSAMPLE = 2
"""Samples a pixel and axis: light of moving edges is then 1.9 % rms from that of eight times as many keys and 4 x 4
samples, at 1.2 to 1.9 times the steps a second (`python -m benchmarks.mujoco_light`)."""


OWN_KEYWORDS = ("level", "split", "shape", "render_mode", "supersample")
CAMERA_KEYWORDS = (
    *("obs", "obs_state", "obs_inner", "model", "block_frames"),
    *("scale", "mean_interval", "engine", "threads", "motion_per_key"),
)
"""Keywords of `make_task`; the latter go to `SpikeCamera`, and the last to the light."""


@dataclass(frozen=True)
class EyeLight:
    """Makes the light that falls into a task's camera; a value, so that Gymnasium can compare specifications."""

    supersample: int = SUPERSAMPLE
    motion_per_key: float = MOTION_PER_KEY

    def __call__(self, env: Any, view: CameraView) -> MujocoLight:
        options = {"supersample": self.supersample, "motion_per_key": self.motion_per_key}
        return MujocoLight.of_env(env, view, camera=EYE, **options)


def make_task(
    task: str,
    *,
    level: int | tuple[int, int] = MIDDLE_LEVEL,
    split: str = "train",
    shape: tuple[int, int] = (64, 64),
    render_mode: str | None = None,
    supersample: int = SUPERSAMPLE,
    **camera: Any,
) -> SpikeCamera:
    """The environment of an id such as `spikecam_env/Return-v1`.

    Args:
        task: a name of MUJOCO_TASKS.
        level: 1 to 5, or the lowest and the highest, of which every episode draws one.
        split: "train" or "test", of the episodes that `reset` draws.
        shape: (rows, columns).
        render_mode: "rgb_array" or None; of the scene in colour, as a person sees it.
        supersample: samples a pixel and axis of the light.
        camera: keywords of `SpikeCamera`: obs, obs_state, obs_inner, model, block_frames, scale, mean_interval, engine,
            threads; and motion_per_key of `MujocoLight`. A task may have `camera_defaults` of its own.

    Raises:
        InputError: for a value out of range or unknown, and where MuJoCo is missing.

    Example:
        >>> env = make_task("Return", level=1, split="test")
        >>> picture, info = env.reset(seed=0, options={"episode": 3})
        >>> picture.shape, info["level"], info["episode_number"]
        ((1, 64, 64), 1, 3)
        >>> env.close()
    """
    if task not in MUJOCO_TASKS:
        raise unknown_name("task", task, MUJOCO_TASKS)
    for name in camera:
        if name not in CAMERA_KEYWORDS:
            raise unknown_name("keyword", name, (*OWN_KEYWORDS, *CAMERA_KEYWORDS))
    inner = MUJOCO_TASKS[task](level=level, split=split, shape=shape, render_mode=render_mode)
    given = {"motion_per_key": MOTION_PER_KEY, **inner.camera_defaults, **camera}
    light = EyeLight(supersample, given.pop("motion_per_key"))
    return SpikeCamera(inner, shape=shape, make_light=light, **given)
