"""`spikecam evaluate`: how much a denoiser helps, how well agents' tasks are done, and how well agents learn."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import tyro

from spikecam_env.cli.evaluate_agents import Agents
from spikecam_env.cli.evaluate_modes import Quick, SpikeZoo, TruthTests
from spikecam_env.cli.evaluate_tables import Flow, StillScenes, Table1, Table2, Table3, Table4
from spikecam_env.cli.evaluate_tasks import Tasks


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
        | Annotated[Flow, tyro.conf.subcommand("flow", prefix_name=False)]
        | Annotated[SpikeZoo, tyro.conf.subcommand("spikezoo", prefix_name=False)]
        | Annotated[Tasks, tyro.conf.subcommand("tasks", prefix_name=False)]
        | Annotated[Agents, tyro.conf.subcommand("agents", prefix_name=False)]
        | Annotated[TruthTests, tyro.conf.subcommand("truth", prefix_name=False)]
    ) = field(default_factory=Quick)

    def run(self) -> None:
        self.what.run()
