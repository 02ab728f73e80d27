"""ReadDigit: look at a spinning disc, and say which digit is on it; time costs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from spikecam_env.envs.tasks.digits import DIGITS
from spikecam_env.envs.tasks.read_spin import RPM, ReadSpin


@dataclass(frozen=True)
class ReadDigit(ReadSpin):
    """As of `ReadSpin`, by another texture: the answer is the digit, and the speed is between the ends of `RPM`."""

    radius: float = 0.25

    further: ClassVar[int] = len(DIGITS)
    stream: ClassVar[int] = 4

    def shown(self, rng: np.random.Generator, truth: int) -> tuple[str, float]:
        """See `ReadSpin.shown`; the speed is drawn evenly in its logarithm."""
        return DIGITS[truth], float(np.exp(rng.uniform(np.log(min(RPM)), np.log(max(RPM)))))
