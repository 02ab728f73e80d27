"""The stages of a diagnosis: their seconds, and what a person sees of them.

On a terminal, a bar of the budget:

    candidates: fitting photodiode_lag: 12 % of the budget, 24 of 200 campaigns, 01:10 since, 08:40 to its end at most

Elsewhere, a line a stage.  A diagnosis ends when nothing is left to explain, mostly long before its budget.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from tqdm import tqdm

from spikecam_env.gap.twins.budget import Budget

BAR = (
    "{desc}: {percentage:.0f} % of the budget, {n:.0f} of {total:.0f} campaigns, {elapsed} since, "
    "{remaining} to its end at most"
)
WITHOUT_LIMIT = "{desc}: {n:.0f} campaigns, {elapsed} since"

_SMOOTHING = 0.05
"""Weight of the last campaign in the mean rate: one by a slow effect takes ten times as long as one by a fast."""


@dataclass
class Stages:
    """Seconds by stage, in the order in which they began; with progress, a person can follow them."""

    progress: bool
    seconds: dict[str, float] = field(default_factory=dict)
    _stage: str = ""
    _bar: tqdm[None] | None = None
    _budget: Budget | None = None

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Time a stage."""
        self._stage = name
        if self._bar is not None:
            self._bar.set_description_str(name)
            if self._budget is not None:
                self._budget.begin("")
        elif self.progress:
            tqdm.write(f"{name} ...")
        start = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    @contextmanager
    def shown(self, campaigns: float) -> Iterator[None]:
        """Show progress meanwhile: a bar on a terminal.

        Args:
            campaigns: the budget; inf for none.
        """
        if not (self.progress and sys.stdout.isatty() and sys.stderr.isatty()):
            yield
            return
        total, words = (None, WITHOUT_LIMIT) if campaigns == float("inf") else (campaigns, BAR)
        with tqdm(total=total, bar_format=words, leave=False, smoothing=_SMOOTHING, dynamic_ncols=True) as self._bar:
            yield
        self._bar = None

    def follow(self, budget: Budget, recordings: int) -> None:
        """Show the work and the simulated campaigns of a budget, as it changes.

        Args:
            budget: of the diagnosis.
            recordings: of a campaign.
        """
        bar = self._bar
        if bar is None:
            return

        def show() -> None:
            bar.update(budget.simulated / recordings - bar.n)
            said = f"{self._stage}: {budget.work}" if budget.work else self._stage
            bar.set_description_str(said, refresh=said != bar.desc)

        self._budget, budget.watcher = budget, show
