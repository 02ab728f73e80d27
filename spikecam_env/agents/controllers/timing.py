"""When a camera's pictures were taken: classical players need the middle of an exposure, and its length.

middle = now - age - exposure / 2        age: of the newest light in the picture
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import gymnasium
import numpy as np

from spikecam_env.envs.mujoco_tasks.task import STEP_S
from spikecam_env.envs.wrappers.any_env import USUAL_BLOCK, spike_camera_of


class PictureTiming(NamedTuple):
    """Of the pictures of a camera before a MuJoCo task.

    Example:
        >>> PictureTiming(8.0).middle_step({"age": np.array([0.0])}, step=3)
        2.9
    """

    exposure_frames: float
    """Of the camera's frames, from which a picture is made."""
    frames_a_step: float = float(USUAL_BLOCK)
    planes: int = 1
    """Of an observation: 1 of a picture, the frames of a block of spikes."""

    @classmethod
    def of(cls, env: gymnasium.Env[Any, Any]) -> PictureTiming:
        """Of the environment's camera; without one, of the spike camera that its task has by default.

        Args:
            env: a MuJoCo task, with its camera or bare.

        Example:
            >>> from spikecam_env.envs.mujoco_tasks import make_task
            >>> env = make_task("Read", obs="frame120")
            >>> round(PictureTiming.of(env).exposure_steps, 2), PictureTiming.of(env.unwrapped).exposure_steps
            (8.33, 0.2)
            >>> env.close()
        """
        camera = spike_camera_of(env)
        if camera is None:
            return cls(float(getattr(env, "camera_defaults", {}).get("block_frames", USUAL_BLOCK)))
        law, view = camera.observation, camera.view
        return cls(law.exposure(view), STEP_S * view.frame_rate_hz, (law.space(view).shape or (1,))[0])

    @property
    def exposure_steps(self) -> float:
        """Exposure of a picture [steps]."""
        return self.exposure_frames / self.frames_a_step

    def middle_step(self, observation: Mapping[str, Any], step: int) -> float:
        """The middle of the exposure of an observation's picture [steps]; NaN before the first whole picture.

        Args:
            observation: with the picture's `age`, if it can be other than 0.
            step: at whose end it is observed.
        """
        age = float(np.ravel(observation.get("age", 0.0))[0])
        return float("nan") if age < 0 else step - (age + self.exposure_frames / 2) / self.frames_a_step
