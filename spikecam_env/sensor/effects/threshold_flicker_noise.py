"""Threshold flicker noise: 1/f noise of each comparator, slow against the spikes.

    theta(t) = sum over octaves j of AR(1) processes:  standard deviation sigma, correlation time tau_j = 2^(j+1) frames
    S(f) = (sigma^2 / ln 2) / f between the ends;   excess of A_k = T^2 4 sigma^2 k^2

Stage: threshold.  Seen in: A_k, which grows as k^2 where white noise grows as k.
Twins: random_telegraph_noise (some pixels, dark), lamp_drift (all pixels together), reset_noise (white).
Source: 1/f noise of MOS transistors as a sum of Lorentzians (McWhorter 1957); octaves as in Voss and McCartney.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from spikecam_env.sensor.effects.base import Array, Effect, Exposure, Stage, parameter


class Octaves(NamedTuple):
    """value: one (H, W) array of unit variance an octave, fastest first.  rng: what drives them."""

    value: tuple[Array, ...]
    rng: np.random.Generator


@dataclass(frozen=True)
class ThresholdFlickerNoise(Effect):
    sigma_mV: float = parameter(0.5, unit="mV", bounds=(0.0, 50.0), doc="standard deviation of one octave")
    octaves: int = parameter(
        12, unit="", bounds=(1, 24), doc="octaves; the slowest has a correlation time of 2^octaves"
    )

    stage = Stage.THRESHOLD
    strength = "sigma_mV"

    def begin(self, first: Exposure, rng: np.random.Generator) -> Octaves:
        return Octaves(tuple(rng.standard_normal(first.shape) for _ in range(int(self.octaves))), rng)

    def compare(self, threshold: Array, now: Exposure, memory: Octaves) -> tuple[Array, Octaves]:
        octaves = tuple(advanced(j, o, now.number, memory.rng) for j, o in enumerate(memory.value))
        return threshold + now.share_of_swing(self.sigma_mV) * sum(octaves), Octaves(octaves, memory.rng)


def advanced(octave: int, value: Array, frame: int, rng: np.random.Generator) -> Array:
    """An octave's value in this frame; it moves every eighth of its correlation time, no oftener than every frame."""
    tau = 2 ** (octave + 1)
    every = max(1, tau // 8)
    if frame % every:
        return value
    kept = math.exp(-every / tau)
    return kept * value + math.sqrt(1.0 - kept * kept) * rng.standard_normal(value.shape)
