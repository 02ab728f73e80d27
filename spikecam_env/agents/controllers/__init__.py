"""Classical players, which learn nothing: a file each, and which of them plays a task.

A controller is made for an environment and acts like an `Agent`: `begin` an episode, then `act(observation)`.
Observations are of `obs="tfp"`; tasks that turn a camera have the gaze beside it, MuJoCo tasks their encoders.
Players of ANY_CAMERA read grey pictures of any camera, by the time at which they were taken (`timing`).
"""

from __future__ import annotations

from pkgutil import resolve_name
from typing import Any

import gymnasium
import numpy as np

from spikecam_env.agents.agent import state_keywords
from spikecam_env.agents.controllers.timing import PictureTiming
from spikecam_env.agents.playing import Actor
from spikecam_env.agents.tracker import FINDERS
from spikecam_env.envs.observations import CameraView, FrameCamera, Observation, Spikes, observation
from spikecam_env.envs.wrappers.any_env import spike_camera_of
from spikecam_env.errors import InputError, unknown_name

TRACKER = "spikecam_env.agents.tracker:Tracker"
HERE = "spikecam_env.agents.controllers"

CONTROLLERS = dict.fromkeys(FINDERS, TRACKER) | {
    "Return": f"{HERE}.return_ball:ReturnController",
    "Balance": f"{HERE}.balance:BalanceController",
    "Dodge": f"{HERE}.dodge:DodgeController",
    "Read": f"{HERE}.read:ReadController",
}
"""By task: place of its controller."""
ANY_CAMERA = ("Return", "Read")
"""Tasks whose controllers read grey pictures of any camera; others read those of the spike camera."""


def classical(env: gymnasium.Env[Any, Any]) -> Actor:
    """The classical player of an environment's task, for the camera that the environment has.

    Args:
        env: an environment, wrapped or bare; a bare MuJoCo task has the spike camera of its defaults.

    Raises:
        InputError: for a task that none can play, and a camera that its player cannot read.

    Example:
        >>> import gymnasium
        >>> type(classical(gymnasium.make("spikecam_env/Catch-v1"))).__name__
        'Tracker'
    """
    bare: Any = env.unwrapped
    task, camera = type(getattr(bare, "task", bare)).__name__, spike_camera_of(env)
    if task not in CONTROLLERS:
        raise unknown_name("task of a classical controller", task, CONTROLLERS)
    if camera is not None:
        check_reads(task, camera.observation)
    timing = (PictureTiming.of(env),) if task in ANY_CAMERA else ()
    actor: Actor = resolve_name(CONTROLLERS[task])(bare, *timing)
    return actor


def classical_sees(task: str, obs: str | Observation = "tfp") -> dict[str, Any]:
    """Keywords of the environment that a task's classical player needs.

    Args:
        task: an id, with or without `spikecam_env/`.
        obs: through which camera it plays.

    Example:
        >>> classical_sees("Return-v1", "frame120")
        {'obs': 'frame120', 'obs_state': True, 'obs_inner': True}
    """
    return {"obs": obs, **state_keywords(task.removeprefix("spikecam_env/"))}


def check_reads(task: str, obs: str | Observation) -> None:
    """Check that a task's classical player can read an observation.

    Args:
        task: name of the task, without version.
        obs: name of the observation, or the law.

    Raises:
        InputError: it cannot.

    Example:
        >>> check_reads("Read", "frame120")
    """
    law = observation(obs)
    space, is_any = law.space(CameraView((2, 2), 40)), task in ANY_CAMERA
    is_grey = space.shape == (1, 2, 2) and space.dtype == np.uint8
    is_read = is_any or not isinstance(law, FrameCamera) if is_grey else task == "Read" and isinstance(law, Spikes)
    if not is_read:
        readable = "grey pictures: tfp, rate, frame120 ..." if is_any else "pictures of a spike camera: tfp, rate ..."
        name = obs if isinstance(obs, str) else type(obs).__name__
        raise InputError(f"the classical player of {task} cannot read {name}; give it {readable}")
