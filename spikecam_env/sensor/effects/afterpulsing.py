"""Afterpulsing: a spike is now and then reported again, a fixed time later.

    rate <- rate (1 + p) while intervals are longer than the delay;   coincidence with itself at the delay

Stage: read-out.  Seen in: static light: short intervals of one fixed length, and their complement.
Twins: spurious_spikes (at any time), crosstalk (in the neighbours).
Within a frame: at the end of the frame; it acts on the bit that is read.
Source: a comparator that trips again on the ringing of a reset; fixed delay assumed, and the node keeps its charge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor.effects.base import Acts, Effect, ExposureBlock, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response
from spikecam_env.types import Masks


class Pending(NamedTuple):
    """Spikes still to be reported again."""

    due: NDArray[np.int64]
    """As frame * pixels + pixel (n,), in order."""
    rng: np.random.Generator


@dataclass(frozen=True)
class Afterpulsing(Effect):
    probability: float = parameter(1e-3, unit="relative", bounds=(0.0, 1.0), doc="chance p of a second report")
    delay_frames: int = parameter(2, unit="frames", bounds=(1, 1000), doc="time from a spike to its second report")

    stage = Stage.READOUT
    acts = Acts.END
    strength = "probability"
    identification = Identification(
        family="readout",
        shapes={"delay_frames": (1, 2, 3, 4, 6)},
        response=Response.EVENTS,
        needs=Needs.STEADY,
        share=("probability", "spikes"),
    )

    def begin(self, first: ExposureBlock, pattern: np.random.Generator, rng: np.random.Generator) -> Pending:
        return Pending(np.zeros(0, dtype=np.int64), rng)

    def read_out(self, spikes: Masks, now: ExposureBlock, memory: Pending) -> tuple[Masks, Pending]:
        pixels = now.shape[0] * now.shape[1]
        start = now.number * pixels
        at = np.flatnonzero(spikes)
        again = at[memory.rng.random(at.size) < self.probability] + (start + int(self.delay_frames) * pixels)
        due = np.concatenate([memory.due, again])
        now_due = np.searchsorted(due, start + spikes.size)
        reported = spikes.copy()
        reported.reshape(-1)[due[:now_due] - start] = True
        return reported, Pending(due[now_due:], memory.rng)
