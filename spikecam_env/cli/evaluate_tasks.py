"""`spikecam evaluate tasks`: the ends of every task's score, the oracle's and that of doing nothing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from spikecam_env.cli.options import Size
from spikecam_env.errors import unknown_name
from spikecam_env.numbers import Seed, WholeRange

MOST_EPISODES = 1000
"""As many as the test split has."""


@dataclass
class Tasks:
    """Score the oracle, doing nothing and random actions on every task (docs/environments.md).

    The oracle knows where the target is, and turns the same motor.  Performance is 0 to 1: the share of the time on the
    target, or of the episodes that succeed.  A score is 0 for doing nothing, 1 for the oracle.  Tasks of version 1 are
    played on their test episodes.

    example:  spikecam evaluate tasks --tasks Track-v1 Catch-v1 --episodes 10
    """

    tasks: Annotated[
        tuple[str, ...], tyro.conf.arg(metavar="ID...", help_behavior_hint="(default: every task at 64 x 64)")
    ] = ()
    """Which tasks or scenes to play, e.g. Track-v1 or Fan-v0."""
    scenes: bool = False
    """Play every scene of the catalogue too, at 64 x 64; a 3-D scene takes 15 to 100 ms a step."""
    episodes: Annotated[int, WholeRange(1, MOST_EPISODES)] = 20
    """Episodes that each policy plays; the table has their mean."""
    seed: Seed = 0
    """Seed of the first episode; each further episode has the next number."""
    size: Size | None = None
    """Rows and columns of the camera; by default each task's own."""
    json: Path | None = None
    """Write the table to this file too."""

    def run(self) -> None:
        from spikecam_env.cli.files import write_json
        from spikecam_env.cli.table import table
        from spikecam_env.envs.registration import ALL_TASKS, ENVIRONMENTS, SMALL_TASKS
        from spikecam_env.envs.score import baselines
        from spikecam_env.whole import check_file

        known = (*ALL_TASKS, *ENVIRONMENTS)
        asked = [name if "/" in name else f"spikecam_env/{name}" for name in self.tasks] or list(SMALL_TASKS)
        for name in asked:
            if name not in known:
                raise unknown_name("task", name.removeprefix("spikecam_env/"), (k.split("/")[1] for k in known))
        if self.json is not None:
            check_file(self.json)
        scenes = tuple(ENVIRONMENTS) if self.scenes else ()
        asked = [name for name in dict.fromkeys(asked) if name not in scenes]
        rows = baselines(asked, self.episodes, self.seed, True, **self._shape(()))
        rows += baselines(scenes, self.episodes, self.seed, self.scenes, **self._shape((64, 64)))
        print(table(rows))
        if self.json is not None:
            write_json(self.json, {"episodes": self.episodes, "seed": self.seed, "rows": rows})
            print(f"wrote {self.json}")

    def _shape(self, default: tuple[int, ...]) -> dict[str, tuple[int, ...]]:
        shape = self.size or default
        return {"shape": shape} if shape else {}
