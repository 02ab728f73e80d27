"""Who acts: a baseline of `envs.score`, or a trained agent by its name or file."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.cli.live.keys import action_of
from spikecam_env.envs.aiming import AimingEnv
from spikecam_env.envs.score import BASELINES, Policy
from spikecam_env.errors import InputError, unknown_name


@dataclass(frozen=True)
class Player:
    """act: see `envs.score.Policy`; begin: called before each episode; sees: keywords of the environment it needs."""

    act: Policy
    begin: Callable[[], object] = tuple
    sees: tuple[tuple[str, Any], ...] = (("obs", "tfp"),)


def player(name: str) -> Player:
    """A baseline by name, or an agent.

    Raises InputError for an unknown name, an unusable file, and an agent where the package comes without them.
    """
    if name in BASELINES:
        return Player(BASELINES[name])
    agent = _agents(name).load(name)
    return Player(lambda seen, env: agent.act(seen), agent.begin, (("obs", agent.obs), ("obs_state", True)))


def steering(held: Iterable[str]) -> Policy:
    """Whoever holds these keys down: the action of a step is that of the keys as they are when it begins."""

    def act(seen: Any, env: AimingEnv) -> NDArray[np.float32]:
        return action_of(held, env.axes, env.action_space.shape[0] - env.axes)  # type: ignore[index]

    return act


def _agents(name: str) -> Any:
    """The class of trained agents; torch is imported with it."""
    try:
        return import_module("spikecam_env.agents.agent").Agent
    except ModuleNotFoundError as error:
        if error.name is None or not error.name.startswith("spikecam_env.agents"):
            raise InputError(f"an agent needs {error.name}, which is not installed") from error
        raise unknown_name("policy", name, BASELINES) from error
