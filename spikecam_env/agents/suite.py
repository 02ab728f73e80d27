"""Suites: the tasks, levels, cameras, learners, seeds and budgets that make studies of different people comparable."""

from __future__ import annotations

from dataclasses import dataclass

from spikecam_env.envs.registration import MUJOCO_NAMES


@dataclass(frozen=True)
class Suite:
    """Options of `spikecam evaluate agents`, by their names there.

    Example:
        >>> SUITES["v1"].levels, SUITES["v1"].seeds
        ((1, 2, 3, 4, 5), 5)
    """

    tasks: tuple[str, ...]
    observations: tuple[str, ...]
    levels: tuple[int, ...]
    trained_levels: tuple[int, int]
    learners: tuple[str, ...]
    seeds: int
    steps: tuple[int, ...]
    """Budget of a training, of all environments together."""
    episodes: int
    """Test episodes of a level."""


SUITES = {
    "v1": Suite(
        tasks=tuple(f"{name}-v1" for name in MUJOCO_NAMES),
        observations=("tfp", "events", "frame1000", "frame30", "classical", "oracle"),
        levels=(1, 2, 3, 4, 5),
        trained_levels=(1, 5),
        learners=("ppo", "sb3"),
        seeds=5,
        steps=(98_304,),
        episodes=50,
    )
}
"""By name.  v1: twice the steps of our learner's default, 98 304 of a millisecond, 98 s and 3.9 million frames."""
