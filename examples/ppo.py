"""An agent learns to catch a ball that crosses its view in 5 to 20 ms, from the noisy spikes of a camera.

run:  python examples/ppo.py            (a minute of processor time: it catches nine balls in ten)
      python examples/ppo.py 4096       (so many steps, to see it run)
"""

from __future__ import annotations

import sys

import gymnasium
import torch

import spikecam_env  # noqa: F401  (registers the environments)
from denoiser.training.resumable_run import Run
from spikecam_env.agents import evaluate
from spikecam_env.agents.agent import Agent
from spikecam_env.agents.policy import PolicyRecipe
from spikecam_env.agents.ppo import PPO, train

STEPS = int(sys.argv[1]) if len(sys.argv) > 1 else 49_152
EPISODES = 100 if STEPS > 10_000 else 5

torch.manual_seed(0)
torch.set_num_threads(1)
cameras = gymnasium.make_vec(
    "spikecam_env/Catch-v1", num_envs=16, vectorization_mode="vector_entry_point", obs="tfp", obs_state=True
)
recipe = PolicyRecipe(channels=1, shape=(64, 64), high=255, lags=(0, 2, 5), actions=1)
policy = recipe.network()
run = Run.begin(policy)


def report() -> None:
    row = run.curve[-1]
    print(
        f"{row['steps']:7.0f} steps  {row['cpu_s']:5.0f} s  {100 * row['success']:3.0f} % caught in training",
        flush=True,
    )


train(cameras, run, PPO(steps=STEPS), seed=0, save=report)
cameras.close()

agent = Agent("Catch-v1", "tfp", policy)
print(evaluate(agent, "Catch-v1", episodes=EPISODES))  # 0 is doing nothing, 1 the oracle
agent.save("catch.pt")
