"""Charge that stays on the photodiode at a reset, and comes to the pixel at the frame's end (`Feedback.left`).

    left (1 - exp(-T / left_tau)),  T the interval that has ended

It may take a pixel to its threshold again, which then fires once more.
"""

from __future__ import annotations

import numpy as np

from spikecam_env.compiled import njit
from spikecam_env.sensor.engines.compiled.bands.arguments import SpikeLaw
from spikecam_env.sensor.engines.compiled.bands.resets import next_threshold, reset_one
from spikecam_env.sensor.engines.compiled.bands.rows import (
    AGAIN,
    ARRIVES,
    AT,
    CROSSED,
    DRAW,
    DUE,
    ELECTRONS,
    FACTOR,
    GROUP,
    HELD,
    INSIDE,
    JITTER,
    LIMIT,
    LOAD,
    MOVED,
    NOISE,
    ONE,
    PHI,
    STANDS,
    Places,
    Views,
    limit_of,
    on_grid,
)
from spikecam_env.sensor.ground.crossing import MOST_AGAIN
from spikecam_env.sensor.ground.decay import LONG, decayed

decay = njit(inline="always")(decayed)

LEAST_RATE = 1e-12
"""Of charge, divides where a pixel fires in the dark [thresholds a frame]."""


@njit(nogil=True, error_model="numpy", boundscheck=False)
def add_left_charge(band: Views, live: Places, groups: int, number: int, once_more: bool, law: SpikeLaw) -> None:
    """Of the pixels of live groups that are due and have not to fire again, in the frame that ends at `number` + AT.

    Args:
        once_more: take pixels to their threshold again; where references move within the frame, the next one does.
    """
    x, words = band.x, band.words
    draws = words.view(np.float32)
    left, left_tau = law.feedback.left, law.feedback.left_tau
    for g in range(groups):
        q = live[g] & INSIDE
        for j in range(q, q + GROUP):
            held, rate = x[HELD + j] / ONE, x[ARRIVES + j] / ONE
            crossed = number + x[AT + j] - min(max(held / max(rate, LEAST_RATE), 0.0), 1.0)
            stays = left * (decay(min((crossed - x[CROSSED + j]) / left_tau, LONG)) - 1.0)
            phi = next_threshold(x[ELECTRONS + j] + stays, x[NOISE + j], x[JITTER + j], draws[DRAW + j])
            limit = limit_of(phi, x[FACTOR + j], x[MOVED + j], x[LOAD + j])
            fires = words[DUE + j] > words[AGAIN + j]
            x[CROSSED + j] = crossed if fires else x[CROSSED + j]
            x[HELD + j] = on_grid((held - stays) * ONE) if fires else x[HELD + j]
            x[PHI + j] = phi if fires else x[PHI + j]
            x[LIMIT + j] = limit if fires else x[LIMIT + j]
        for j in range(q, q + GROUP):
            if once_more and words[DUE + j] > words[AGAIN + j] and x[HELD + j] >= x[LIMIT + j]:
                cross_again(band, j, number + x[AT + j], law)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def cross_again(band: Views, j: int, end: float, law: SpikeLaw) -> None:
    """Reset a pixel that charge left takes to its threshold again, MOST_AGAIN times at most."""
    x, words = band.x, band.words
    draws = words.view(np.float32)
    left, left_tau = law.feedback.left, law.feedback.left_tau
    rate = x[ARRIVES + j] / ONE
    for _ in range(MOST_AGAIN):
        if x[HELD + j] < x[LIMIT + j]:
            break
        reset_one(x, words, draws, j, x[LIMIT + j], x[STANDS + j], law)
        over = x[HELD + j] / ONE
        crossed = end - min(max(over / max(rate, LEAST_RATE), 0.0), 1.0)
        stays = left * (decay(min(max(crossed - x[CROSSED + j], 0.0) / left_tau, LONG)) - 1.0)
        phi = next_threshold(x[ELECTRONS + j] + stays, x[NOISE + j], x[JITTER + j], draws[DRAW + j])
        x[CROSSED + j], x[PHI + j] = crossed, phi
        x[HELD + j] = on_grid((over - stays) * ONE)
        x[LIMIT + j] = limit_of(phi, x[FACTOR + j], x[MOVED + j], x[LOAD + j])


@njit(inline="always")
def end_of_frame(band: Views, live: Places, groups: int, at: float) -> None:
    """Mark the pixels of live groups that were hit as due, in the frame of a block that ends then."""
    x, words, hit = band.x, band.words, band.hit
    for g in range(groups):
        q = live[g] & INSIDE
        for j in range(q, q + GROUP):
            words[DUE + j], words[AGAIN + j] = hit[j], 0
            x[AT + j] = at
