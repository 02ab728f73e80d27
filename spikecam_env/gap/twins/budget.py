"""The budget of one diagnosis, counted in simulated recordings: the answer does not depend on the machine's speed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

CAMPAIGNS = 200.0
"""Default budget [campaigns], including the twins of the null model (about 15)."""


OVERRUN = 1.3
"""Factor by which steps that an undecided verdict needs may overrun the limit."""


@dataclass
class Budget:
    """limit: recordings after which no optional step is begun.

    spent: simulated recordings, one number a twin.  left_out: steps that were skipped.
    verdict_known: whether the verdict is decided, so that every further step is optional.
    """

    limit: float = math.inf
    spent: list[int] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    verdict_known: bool = False

    @property
    def simulated(self) -> int:
        """Recordings so far."""
        return sum(self.spent)

    def allows(self, what: str, recordings: int = 0, *, needed: bool = False) -> bool:
        """Whether the step `what`, which takes at least so many recordings, may begin; a refusal is noted.

        needed: an undecided verdict needs this step, so it may overrun the limit.
        """
        limit = self.limit * (OVERRUN if needed and not self.verdict_known else 1.0)
        if self.simulated + recordings < limit:
            return True
        if what not in self.left_out:
            self.left_out.append(what)
        return False
