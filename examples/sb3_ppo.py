"""PPO of stable-baselines3 learns a task from TFP pictures; prints its score on test episodes, as `envs.score` has it.

run:  pip install 'spikecam-env[sb3]';  python examples/sb3_ppo.py --task Track-v1 --steps 200000
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import SubprocVecEnv, VecEnv, VecFrameStack

import spikecam_env.envs  # noqa: F401  (registers the tasks)
from spikecam_env.envs.score import evaluate, score

PICTURES = 3  # the last ones, so that motion is seen


def cameras(task: str, count: int, seed: int, split: str, vector: type[VecEnv] | None = None) -> VecEnv:
    options = {"obs": "tfp", "split": split}
    env = make_vec_env(f"spikecam_env/{task}", count, seed, env_kwargs=options, vec_env_cls=vector)
    return VecFrameStack(env, PICTURES)


def learned(task: str, steps: int, count: int = 8, rollout: int = 128, vector: type[VecEnv] | None = None) -> PPO:
    env = cameras(task, count, 0, "train", vector)
    model = PPO("CnnPolicy", env, n_steps=rollout, batch_size=256, n_epochs=4, gamma=0.98, learning_rate=3e-4, seed=0)
    model.learn(steps)
    env.close()
    return model


def performance(task: str, act: Callable[[np.ndarray], Any], episodes: int) -> float:
    """Mean over test episodes of what `info` says at their end."""
    env = cameras(task, 1, 0, "test")
    ended: list[float] = []
    seen = env.reset()
    while len(ended) < episodes:
        seen, _, over, infos = env.step(act(seen))
        ended += [info["performance"] for info, is_over in zip(infos, over, strict=True) if is_over]
    env.close()
    return float(np.mean(ended))


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--task", default="Track-v1")
    options.add_argument("--steps", type=int, default=200_000)
    options.add_argument("--episodes", type=int, default=10)
    options.add_argument("--processes", action="store_true", help="a process a camera; by default all in this one")
    given = options.parse_args()
    model = learned(given.task, given.steps, vector=SubprocVecEnv if given.processes else None)
    mine = performance(given.task, lambda seen: model.predict(seen, deterministic=True)[0], given.episodes)
    ends = evaluate([f"spikecam_env/{given.task}"], given.episodes)[0]
    print(f"{given.task}: performance {mine:.3f}, score {score(mine, ends['nothing'], ends['oracle']):.3f}")
