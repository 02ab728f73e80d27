"""The specification: the pixel frame by frame, in plain numpy, with every effect.

    charge += light of the frame                      (Poisson electrons with shot noise)
    while charge >= threshold:  spike;  charge -= threshold;  threshold = 1 + kappa n      (drawn at each reset)

Reset is asynchronous: charge after the crossing is kept.  A frame reports one bit; further crossings in it are lost.
Charge is in grains of the pixel's own threshold (`light`), so without noise all sums are exact integers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor.effects import Effect
from spikecam_env.sensor.light import GRAINS, Segment, ramp
from spikecam_env.sensor.unit import Unit

Array = NDArray[np.float64]


@dataclass
class ReferenceState:
    """charge, threshold: (P,) float64 [grains]; rng: the temporal noise's generator."""

    charge: Array
    threshold: Array
    rng: np.random.Generator


def start(unit: Unit, phase: Array, rng: np.random.Generator) -> ReferenceState:
    """Pixels part-way through a cycle: phase (P,) in [0, 1) is the share of the nominal threshold collected."""
    threshold = draw_threshold(unit.kappa, rng)
    return ReferenceState(np.floor(phase * GRAINS), threshold, rng)


def run(
    unit: Unit, effects: Sequence[Effect], frame_rate_hz: float, state: ReferenceState, segment: Segment
) -> NDArray[np.uint8]:
    """Advance `state` over a segment; returns spikes (count, P) uint8."""
    light = ramp(segment, *unit.grains_per_frame)
    spikes = np.zeros((segment.count, unit.gain.size), dtype=np.uint8)
    before = light.collected(segment.first)
    for i in range(segment.count):
        after = light.collected(segment.first + i + 1)
        step(unit, effects, frame_rate_hz, state, (after - before).astype(np.float64), spikes[i])
        before = after
    return spikes


def step(
    unit: Unit,
    effects: Sequence[Effect],
    frame_rate_hz: float,
    state: ReferenceState,
    mean: Array,
    spikes: NDArray[np.uint8],
) -> None:
    """One frame: `mean` (P,) is its expected charge [grains]; sets `spikes` (P,) where a pixel fires."""
    state.charge += collect(unit, mean, state.rng)
    threshold = state.threshold
    for effect in effects:
        threshold = effect.frame_threshold(threshold / GRAINS, unit, state.rng) * GRAINS
    crossed = np.flatnonzero(state.charge >= threshold)
    while crossed.size:
        spikes[crossed] = 1
        residual = (state.charge[crossed] - threshold[crossed]) / GRAINS
        for effect in effects:
            residual = effect.after_reset(residual, mean[crossed] / GRAINS, frame_rate_hz)
        state.charge[crossed] = residual * GRAINS
        redrawn = draw_threshold(unit.kappa[crossed], state.rng)
        threshold[crossed] += redrawn - state.threshold[crossed]
        state.threshold[crossed] = redrawn
        crossed = crossed[state.charge[crossed] >= threshold[crossed]]


def collect(unit: Unit, mean: Array, rng: np.random.Generator) -> Array:
    """Charge of a frame [grains] given its expectation: Poisson electrons, paper (3)-(4), or the mean itself."""
    if not unit.shot:
        return mean
    dark = np.zeros_like(mean) if unit.dark_is_noisy else np.minimum(unit.dark * GRAINS, mean)
    electrons = rng.poisson((mean - dark) * (unit.electrons / GRAINS))
    return electrons * (GRAINS / unit.electrons) + dark


def draw_threshold(kappa: Array, rng: np.random.Generator) -> Array:
    """Thresholds [grains] after a reset, paper (12): 1 + kappa n; exactly one without noise, and draws nothing."""
    if not np.any(kappa):
        return np.full(kappa.shape, float(GRAINS))
    return GRAINS * (1.0 + kappa * rng.standard_normal(kappa.shape))
