"""Who acts: a baseline of `envs.score`, or a trained agent by its name or file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.cli.live.keys import action_of
from spikecam_env.envs.aiming import AimingEnv
from spikecam_env.envs.score import BASELINES, Policy
from spikecam_env.errors import unknown_name


@dataclass(frozen=True)
class Player:
    """Who acts in an environment."""

    act: Policy
    sees: tuple[tuple[str, Any], ...] = (("obs", "tfp"),)
    """Keywords of the environment that it needs."""
    actions: int | None = None
    """Numbers of its action; None where it suits every environment."""


def player(name: str, task: str) -> Player:
    """A baseline, the classical player of a task, or an agent, by its name or its file; task: an id."""
    if name in BASELINES:
        return Player(BASELINES[name])
    if name == "classical":
        from spikecam_env.agents.controllers import classical_policy

        act, sees = classical_policy(task)
        return Player(act, tuple(sees.items()))
    from spikecam_env.agents.agent import Agent, is_file, shipped
    from spikecam_env.agents.playing import acting

    if not is_file(name) and name not in shipped():
        raise unknown_name("policy", name, (*BASELINES, "classical", *shipped()))
    agent = Agent.load(name)
    return Player(acting(agent), tuple(agent.sees.items()), agent.policy.recipe.actions)


def steering(held: Iterable[str]) -> Policy:
    """Whoever holds these keys down: the action of a step is that of the keys as they are when it begins."""

    def act(seen: Any, env: Any) -> NDArray[np.float32]:
        return action_of(held, env.axes, _further(env), env.answers)

    return act


def _further(env: AimingEnv) -> int:
    """Numbers of the action after those that turn the camera."""
    (count,) = env.action_space.shape or (0,)
    return count - env.axes
