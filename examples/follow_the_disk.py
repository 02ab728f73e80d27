"""An agent that sees through the camera: it turns after a spinning disk by the centre of change.

run:  python examples/follow_the_disk.py
"""

from __future__ import annotations

import gymnasium
import numpy as np

import spikecam_env  # noqa: F401  (registers the environments)
from denoiser import DenoiseObservation

STEPS = 60


def where_it_spins(rates: np.ndarray) -> tuple[float, float]:
    """Centre (x, y) of the change within a block of rate planes (K, H, W), from the middle of the picture."""
    change = np.abs(rates[-1] - rates[0])
    change = np.where(change > 0.1, change, 0.0)
    total = change.sum()
    if total == 0:
        return 0.0, 0.0
    rows, columns = change.shape
    x = (change.sum(axis=0) @ np.arange(columns)) / total - (columns - 1) / 2
    y = (change.sum(axis=1) @ np.arange(rows)) / total - (rows - 1) / 2
    return float(x), float(y)


def episode(follow: bool) -> float:
    env = gymnasium.make("spikecam_env/RotatingDisk-v0", shape=(96, 128), frames_per_step=64)
    env = DenoiseObservation(env, mode="best", output="rate")
    rates, _ = env.reset(seed=3)
    rewards = []
    for _ in range(STEPS):
        x, y = where_it_spins(rates) if follow else (0.0, 0.0)
        rates, reward, terminated, truncated, _ = env.step(np.clip(np.array([x, y]) / 20, -1, 1).astype(np.float32))
        rewards.append(reward)
        if terminated or truncated:
            break
    return float(np.mean(rewards))


print(f"mean reward standing still: {episode(follow=False):.3f}")
print(f"mean reward following:      {episode(follow=True):.3f}")
