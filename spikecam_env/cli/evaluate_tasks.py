"""`spikecam evaluate tasks`: the ends of every task's score, what the oracle does and what doing nothing does."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from spikecam_env.checked import checked_count
from spikecam_env.cli.options import Checked, Seed, Size
from spikecam_env.errors import unknown_name

MOST_EPISODES = 1000
"""As many as the test split has."""


@dataclass
class Tasks:
    """Play the oracle, nothing and random actions at every task (docs/environments.md).

    Performance is 0 to 1: the share of the time on the target, or success.  A score of 0 is that of doing nothing,
    of 1 the oracle's.  Tasks of version 1 are played on their test episodes.

    example:  spikecam evaluate tasks --tasks Track-v1 Catch-v1 --episodes 10
    """

    tasks: Annotated[
        tuple[str, ...], tyro.conf.arg(metavar="ID...", help_behavior_hint="(default: all small ones)")
    ] = ()
    """Ids, with or without `spikecam_env/`; by default the tasks of version 1 at 64 x 64."""
    scenes: bool = False
    """Play the scenes of the catalogue too, at 64 x 64; those in space take 15 to 100 ms a step."""
    episodes: Annotated[int, Checked(checked_count, most=MOST_EPISODES)] = 20
    """Episodes of each policy."""
    seed: Seed = 0
    """Of the first episode; the next has the next."""
    size: Size | None = None
    """Rows and columns, instead of each task's."""
    json: Path | None = None
    """File for the table as JSON."""

    def run(self) -> None:
        from spikecam_env.cli.files import write_json
        from spikecam_env.cli.table import table
        from spikecam_env.envs.registration import ENVIRONMENTS, SMALL_TASKS, TASK_ENVIRONMENTS
        from spikecam_env.envs.score import evaluate
        from spikecam_env.whole import check_file

        known = (*TASK_ENVIRONMENTS, *ENVIRONMENTS)
        asked = tuple(name if "/" in name else f"spikecam_env/{name}" for name in self.tasks)
        for name in asked:
            if name not in known:
                raise unknown_name("task", name.removeprefix("spikecam_env/"), (k.split("/")[1] for k in known))
        if self.json is not None:
            check_file(self.json)
        rows = evaluate(asked or SMALL_TASKS, self.episodes, self.seed, True, **self._shape(()))
        if self.scenes:
            rows += evaluate(tuple(ENVIRONMENTS), self.episodes, self.seed, True, **self._shape((64, 64)))
        print(table(rows))
        if self.json is not None:
            write_json(self.json, {"episodes": self.episodes, "seed": self.seed, "rows": rows})
            print(f"wrote {self.json}")

    def _shape(self, default: tuple[int, ...]) -> dict[str, tuple[int, ...]]:
        shape = self.size or default
        return {"shape": shape} if shape else {}
