"""How much one diagnosis simulates: counted in recordings, and not in seconds, whatever the machine's speed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

CAMPAIGNS = 200.0
"""Default: so many times the campaign's recordings, with the twins that its noise is known from (about 15)."""

OVERRUN = 1.3
"""Times as much may be spent before what a verdict can hardly do without is not begun either."""


@dataclass
class Budget:
    """limit: recordings from which nothing more is begun that an answer can do without.

    spent: recordings that were simulated, a number a twin.  left_out: what was not begun.
    verdict_known: whether the verdict is there already, so that an answer can do without all.
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
        """Whether `what`, which takes so many recordings at least, may be begun; noted where it may not.

        needed: an answer whose verdict is not known yet can hardly do without it.
        """
        limit = self.limit * (OVERRUN if needed and not self.verdict_known else 1.0)
        if self.simulated + recordings < limit:
            return True
        if what not in self.left_out:
            self.left_out.append(what)
        return False
