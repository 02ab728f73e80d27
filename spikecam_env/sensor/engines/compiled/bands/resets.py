"""The law of a spike of the block loop: the reset takes the limit, and the next threshold is drawn.

    over = charge - limit;  charge = (over - lost) kept (`Feedback`)
    threshold = GRAINS (1 + s z),  s^2 = N / N_0^2 + kappa^2

N counts electrons up to the level of the reference.  Where any of a group of pixels fires, a spike is computed for all
of them, and kept for those that fired: vector instructions for sixteen cost less than to gather, one by one, the few.
"""

from __future__ import annotations

import math

import numpy as np

from spikecam_env.compiled import njit
from spikecam_env.sensor.effects.base import Feedback
from spikecam_env.sensor.engines.compiled.bands.arguments import SpikeLaw
from spikecam_env.sensor.engines.compiled.bands.rows import (
    AGAIN,
    ARRIVES,
    AWAKE,
    DRAW,
    DUE,
    ELECTRONS,
    FACTOR,
    FIRED,
    FIRST,
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
    PIXEL,
    SECOND,
    STANDS,
    Places,
    Views,
    Words,
    limit_of,
    on_grid,
)
from spikecam_env.sensor.ground.draws import GOLDEN, first_key, second_key, standard
from spikecam_env.types import Floats, Pictures

_U = np.uint32


