"""Classical players, which learn nothing: a file each, and which of them plays a task.

A controller is made for an environment and acts like an `Agent`: `begin` an episode, then `act(observation)`.
Observations are of `obs="tfp"`; tasks that turn a camera have the gaze beside it, MuJoCo tasks their encoders.
"""

from __future__ import annotations

from pkgutil import resolve_name
from typing import Any

from numpy.typing import ArrayLike

from spikecam_env.agents.agent import state_keywords
from spikecam_env.agents.playing import Actor, acting
from spikecam_env.agents.tracker import FINDERS
from spikecam_env.envs.judged import JudgedEnv
from spikecam_env.envs.score import Policy
from spikecam_env.errors import unknown_name

TRACKER = "spikecam_env.agents.tracker:Tracker"
HERE = "spikecam_env.agents.controllers"

CONTROLLERS = dict.fromkeys(FINDERS, TRACKER) | {
    "Return": f"{HERE}.return_ball:ReturnController",
    "Balance": f"{HERE}.balance:BalanceController",
    "Dodge": f"{HERE}.dodge:DodgeController",
    "Read": f"{HERE}.read:ReadController",
}
"""By task: place of its controller."""


def classical(env: Any) -> Actor:
    """The classical player of an environment's task.

    Args:
        env: a bare environment (`env.unwrapped`).

    Raises:
        InputError: for a task that none can play.

    Example:
        >>> import gymnasium
        >>> type(classical(gymnasium.make("spikecam_env/Catch-v1").unwrapped)).__name__
        'Tracker'
    """
    task = type(getattr(env, "task", env)).__name__
    if task not in CONTROLLERS:
        raise unknown_name("task of a classical controller", task, CONTROLLERS)
    actor: Actor = resolve_name(CONTROLLERS[task])(env)
    return actor


def classical_policy(task: str) -> tuple[Policy, dict[str, Any]]:
    """The classical player of a task, as `envs.score.play` takes it, and the keywords of its environment.

    Args:
        task: an id, with or without `spikecam_env/`.

    Example:
        >>> classical_policy("Return-v1")[1]
        {'obs': 'tfp', 'obs_state': True, 'obs_inner': True}
    """
    of_env: list[Policy] = []

    def act(observation: Any, env: JudgedEnv) -> ArrayLike:
        if not of_env:
            of_env.append(acting(classical(env)))
        return of_env[0](observation, env)

    return act, {"obs": "tfp", **state_keywords(task.removeprefix("spikecam_env/"))}
