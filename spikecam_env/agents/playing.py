"""Policies of every form, as `envs.score` plays them, and the score of one."""

from __future__ import annotations

from collections.abc import Sequence
from inspect import signature
from typing import Any, Protocol

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.envs.evaluation import Evaluation
from spikecam_env.envs.judged import JudgedEnv
from spikecam_env.envs.registration import MUJOCO_NAMES
from spikecam_env.envs.score import BASELINES, Policy, ends, play
from spikecam_env.errors import InputError, shown

EPISODES = {"Catch": 100, "Saccade": 50, "ReadSpin": 50} | dict.fromkeys(MUJOCO_NAMES, 50)
"""Of the test split, those of the first seeds; others 10, which are long: each has 500 steps."""


class Actor(Protocol):
    """`Agent` or `Tracker`."""

    def begin(self) -> None:
        """Forget all observations: an episode begins."""

    def act(self, observation: Any) -> NDArray[np.float32]:
        """The action."""


def policy_of(policy: Any) -> tuple[Policy, dict[str, Any]]:
    """A policy of `agents.evaluate` as `envs.score.play` takes it, and the keywords of its environment.

    Raises:
        InputError: for anything that cannot act.
    """
    if isinstance(policy, str):
        if policy in BASELINES:
            return BASELINES[policy], {}
        from spikecam_env.agents.agent import Agent  # torch takes seconds

        policy = Agent.load(policy)
    if isinstance(policy, type):
        raise InputError(f"policy is the class {policy.__name__}; give an instance of it")
    if hasattr(policy, "begin") and hasattr(policy, "act"):
        return acting(policy), dict(getattr(policy, "sees", {}))
    if hasattr(policy, "predict"):
        return _predicting(policy), {}
    if callable(policy):
        return lambda seen, env: policy(seen), {}
    raise InputError(
        f"policy is {shown(policy)}; give a callable, a model with predict, an Agent, or a name: {', '.join(BASELINES)}"
    )


def acting(actor: Actor) -> Policy:
    """An actor, which forgets at the beginning of every episode."""

    def policy(observation: Any, env: JudgedEnv) -> ArrayLike:
        if env.steps_played == 0:
            actor.begin()
        return actor.act(observation)

    return policy


def _predicting(model: Any) -> Policy:
    """The deterministic actions of a model with `predict`, and its memory if it has one."""
    known = signature(model.predict).parameters
    memory: list[Any] = [None]

    def policy(observation: Any, env: JudgedEnv) -> ArrayLike:
        begins = env.steps_played == 0
        memory[0] = None if begins else memory[0]
        given = {"state": memory[0], "episode_start": np.array([begins]), "deterministic": True}
        answer = model.predict(observation, **{name: value for name, value in given.items() if name in known})
        action, memory[0] = answer if isinstance(answer, tuple) else (answer, None)
        return np.asarray(action)

    return policy


def judged(
    policy: Policy, env: gymnasium.Env[Any, Any], seeds: Sequence[int], *, progress: bool | None = False
) -> Evaluation:
    """The policy's episodes of these seeds, beside those of nothing and the oracle."""
    played = play(env, policy, seeds, progress)
    spec = env.spec
    task = type(env.unwrapped).__name__ if spec is None else spec.id.removeprefix("spikecam_env/")
    nothing, best = ends(env, seeds)
    return Evaluation.of(
        task,
        played.performances,
        nothing,
        best,
        success=played.success,
        returns=played.returns,
        camera_bits_s=played.camera_bits_s,
    )


def score_of(actor: Actor, env: gymnasium.Env[Any, Any], episodes: int) -> float:
    """On the episodes of seeds 0, 1, ...; env: of the test split."""
    return judged(acting(actor), env, range(episodes)).score


def episodes_of(task: str) -> int:
    """How many judge an agent; task: an id."""
    return EPISODES.get(task.removeprefix("spikecam_env/").split("-")[0], 10)


def episodes_along(episodes: int) -> int:
    """Episodes that judge each agent on the way, of those that judge the last: a quarter, but four if there are four.

    Example:
        >>> episodes_along(100), episodes_along(10), episodes_along(2)
        (25, 4, 2)
    """
    return min(episodes, max(4, episodes // 4))
