"""Spurious spikes: the read-out reports a spike where there was none; the pixel goes on collecting.

    each empty bit becomes a spike with probability p;   dark rate = p

Stage: read-out.  Seen in: the dark (a rate that is Poisson, unlike the pixel's); static light: intervals cut in two.
Twins: random_telegraph_noise (two levels), afterpulsing (a fixed time after a spike), dark_current (regular).
Source: bit errors of the link or a metastable latch; independent by assumption.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Effect, Exposure, Spikes, Stage, parameter


@dataclass(frozen=True)
class SpuriousSpikes(Effect):
    probability: float = parameter(1e-5, unit="per frame", bounds=(0.0, 1.0), doc="chance p of a false spike")

    stage = Stage.READOUT
    strength = "probability"

    def read_out(
        self, spikes: Spikes, now: Exposure, memory: np.random.Generator
    ) -> tuple[Spikes, np.random.Generator]:
        return spikes | (memory.random(now.shape) < self.probability), memory
