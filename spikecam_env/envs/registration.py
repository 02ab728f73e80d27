"""The ids of the environments.

import gymnasium, spikecam_env.envs
env = gymnasium.make("spikecam_env/RotatingDisk-v0", frames_per_step=40)
"""

from __future__ import annotations

from typing import Any

import gymnasium

SCENE = "spikecam_env.envs.scene:SceneEnv"

ENVIRONMENTS: dict[str, tuple[str, dict[str, Any]]] = {
    "spikecam_env/RotatingDisk-v0": ("spikecam_env.envs.rotating_disk:RotatingDiskEnv", {}),
    "spikecam_env/Scene-v0": (SCENE, {}),
    "spikecam_env/Collage-v0": (SCENE, {"scene": "collage"}),
}
"""Id -> where its class is, and what it is made with.  Scenes of the catalogue by name; `Scene-v0` has any of them."""

MAX_EPISODE_STEPS = 500


def register() -> None:
    """Register every id that is not registered yet."""
    for name, (entry_point, options) in ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point, max_episode_steps=MAX_EPISODE_STEPS, kwargs=options)
