"""The budget of one diagnosis, counted in simulated recordings: the answer does not depend on the machine's speed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from spikecam_env.gap.settings import Twins

CAMPAIGNS = 200.0
"""Default budget [campaigns], including the twins of the null model (about 15)."""


@dataclass
class Budget:
    """limit: recordings after which no optional step is begun.

    spent: simulated recordings, one number a twin.  left_out: steps that were skipped.
    verdict_known: whether the verdict is decided, so that every further step is optional.
    overrun: factor by which steps that an undecided verdict needs may overrun the limit.
    """

    limit: float = math.inf
    spent: list[int] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    verdict_known: bool = False
    overrun: float = Twins().overrun

    @property
    def simulated(self) -> int:
        """Recordings so far."""
        return sum(self.spent)

    def allows(self, what: str, recordings: int = 0, *, needed: bool = False) -> bool:
        """Whether the step `what`, which takes at least so many recordings, may begin; a refusal is noted.

        needed: an undecided verdict needs this step, so it may overrun the limit.
        """
        limit = self.limit * (self.overrun if needed and not self.verdict_known else 1.0)
        if self.simulated + recordings < limit:
            return True
        if what not in self.left_out:
            self.left_out.append(what)
        return False