@njit(nogil=True, error_model="numpy", boundscheck=False)
def wake(band: Views, live: Places, groups: int, law: SpikeLaw) -> None:
    """Noise and keys of pixels, in groups in which one fires for the first time."""
    x, words = band.x, band.words
    per_electron, kappa_squared, low, high = law.per_electron, law.kappa_squared, law.seed_low, law.seed_high
    for g in range(groups):
        q = live[g] & INSIDE
        if words[AWAKE + q // GROUP] == 0:
            words[AWAKE + q // GROUP] = 1
            for j in range(q, q + GROUP):
                p = words[PIXEL + j]
                x[NOISE + j] = per_electron[p]
                x[JITTER + j] = kappa_squared[p]
                words[FIRST + j] = first_key(p, low)
                words[SECOND + j] = second_key(words[FIRST + j], high)


@njit(nogil=True, error_model="numpy", boundscheck=False)
def fire(band: Views, live: Places, groups: int, law: SpikeLaw) -> None:
    """Reset the pixels of live groups that are hit, as often in the frame as they are at their limit."""
    words, hit = band.words, band.hit
    for g in range(groups):
        q = live[g] & INSIDE
        for j in range(q, q + GROUP):
            words[DUE + j] = hit[j]
    groups = reset_due(band, live, groups, law, False)
    while groups:
        find_due(band, live, groups)
        groups = reset_due(band, live, groups, law, True)


@njit(inline="always")
def find_due(band: Views, live: Places, groups: int) -> None:
    """Mark the pixels of live groups that are at their limit."""
    x, words = band.x, band.words
    for g in range(groups):
        q = live[g] & INSIDE
        for j in range(q, q + GROUP):
            words[DUE + j] = _U(x[HELD + j] >= x[LIMIT + j])


@njit(inline="always")
def reset_due(band: Views, live: Places, groups: int, law: SpikeLaw, keep: bool) -> int:
    """Reset the pixels that are due.

    Args:
        keep: draw and electrons of the other pixels, as they fired earlier in the frame.

    Returns:
        How many groups, listed, have pixels that are at their limit again.
    """
    x, words = band.x, band.words
    draws = words.view(np.float32)
    still = 0
    for g in range(groups):
        q = live[g] & INSIDE
        draw_group(words, draws, q, law.polynomial, keep)
        reset_group(x, words, draws, q, law.feedback, keep)
        again = _U(0)
        for j in range(q, q + GROUP):
            again |= words[AGAIN + j]
        live[still] = q
        still += again != 0
    return still


@njit(inline="always")
def draw_group(words: Words, draws: Pictures, q: int, polynomial: tuple[np.float32, ...], keep: bool) -> None:
    """Row DRAW of the pixels of a group that are due."""
    for j in range(q, q + GROUP):
        draw = drawn(words[FIRST + j], words[SECOND + j], words[FIRED + j], polynomial)
        draws[DRAW + j] = draw if not keep or words[DUE + j] != 0 else draws[DRAW + j]
        words[FIRED + j] = _U(words[FIRED + j] + words[DUE + j])


@njit(inline="always")
def reset_group(x: Floats, words: Words, draws: Pictures, q: int, feedback: Feedback, keep: bool) -> None:
    """Reset the pixels of a group that are due; row AGAIN: whether they are at their limit again."""
    root, rate, kept = feedback.lost_per_root_rate, feedback.lost_per_rate, feedback.kept
    whole = root == 0.0 and rate == 0.0 and kept == 1.0
    for j in range(q, q + GROUP):
        over, electrons = on_grid(x[HELD + j] - x[LIMIT + j]), x[STANDS + j] * (1.0 / ONE)
        if not whole:
            over, electrons = after_reset(over, x[ARRIVES + j] / ONE, x[STANDS + j], root, rate, kept)
        phi = next_threshold(electrons, x[NOISE + j], x[JITTER + j], draws[DRAW + j])
        limit = limit_of(phi, x[FACTOR + j], x[MOVED + j], x[LOAD + j])
        fires = words[DUE + j] != 0
        x[ELECTRONS + j] = electrons if not keep or fires else x[ELECTRONS + j]
        x[HELD + j] = over if fires else x[HELD + j]
        x[PHI + j] = phi if fires else x[PHI + j]
        x[LIMIT + j] = limit if fires else x[LIMIT + j]
        words[AGAIN + j] = fires & (over >= limit)


@njit(inline="always")
def reset_one(x: Floats, words: Words, draws: Pictures, j: int, taken: float, stands: float, law: SpikeLaw) -> None:
    """Reset one pixel of charge `taken` [grains], with its reference at such a level; as `reset_due`."""
    feedback = law.feedback
    root, rate, kept = feedback.lost_per_root_rate, feedback.lost_per_rate, feedback.kept
    over, electrons = on_grid(x[HELD + j] - taken), stands * (1.0 / ONE)
    if not (root == 0.0 and rate == 0.0 and kept == 1.0):
        over, electrons = after_reset(over, x[ARRIVES + j] / ONE, stands, root, rate, kept)
    draw = drawn(words[FIRST + j], words[SECOND + j], words[FIRED + j], law.polynomial)
    phi = next_threshold(electrons, x[NOISE + j], x[JITTER + j], draw)
    words[FIRED + j], draws[DRAW + j] = _U(words[FIRED + j] + _U(1)), draw
    x[ELECTRONS + j], x[HELD + j], x[PHI + j] = electrons, over, phi
    x[LIMIT + j] = limit_of(phi, x[FACTOR + j], x[MOVED + j], x[LOAD + j])


@njit(inline="always")
def drawn(first: np.uint32, second: np.uint32, number: np.uint32, polynomial: tuple[np.float32, ...]) -> float:
    """The draw of a pixel of these keys for its spike of that number: standardised."""
    return standard(_U(first + _U(number * GOLDEN)), second, polynomial)  # type: ignore[no-any-return]


@njit(inline="always")
def after_reset(
    over: float, rate: float, limit: float, per_root_rate: float, per_rate: float, kept: float
) -> tuple[float, float]:
    """Charge after a reset [grains], and the electrons of which the next spike has noise [thresholds].

    Returns:
        The charge, and electrons up to the limit: light that falls while the node is held never reaches it, nor does
            its noise; a part of the charge that is lost leaves a rest that is known less well.
    """
    root, over = math.sqrt(rate), over / ONE
    left = ((over - root * per_root_rate) - rate * per_rate) * kept
    return on_grid(left * ONE), limit * (1.0 / ONE) - kept * (1.0 - kept) * over


@njit(inline="always")
def next_threshold(electrons: float, per_electron: float, kappa_squared: float, draw: float) -> float:
    """Threshold [grains] with the spread of so many electrons [thresholds] and of the reset."""
    return ONE + ONE * math.sqrt(max(electrons, 0.0) * per_electron + kappa_squared) * draw
