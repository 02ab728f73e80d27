"""Steps a second of cameras in stable-baselines3: one native vector against its own vector of single environments.

spikecam bench env
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from functools import partial
from importlib.util import find_spec
from typing import Any

import gymnasium
import numpy as np

import spikecam_env.envs  # noqa: F401

OPTIONS: dict[str, Any] = {"shape": (64, 64), "frames_per_step": 40, "obs": "tfp"}
TASK = "spikecam_env/Track-v1"
ENVIRONMENTS = 16
ROUNDS = 3
ROLLOUT = 16
"""Steps of each environment in a round; PPO learns from as many at once."""


def bench_learners(count: int = ENVIRONMENTS, rollout: int = ROLLOUT, rounds: int = ROUNDS) -> list[dict[str, Any]]:
    """Steps of 40 frames of 64 x 64 pixels of Track, all environments together, by the clock.

    Args:
        count: number of environments.
        rollout: steps of each in a round.
        rounds: number of rounds, in which the vectors are measured in turn.

    Returns:
        A row for each vector: steps/s of the vector alone, and of PPO with its usual network, which learns from it;
        x DummyVecEnv of both.  Figures are medians over rounds, ratios within one.  No rows where stable-baselines3 is
        not installed.

    Example:
        >>> [row["vector"] for row in bench_learners(count=2, rollout=2, rounds=1)]
        ['DummyVecEnv', 'SB3Cameras']
    """
    if find_spec("stable_baselines3") is None:
        return []
    from stable_baselines3 import PPO

    names, taken = list(_vectors()), []
    with closing(_vectors()[names[0]](count)) as dummy, closing(_vectors()[names[1]](count)) as native:
        models = [
            PPO("CnnPolicy", env, n_steps=rollout, batch_size=count * rollout, n_epochs=1, seed=0)
            for env in (dummy, native)
        ]
        for _ in range(rounds):
            alone = [_seconds(partial(_played, env, rollout)) for env in (dummy, native)]
            learned = [_seconds(partial(model.learn, count * rollout)) for model in models]
            taken.append([alone, learned])
    steps, seconds = count * rollout, np.array(taken)  # (rounds, alone or learned, vectors)
    return [
        {
            "vector": name,
            "environments": count,
            "steps/s": steps / float(np.median(seconds[:, 0, n])),
            "x DummyVecEnv": float(np.median(seconds[:, 0, 0] / seconds[:, 0, n])),
            "steps/s with PPO": steps / float(np.median(seconds[:, 1, n])),
            "x DummyVecEnv, PPO": float(np.median(seconds[:, 1, 0] / seconds[:, 1, n])),
        }
        for n, name in enumerate(names)
    ]


def _vectors() -> dict[str, Callable[[int], Any]]:
    """Functions that make a vector of so many environments, by name."""
    from stable_baselines3.common.env_util import make_vec_env

    from spikecam_env.envs.wrappers import SB3Cameras

    def native(count: int) -> Any:
        mode = "vector_entry_point"
        return SB3Cameras(gymnasium.make_vec(TASK, count, mode, autoreset_mode="SameStep", **OPTIONS))

    return {"DummyVecEnv": lambda count: make_vec_env(TASK, count, seed=0, env_kwargs=OPTIONS), "SB3Cameras": native}


def _played(env: Any, steps: int) -> None:
    env.reset()
    still = np.zeros((env.num_envs, *env.action_space.shape), np.float32)
    for _ in range(steps):
        env.step(still)


def _seconds(call: Callable[[], Any]) -> float:
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin
