"""ReadDigit: look at a spinning disc, and say which digit is on it; time costs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from spikecam_env.envs.tasks.digits import DIGITS
from spikecam_env.envs.tasks.read_spin import RPM, ReadSpin


@dataclass(frozen=True)
class ReadDigit(ReadSpin):
    """Look at a spinning disc, and say which digit is on it.

    Scene:
        A bright disc with a dark digit spins at 1000 to 8000 rpm, and its centre wanders as that of `ReadSpin`. A bar
        is below the digit, so that a 6 is no 9. Fonts, strokes and slants of tests are not those of training.
    Observation:
        By default a picture a step, (1, rows, columns) uint8: the share of the step's frames with a spike.
    Action:
        13 numbers in [-1, 1]: pan, tilt, say, and one for each digit from 0 to 9; as of `ReadSpin`.
    Reward:
        "progress" as of `Track`; 10 more for the right answer, and 10 / 9 less for a wrong one.
    End:
        Terminated by the right answer; truncated after 250 steps. A wrong answer locks answers for a third of these.
    Success:
        The right answer. Performance: share of the time that is left then, less 1/9 for each wrong answer.
    """

    radius: float = 0.25

    answers: ClassVar[int] = len(DIGITS)
    further: ClassVar[int] = 1 + answers
    stream: ClassVar[int] = 4

    def shown(self, rng: np.random.Generator, truth: int) -> tuple[str, float]:
        """See `ReadSpin.shown`; the speed is drawn evenly in its logarithm."""
        return DIGITS[truth], float(np.exp(rng.uniform(np.log(min(RPM)), np.log(max(RPM)))))
