"""The ids of the environments.

import gymnasium, spikecam_env.envs
env = gymnasium.make("spikecam_env/RotatingDisk-v0", frames_per_step=40)
"""

from __future__ import annotations

from typing import Any

import gymnasium

SCENE = "spikecam_env.envs.scene:SceneEnv"

NAMED = (
    "Ball",
    "Car",
    "Collage",
    "Cook",
    "Dice",
    "Disk",
    "Doll",
    "Fan",
    "Fly",
    "Hand",
    "Jump",
    "Poker",
    "Text",
    "Top",
    "Train",
    "Tumble",
)
"""Scenes of the catalogue that have an id of their own, e.g. `spikecam_env/Fan-v0`."""

ENVIRONMENTS: dict[str, tuple[str, dict[str, Any]]] = {
    "spikecam_env/RotatingDisk-v0": ("spikecam_env.envs.rotating_disk:RotatingDiskEnv", {}),
    "spikecam_env/Scene-v0": (SCENE, {}),
} | {f"spikecam_env/{name}-v0": (SCENE, {"scene": name.lower()}) for name in NAMED}
"""Id -> where its class is, and what it is made with.  `Scene-v0` is a random world, or what `scene=` says."""

MAX_EPISODE_STEPS = 500


def register() -> None:
    """Register every id that is not registered yet."""
    for name, (entry_point, options) in ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point,
                max_episode_steps=MAX_EPISODE_STEPS,
                kwargs=options,
                vector_entry_point=f"spikecam_env.envs.vector_of:{entry_point.replace(':', '.')}",
            )
