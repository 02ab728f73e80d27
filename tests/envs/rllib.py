"""`python -m tests.envs.rllib ID`: a round of RLlib's PPO on a local Ray cluster, in a process of its own."""

from __future__ import annotations

import logging
import os
import sys
from typing import Any

import gymnasium
import numpy as np

SIDE = 36
STEPS = 32


def made(config: dict[str, Any]) -> gymnasium.Env[Any, Any]:
    """RLlib's convolutions take floats with the channels last."""
    import spikecam_env.envs  # noqa: F401 - workers register the ids

    env = gymnasium.make(config["id"], shape=(SIDE, SIDE), frames_per_step=8, obs="tfp")
    space = gymnasium.spaces.Box(0.0, 1.0, (SIDE, SIDE, 1), np.float32)
    return gymnasium.wrappers.TransformObservation(
        env, lambda picture: np.moveaxis(picture, 0, -1).astype(np.float32) / 255, space
    )


def learned(name: str) -> int:
    """Steps that a worker took and the learner learned from."""
    import ray
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
    from ray.tune.registry import register_env

    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level=logging.ERROR)
    register_env("spikecam", made)
    config = (
        PPOConfig()
        .environment("spikecam", env_config={"id": name})
        .env_runners(num_env_runners=1, rollout_fragment_length=STEPS, sample_timeout_s=600)
        .training(train_batch_size_per_learner=STEPS, minibatch_size=STEPS, num_epochs=1)
        .rl_module(model_config=DefaultModelConfig(conv_filters=[[8, 4, 4], [8, 3, 3]]))
    )
    algorithm = config.build_algo()
    result = algorithm.train()
    algorithm.stop()
    ray.shutdown()
    assert result["learners"]["default_policy"]["num_module_steps_trained"] >= STEPS
    return int(result["env_runners"]["num_env_steps_sampled_lifetime"])


if __name__ == "__main__":
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    print(f"{sys.argv[1]}: {learned(sys.argv[1])} steps")
