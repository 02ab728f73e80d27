"""Wrappers of environments, and their twins for vectors.

`SB3Cameras` is imported when it is first used: stable-baselines3 is an optional package.
"""

from typing import Any

from spikecam_env.envs.wrappers.any_env import SpikeCamera
from spikecam_env.envs.wrappers.observe import ObserveSpikes, VectorObserveSpikes
from spikecam_env.envs.wrappers.progress import ProgressReward, VectorProgressReward
from spikecam_env.envs.wrappers.randomize import RandomizeLight, RandomizeSensor

__all__ = [
    "ObserveSpikes",
    "ProgressReward",
    "RandomizeLight",
    "RandomizeSensor",
    "SpikeCamera",
    "VectorObserveSpikes",
    "VectorProgressReward",
]


def __getattr__(name: str) -> Any:
    if name == "SB3Cameras":
        from spikecam_env.envs.wrappers.sb3 import SB3Cameras

        return SB3Cameras
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
