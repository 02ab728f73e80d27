"""`spikecam train-agent`: an agent learns a task before a spike camera."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from spikecam_env.numbers import Count, Seed, WholeRange

MOST_ENVIRONMENTS = 1024
"""Number of cameras stepped together."""


@dataclass
class TrainAgent:
    """Learn a task by proximal policy optimisation; goes on from its last checkpoint (docs/agents.md).

    example:  spikecam train-agent Catch-v1 --out runs/catch
    """

    task: tyro.conf.Positional[str]
    """Id of a task, e.g. Catch-v1."""
    out: Path
    """Folder of the run: agent.pt, curve.json, and last.pt to go on from."""
    obs: str = "tfp"
    """Observation: tfp, tfi, spikes, rate (denoised), dim_rate (the same, brighter), clean (no noise), root_tfp,
    root_rate or root_clean (on a root scale, for the dark), frame30, frame120, frame1000,
    root_frame30 ... or events (docs/observations.md)."""
    steps: Count | None = None
    """Steps of all environments together.  Default: as many as the shipped agents had."""
    seed: Seed = 0
    """Seed of network, actions, episodes and cameras."""
    environments: Annotated[int, WholeRange(1, MOST_ENVIRONMENTS)] = 16
    """Number of cameras stepped together."""
    levels: tuple[int, int] | None = None
    """Lowest and highest level of a MuJoCo task, of which every episode draws one.  Default: the middle one."""
    plain: bool = False
    """Train by PPO from rewards alone, without the auxiliary loss that asks for the target's place."""

    imitate: bool = False
    """Learn to act like the oracle, in the states that the agent itself comes to, instead of from rewards (DAgger)."""

    def run(self) -> None:
        from spikecam_env.agents.training import Study, learner, train_agent
        from spikecam_env.cli.table import table

        options = {} if self.levels is None else {"level": self.levels}
        study = Study(self.task.removeprefix("spikecam_env/"), self.obs, options)
        ppo = learner(self.steps, imitate=self.imitate, plain=self.plain)
        agent = train_agent(study, self.out, ppo, self.seed, self.environments)
        print(table(agent.training["curve"][-10:]))
        print(f"wrote agent.pt, curve.json and last.pt in {self.out}")
