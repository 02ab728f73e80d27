"""IR drop: spikes of a row load its supply line, and the threshold of the whole row moves.

    phi_t <- phi (1 + d a_(t-1)),  a: share of the row's pixels that fired in the frame before
    uniform row, steady light: rate = x / (1 + d rate)

Stage: threshold.  Seen in: dim pixels beside bright ones in the same row; on flats, as a non-linearity.
Pixels of a row that are exactly alike and free of noise fall into step (pulse-coupled oscillators).
Twins: photo_response_nonlinearity (inseparable on flats), row_temporal_noise, blooming (neighbours, not rows).
Within a frame: at the end of the frame; by assumption the activity of one frame acts in the next: in light that stays
over T frames the mean rate is exact; where a row's activity changes by da from frame to frame the threshold is off by
d da, 1 % where d = 0.2 and da = 0.05.
Source: resistance of the supply grid; first order in the current, one frame late by assumption.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, ExposureBlock, Feedback, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.types import Floats, Masks


@dataclass(frozen=True)
class IrDrop(Effect):
    droop: float = parameter(
        0.005, unit="relative", bounds=(-0.2, 0.2), doc="threshold's rise d when the whole row fires; below 0: a fall"
    )

    stage = Stage.THRESHOLD
    acts = Acts.END
    strength = "droop"
    identification = Identification(
        family="saturation",
        needs=Needs.LEVELS,
        experiment="flats at several levels beside a picture with bright and dark rows",
    )

    def begin(self, first: ExposureBlock, pattern: np.random.Generator, rng: np.random.Generator) -> Floats:
        return np.zeros((first.shape[0], 1))

    def react(self, threshold: Floats, now: ExposureBlock, memory: Floats) -> Floats:
        return threshold * (1.0 + self.droop * memory)

    def spiked(
        self, charge: Floats, spikes: Masks, rate: Floats, now: ExposureBlock, memory: Floats
    ) -> tuple[Floats, Floats]:
        return charge, spikes.mean(axis=1, keepdims=True)

    def feedback(self, first: ExposureBlock) -> Feedback:
        return Feedback(droop=self.droop)
