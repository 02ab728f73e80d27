"""Threshold flicker noise: 1/f noise of each comparator, slow against the spikes.

    theta(t) = sum over octaves j of AR(1) processes:  standard deviation sigma, correlation time tau_j = 2^(j+1) frames
    S(f) = (sigma^2 / ln 2) / f between the ends;   excess of A_k = T^2 4 sigma^2 k^2

Stage: threshold.  Seen in: A_k, which grows as k^2 where white noise grows as k.
Twins: random_telegraph_noise (some pixels, dark), lamp_drift (all pixels together), reset_noise (white).
Within a frame: drawn once a frame; an octave holds for an eighth of its correlation time, and no less than a frame.
Source: 1/f noise of MOS transistors as a sum of Lorentzians (McWhorter 1957); octaves as in Voss and McCartney.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor.effects.base import Acts, Effect, ExposureBlock, Shift, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response
from spikecam_env.sensor.ground.random_fields import Words, octave_field, words


class Octaves(NamedTuple):
    """State of the octaves."""

    value: NDArray[np.float32]
    """(octaves, H, W) [mV], fastest first."""
    words: tuple[Words, ...]
    """Keys of the draws of each."""


@dataclass(frozen=True)
class ThresholdFlickerNoise(Effect):
    sigma_mV: float = parameter(0.5, unit="mV", bounds=(0.0, 50.0), doc="standard deviation of one octave")
    octaves: int = parameter(
        12, unit="", bounds=(1, 24), doc="octaves; the slowest has a correlation time of 2^octaves"
    )

    stage = Stage.THRESHOLD
    acts = Acts.DRAWN
    strength = "sigma_mV"
    identification = Identification(family="noise", response=Response.QUADRATIC, needs=Needs.STEADY)

    def begin(self, first: ExposureBlock, pattern: np.random.Generator, rng: np.random.Generator) -> Octaves:
        shape = (int(self.octaves), *first.shape)
        value = np.float32(self.sigma_mV) * rng.standard_normal(shape, dtype=np.float32)
        return Octaves(value, tuple(words(rng) for _ in range(shape[0])))

    def compare(self, now: ExposureBlock, memory: Octaves) -> tuple[Shift, Octaves]:
        """An octave moves every eighth of its correlation time, no oftener than every frame."""
        tau = 2.0 ** (1 + np.arange(len(memory.words)))
        every = np.maximum(1, tau // 8)
        total, value = octave_field(
            memory.words, self.sigma_mV, memory.value, every, np.exp(-every / tau), now.number, now.frames
        )
        return Shift(millivolts=total), Octaves(value, memory.words)
