"""Crosstalk: the reset of a pixel couples into its four neighbours.

    charge += k for each neighbour that fired;   uniform light, away from the edge: rate = x / (1 - 4 k)

Stage: reset.  Seen in: coincidences of neighbours' spikes at lag 0 and 1; spots of light (a halo).
Twins: optical_blur (no coincidence), blooming (only beside saturated pixels).
Within a frame: at the end of the frame.
Source: capacitive coupling between nodes, k = C_coupling / C; the kick arrives at the end of the frame by assumption.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from spikecam_env.sensor.effects.base import (
    Array,
    Effect,
    Exposure,
    Feedback,
    Spikes,
    Stage,
    Within,
    neighbour_sum,
    parameter,
)


@dataclass(frozen=True)
class Crosstalk(Effect):
    kick: float = parameter(0.002, unit="thresholds", bounds=(-0.2, 0.2), doc="charge k to each neighbour a spike")

    stage = Stage.RESET
    within = Within.END
    strength = "kick"

    def spiked(self, charge: Array, spikes: Spikes, rate: Array, now: Exposure, memory: Any) -> tuple[Array, Any]:
        return charge + self.kick * neighbour_sum(spikes.astype(np.float64)), memory

    def feedback(self, first: Exposure) -> Feedback:
        return Feedback(kick=self.kick)
