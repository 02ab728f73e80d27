"""How much one diagnosis simulates: counted in recordings, and not in seconds, whatever the machine's speed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

CAMPAIGNS = 60.0
"""Default: so many times the campaign's recordings, with the twins that tell its noise (about 15)."""


@dataclass
class Effort:
    """most: recordings from which nothing more is begun that an answer can do without.

    spent: recordings that were simulated, a number a twin.  left_out: what was not begun.
    """

    most: float = math.inf
    spent: list[int] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)

    @property
    def simulated(self) -> int:
        """Recordings so far."""
        return sum(self.spent)

    def allows(self, what: str, recordings: int = 0) -> bool:
        """Whether `what`, which takes so many recordings at least, may be begun; noted where it may not."""
        if self.simulated + recordings < self.most:
            return True
        if what not in self.left_out:
            self.left_out.append(what)
        return False
