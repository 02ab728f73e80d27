"""Missed spikes: the read-out loses a spike now and then; the pixel was reset all the same.

    rate <- rate (1 - p);   intervals are now and then the sum of two

Stage: read-out.  Seen in: static light: intervals of twice the length.
Twins: dead_pixels (for ever), dead_time (all intervals longer, none doubled).
Within a frame: at the end of the frame; it acts on the bit that is read.
Source: a flag latched too late or overwritten; independent by assumption.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, ExposureBlock, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response
from spikecam_env.types import Masks


@dataclass(frozen=True)
class MissedSpikes(Effect):
    probability: float = parameter(1e-3, unit="relative", bounds=(0.0, 1.0), doc="chance p to lose a spike")

    stage = Stage.READOUT
    acts = Acts.END
    strength = "probability"
    identification = Identification(
        family="readout", response=Response.EVENTS, needs=Needs.STEADY, share=("probability", "spikes")
    )

    def read_out(
        self, spikes: Masks, now: ExposureBlock, memory: np.random.Generator
    ) -> tuple[Masks, np.random.Generator]:
        at = np.flatnonzero(spikes)
        kept = spikes.copy()
        kept.reshape(-1)[at[memory.random(at.size) < self.probability]] = False
        return kept, memory
