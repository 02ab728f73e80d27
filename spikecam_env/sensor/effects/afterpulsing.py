"""Afterpulsing: a spike is now and then reported again, a fixed time later.

    rate <- rate (1 + p) while intervals are longer than the delay;   coincidence with itself at the delay

Stage: read-out.  Seen in: static light: short intervals of one fixed length, and their complement.
Twins: spurious_spikes (at any time), crosstalk (in the neighbours).
Source: a comparator that trips again on the ringing of a reset; fixed delay assumed, and the node keeps its charge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor.effects.base import Effect, Exposure, Spikes, Stage, parameter


class Pending(NamedTuple):
    """due: (H, W) which pixels report again, next frame first.  rng: what draws them."""

    due: tuple[NDArray[np.bool_], ...]
    rng: np.random.Generator


@dataclass(frozen=True)
class Afterpulsing(Effect):
    probability: float = parameter(1e-3, unit="relative", bounds=(0.0, 1.0), doc="chance p of a second report")
    delay_frames: int = parameter(2, unit="frames", bounds=(1, 1000), doc="time from a spike to its second report")

    stage = Stage.READOUT
    strength = "probability"

    def begin(self, first: Exposure, rng: np.random.Generator) -> Pending:
        return Pending((np.zeros(first.shape, dtype=np.bool_),) * int(self.delay_frames), rng)

    def read_out(self, spikes: Spikes, now: Exposure, memory: Pending) -> tuple[Spikes, Pending]:
        at = np.flatnonzero(spikes)
        again = np.zeros(now.shape, dtype=np.bool_)
        again.flat[at] = memory.rng.random(at.size) < self.probability
        return spikes | memory.due[0], Pending((*memory.due[1:], again), memory.rng)
