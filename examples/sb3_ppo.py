"""PPO of stable-baselines3 learns a task from TFP pictures; prints its score on test episodes.

run:  pip install 'spikecam-env[sb3]';  python examples/sb3_ppo.py --task Track-v1 --steps 200000
"""

from __future__ import annotations

import argparse

from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import SubprocVecEnv, VecEnv, VecFrameStack

import spikecam_env.envs  # noqa: F401  (registers the tasks)
from spikecam_env.agents import evaluate

PICTURES = 3  # the last ones, so that motion is seen


def learned(task: str, steps: int, count: int = 8, rollout: int = 128, vector: type[VecEnv] | None = None) -> PPO:
    env = VecFrameStack(make_vec_env(f"spikecam_env/{task}", count, 0, vec_env_cls=vector), PICTURES)
    model = PPO("CnnPolicy", env, n_steps=rollout, batch_size=256, n_epochs=4, gamma=0.98, learning_rate=3e-4, seed=0)
    model.learn(steps)
    env.close()
    return model


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--task", default="Track-v1")
    options.add_argument("--steps", type=int, default=200_000)
    options.add_argument("--episodes", type=int, default=10)
    options.add_argument("--processes", action="store_true", help="a process a camera; by default all in this one")
    given = options.parse_args()
    model = learned(given.task, given.steps, vector=SubprocVecEnv if given.processes else None)
    print(evaluate(model, given.task, stack=PICTURES, episodes=given.episodes))
