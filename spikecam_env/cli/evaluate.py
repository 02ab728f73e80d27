"""`spikecam evaluate`: how much a denoiser helps, how well agents' tasks are done, and how well agents learn."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from spikecam_env.cli.evaluate_agents import Agents
from spikecam_env.cli.evaluate_spikezoo import SpikeZoo
from spikecam_env.cli.evaluate_tables import StillScenes, Table1, Table2, Table3, Table4
from spikecam_env.cli.evaluate_tasks import Tasks
from spikecam_env.cli.evaluate_truth import EvaluateTruth
from spikecam_env.cli.mode_weights import Mode, ModeWeights
from spikecam_env.numbers import Seed, WholeRange


@dataclass
class Quick:
    """Compare noisy, denoised and clean-twin streams on held-out scenes.

    Held-out textures, speeds and light levels, TFP 21 and 41, against true light and the clean twin.

    example:  spikecam evaluate quick --out evaluation
    """

    out: Path | None = None
    """Folder for evaluate.json and evaluate.txt."""
    modes: tuple[Mode, ...] = ("paper", "best")
    """Modes to evaluate."""
    scenes: Annotated[int, WholeRange(1, 1000)] = 2
    """Scenes in each class of speed and light; the same count again gives a finer mean."""
    seed: Seed = 0
    """Seed of the held-out scenes, cameras and noise."""
    weights: ModeWeights = field(default_factory=ModeWeights)

    def run(self) -> None:
        from denoiser.evaluate import evaluate_quick, report
        from spikecam_env.cli.files import show_evaluation

        options: dict[str, Any] = {"weights": self.weights.by_mode(), "scenes_a_class": self.scenes, "seed": self.seed}
        show_evaluation("evaluate", self.out, lambda: evaluate_quick(self.modes, **options), report)


@dataclass
class Evaluate:
    """Measure how much a denoiser helps (docs/tables.md, docs/evaluation.md), and how well policies and agents do their
    tasks (docs/environments.md, docs/agents.md).

    example:  spikecam evaluate quick --out evaluation
    """

    what: (
        Annotated[Quick, tyro.conf.subcommand("quick", prefix_name=False)]
        | Annotated[Table1, tyro.conf.subcommand("table1", prefix_name=False)]
        | Annotated[Table2, tyro.conf.subcommand("table2", prefix_name=False)]
        | Annotated[Table3, tyro.conf.subcommand("table3", prefix_name=False)]
        | Annotated[Table4, tyro.conf.subcommand("table4", prefix_name=False)]
        | Annotated[StillScenes, tyro.conf.subcommand("still", prefix_name=False)]
        | Annotated[SpikeZoo, tyro.conf.subcommand("spikezoo", prefix_name=False)]
        | Annotated[Tasks, tyro.conf.subcommand("tasks", prefix_name=False)]
        | Annotated[Agents, tyro.conf.subcommand("agents", prefix_name=False)]
        | Annotated[EvaluateTruth, tyro.conf.subcommand("truth", prefix_name=False)]
    ) = field(default_factory=Quick)

    def run(self) -> None:
        self.what.run()
