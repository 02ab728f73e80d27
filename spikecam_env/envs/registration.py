"""The ids of the environments.

import gymnasium, spikecam_env.envs
env = gymnasium.make("spikecam_env/RotatingDisk-v0", frames_per_step=40)
"""

from __future__ import annotations

import gymnasium

ENVIRONMENTS = {
    "spikecam_env/RotatingDisk-v0": "spikecam_env.envs.rotating_disk:RotatingDiskEnv",
}
"""Id -> where its class is."""

MAX_EPISODE_STEPS = 500


def register() -> None:
    """Register every id that is not registered yet."""
    for name, entry_point in ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point, max_episode_steps=MAX_EPISODE_STEPS)
