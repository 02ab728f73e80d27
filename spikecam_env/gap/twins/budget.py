"""The budget of one diagnosis, counted in simulated recordings: the answer does not depend on the machine's speed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

CAMPAIGNS = 200.0
"""Default budget [campaigns], including the twins of the null model (about 15)."""


OVERRUN = 1.3
"""Factor by which steps that an undecided verdict needs may overrun the limit."""


@dataclass
class Budget:
    """Simulated recordings, and their limit."""

    limit: float = math.inf
    """Recordings after which no optional step begins."""
    spent: list[int] = field(default_factory=list)
    """Simulated recordings, one number a twin."""
    left_out: list[str] = field(default_factory=list)
    """Steps that were skipped."""
    verdict_known: bool = False
    """Whether the verdict is decided, so that every further step is optional."""
    work: str = ""
    """What is simulated at the moment; of several threads, what began last."""
    watcher: Callable[[], None] | None = None
    """Called where `work` or the simulated recordings change."""

    @property
    def simulated(self) -> int:
        """Recordings so far."""
        return sum(self.spent)

    def begin(self, work: str) -> None:
        """Say what is simulated from now on."""
        self.work = work
        self._tell()

    def spend(self, recordings: int) -> None:
        """Count recordings that are simulated."""
        self.spent.append(recordings)
        self._tell()

    def _tell(self) -> None:
        if self.watcher is not None:
            self.watcher()

    def allows(self, step: str, recordings: int = 0, *, needed: bool = False) -> bool:
        """Whether a step may begin; a refusal is noted.

        Args:
            step: its name.
            recordings: that it takes at least.
            needed: whether an undecided verdict needs it, so that it may overrun the limit.
        """
        limit = self.limit * (OVERRUN if needed and not self.verdict_known else 1.0)
        if self.simulated + recordings < limit:
            return True
        if step not in self.left_out:
            self.left_out.append(step)
        return False
