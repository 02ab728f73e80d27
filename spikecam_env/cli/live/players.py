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
    """act: see `envs.score.Policy`; sees: keywords of the environment it needs.

    actions: numbers of its action, None where it suits every environment.
    """

    act: Policy
    sees: tuple[tuple[str, Any], ...] = (("obs", "tfp"),)
    actions: int | None = None


def player(name: str) -> Player:
    """A baseline by name, or an agent, whose code, torch's too, is imported with it.

    Raises InputError for an unknown name, an unusable file, and a task's agent that does not come with the package.
    """
    if name in BASELINES:
        return Player(BASELINES[name])
    from spikecam_env.agents.agent import Agent, is_file, shipped
    from spikecam_env.agents.playing import acting

    if not is_file(name) and name not in shipped():
        raise unknown_name("policy", name, (*BASELINES, *shipped()))
    agent = Agent.load(name)
    sees = (("obs", agent.obs), ("obs_state", True))
    return Player(acting(agent), sees, agent.policy.recipe.actions)


def steering(held: Iterable[str]) -> Policy:
    """Whoever holds these keys down: the action of a step is that of the keys as they are when it begins."""

    def act(seen: Any, env: AimingEnv) -> NDArray[np.float32]:
        return action_of(held, env.axes, _further(env), env.answers)

    return act


def _further(env: AimingEnv) -> int:
    """Numbers of the action after those that turn the camera."""
    (count,) = env.action_space.shape or (0,)
    return count - env.axes
