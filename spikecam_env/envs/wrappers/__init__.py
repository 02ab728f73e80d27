"""Wrappers of environments, and their twins for vectors."""

from spikecam_env.envs.wrappers.observe import ObserveSpikes, VectorObserveSpikes
from spikecam_env.envs.wrappers.progress import ProgressReward, VectorProgressReward
from spikecam_env.envs.wrappers.randomize import RandomizeLight, RandomizeSensor

__all__ = [
    "ObserveSpikes",
    "ProgressReward",
    "RandomizeLight",
    "RandomizeSensor",
    "VectorObserveSpikes",
    "VectorProgressReward",
]
