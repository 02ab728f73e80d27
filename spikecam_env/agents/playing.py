"""What acts, on test episodes: the policy that `envs.score` plays, and the score that it reaches."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Protocol

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.envs.aiming import AimingEnv
from spikecam_env.envs.score import Policy, ends, play, score

EPISODES = {"Catch": 100, "Saccade": 50, "ReadSpin": 50}
"""Of the test split, those of the first seeds; others 10, which are long: each has 500 steps."""


class Actor(Protocol):
    """`Agent` or `Tracker`."""

    def begin(self) -> None:
        """Forget what was seen: an episode begins."""

    def act(self, observation: Any) -> NDArray[np.float32]:
        """The action."""


def policy_of(actor: Actor) -> Policy:
    """As `envs.score.play` takes it."""

    def policy(observation: Any, env: AimingEnv) -> ArrayLike:
        if env.standing.step == 0:
            actor.begin()
        return actor.act(observation)

    return policy


def score_of(actor: Actor, env: gymnasium.Env[Any, Any], episodes: int) -> float:
    """On the episodes of seeds 0, 1, ...; env: of the test split."""
    reached = play(env, policy_of(actor), range(episodes)).performance
    inner: Any = env.unwrapped
    return score(reached, *_ends(inner.task, inner.shape, inner.frames_per_step, episodes))


def episodes_of(task: str) -> int:
    """How many judge an agent; task: an id."""
    return EPISODES.get(task.split("-")[0], 10)


def episodes_along(episodes: int) -> int:
    """How many of so many judge each agent on the way: a quarter, and four or more where there are four.

    >>> episodes_along(100), episodes_along(10), episodes_along(2)
    (25, 4, 2)
    """
    return min(episodes, max(4, episodes // 4))


@lru_cache(maxsize=64)
def _ends(task: Any, shape: tuple[int, int], frames_per_step: int, episodes: int) -> tuple[float, float]:
    """Performance of doing nothing and of the oracle, who do not look at pictures."""
    from spikecam_env.envs.tasks.env import TaskEnv

    env = TaskEnv(task, shape=shape, frames_per_step=frames_per_step, split="test")
    try:
        return ends(env, range(episodes))
    finally:
        env.close()
