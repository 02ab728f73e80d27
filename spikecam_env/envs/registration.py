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
"""Id -> place of its class, and keywords.  `Scene-v0` is a random world, or the one that `scene=` names."""

MAX_EPISODE_STEPS = 500
"""Half a second at 40 frames a step and 40 kHz."""

TASK_NAMES = ("Track", "Saccade", "Catch", "ReadSpin", "ReadDigit", "LowLight", "Exposure")
"""As of `envs.tasks.TASKS`, which is not imported here: `import spikecam_env` registers, and imports nothing else."""

FULL_SHAPE = (250, 400)
"""Of the camera; the tasks are 64 x 64 without."""

TASK_ENVIRONMENTS: dict[str, tuple[str, dict[str, Any]]] = {
    f"spikecam_env/{name}{size}-v1": ("spikecam_env.envs.tasks.env:TaskEnv", {"task": name} | options)
    for name in TASK_NAMES
    for size, options in (("", {}), ("-Full", {"shape": FULL_SHAPE}))
}
"""As ENVIRONMENTS.  Their episodes end by themselves, in the task's time whatever `frames_per_step` is: so `spec` of an
environment that was made has the right `max_episode_steps`, and the registered one has none."""

MUJOCO_NAMES = ("Return", "Dodge", "Balance", "Read")
"""As of `envs.mujoco_tasks.MUJOCO_TASKS`: tasks of `pip install 'spikecam-env[mujoco]'`."""

MUJOCO_ENVIRONMENTS: dict[str, tuple[str, dict[str, Any]]] = {
    f"spikecam_env/{name}{size}-v1": ("spikecam_env.envs.mujoco_tasks:make_task", {"task": name} | options)
    for name in MUJOCO_NAMES
    for size, options in (("", {}), ("-Full", {"shape": FULL_SHAPE}))
}
"""As TASK_ENVIRONMENTS; many are stepped by Gymnasium's own vector environments."""

ALL_TASKS = TASK_ENVIRONMENTS | MUJOCO_ENVIRONMENTS
"""Those that an agent can learn and be scored on: with splits, an oracle and a performance."""

SMALL_TASKS = tuple(name for name in TASK_ENVIRONMENTS if "-Full" not in name)

OBSERVATIONS_ABOVE: dict[str, tuple[str, dict[str, Any]]] = {}
"""Observations of packages above the environments: name -> place of its class, and keywords.  `spikecam_env` fills it
when it is imported, as the root of the house knows both."""

HINTS_ABOVE = ("spikecam_env.envs.vector:whose_keyword", "spikecam_env.envs.tasks:whose_number")
"""Functions that say whose an unknown keyword of an environment is: `keywords` asks them in this order."""


def register() -> None:
    """Register every id that is not registered yet, each with the native vector environment of its class.

    Example:
        >>> import gymnasium
        >>> register()
        >>> "spikecam_env/Track-v1" in gymnasium.registry
        True
    """
    for name, (entry_point, options) in (ENVIRONMENTS | TASK_ENVIRONMENTS).items():
        if name not in gymnasium.registry:
            vector = f"spikecam_env.envs.vector:{entry_point.replace(':', '.')}"
            is_scene = name in ENVIRONMENTS
            steps, given = (MAX_EPISODE_STEPS, {**options, "steps": None}) if is_scene else (None, options)
            gymnasium.register(name, entry_point, max_episode_steps=steps, kwargs=given, vector_entry_point=vector)
    for name, (entry_point, options) in MUJOCO_ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point, kwargs=options)
