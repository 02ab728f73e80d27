"""Who acts: a baseline of `envs.score`, or a trained agent by its name or file."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from spikecam_env.cli.live.keys import action_of
from spikecam_env.envs.aiming import AimingEnv
from spikecam_env.envs.score import BASELINES, Policy
from spikecam_env.errors import unknown_name


@dataclass(frozen=True)
class Player:
    """Who acts in an environment."""

    act: Policy | None
    """None where it is made for an environment: `act_in`."""
    sees: tuple[tuple[str, Any], ...] = (("obs", "tfp"),)
    """Keywords of the environment that it needs."""
    actions: int | None = None
    """Numbers of its action; None where it suits every environment."""
    made_for: Callable[[gymnasium.Env[Any, Any]], Policy] | None = None
    """Environment, with its camera -> the policy."""

    def act_in(self, env: gymnasium.Env[Any, Any]) -> Policy:
        """The policy in an environment."""
        if self.act is not None:
            return self.act
        assert self.made_for is not None
        return self.made_for(env)


def player(name: str, task: str) -> Player:
    """A baseline, the classical player of a task, or an agent, by its name or its file.

    Args:
        name: of the player; classical-OBS is the classical player through another camera.
        task: an id.
    """
    if name in BASELINES:
        return Player(BASELINES[name])
    from spikecam_env.agents.agent import Agent, is_file, shipped
    from spikecam_env.agents.playing import acting

    who, _, obs = name.partition("-")
    if who == "classical":
        from spikecam_env.agents.controllers import classical, classical_sees

        sees = classical_sees(task, obs or "tfp")
        return Player(None, tuple(sees.items()), made_for=lambda env: acting(classical(env)))
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
