"""Pixels spike by spike under a disturbance c(v) of the threshold: the maps of `phases`, one pixel after another.

    t' = Theta(t + T (1 + xi)),  xi normal, variance `white`;  counted in frame floor(t' - b), b the row's phase

It shares no code with the sensor, and is a hundred times as fast: recordings of a whole array in seconds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.types import Floats

POINTS = 1000
"""Of the frame, at which c is tabled; a fall takes one of them, 50 ns at 20 kHz."""

_SETTLE = 12
"""Spikes before the recording, in which phases gather."""


def falling_edge(phase: Floats, amplitude: float, moment: float, tau: float, fall: float) -> Floats:
    """An edge that decays with tau, behind an RC of time constant `fall` [frames]; mean 0, fall 0: `phases.edge`.

    amplitude: the step before the RC.  The response is that of a frame after many.
    """
    since = np.mod(phase - moment, 1.0)
    decays = np.exp(-since / tau)
    mean = tau * -np.expm1(-1.0 / tau)
    if fall <= 0.0:
        plain: Floats = amplitude * (decays - mean)
        return plain
    share = np.expm1(-1.0 / tau) / np.expm1(-1.0 / fall)
    mean_fall = share * fall * -np.expm1(-1.0 / fall)
    shaped: Floats = amplitude * tau / (tau - fall) * (decays - share * np.exp(-since / fall) - (mean - mean_fall))
    return shaped


def tabled(law: Floats | None) -> Floats:
    """The table that `recorded` takes: `law` at i / POINTS, none for no disturbance."""
    return np.zeros(POINTS) if law is None else law


def recorded(
    interval: Floats, start: Floats, table: Floats, white: float, frames: int, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """(frames, P) spikes of pixels of free intervals (P,) [frames], in rows that begin at phases `start` (P,)."""
    spikes = np.zeros((frames, interval.size), np.uint8)
    _fire(interval, start, table, np.sqrt(white), frames, rng, spikes)
    return np.minimum(spikes, 1, out=spikes)


def counts(
    interval: Floats, start: Floats, table: Floats, white: float, frames: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """(P,) numbers of spikes of the same pixels in `frames` frames."""
    number = np.zeros((1, interval.size), np.int64)
    _fire(interval, start, table, np.sqrt(white), frames, rng, number)
    return np.asarray(number[0])


@njit(cache=True)
def _psi(table: Floats, interval: float, out: Floats) -> None:
    """Psi at i / POINTS into out (POINTS + 1,); what came before the frame is its own maximum, a frame less."""
    points = table.size
    highest = -1e30
    for i in range(points):
        highest = max(highest, i / points - interval * table[i])
    highest -= 1.0
    for i in range(points):
        highest = max(highest, i / points - interval * table[i])
        out[i] = highest
    out[points] = out[0] + 1.0


@njit(cache=True)
def _theta(psi: Floats, y: float) -> float:
    """The time at which Psi comes to y, linear between its points."""
    points = psi.size - 1
    whole = np.floor(y - psi[0])
    at = y - whole
    low, high = 0, points
    while high - low > 1:
        middle = (low + high) // 2
        if psi[middle] < at:
            low = middle
        else:
            high = middle
    rise = psi[high] - psi[low]
    part = (at - psi[low]) / rise if rise > 0.0 else 1.0
    return whole + (low + min(max(part, 0.0), 1.0)) / points  # type: ignore[no-any-return]


@njit(cache=True)
def _fire(
    interval: Floats,
    start: Floats,
    table: Floats,
    noise: float,
    frames: int,
    rng: np.random.Generator,
    out: NDArray[np.uint8] | NDArray[np.int64],
) -> None:
    """Add the spikes to out, (frames, P) by frame, or (1, P) together."""
    together = len(out) == 1
    psi = np.empty(table.size + 1)
    for p in range(interval.size):
        _psi(table, interval[p], psi)
        t = (rng.random() - 1.0 - _SETTLE) * interval[p]
        while True:
            t = _theta(psi, t + interval[p] * (1.0 + noise * rng.standard_normal()))
            frame = np.floor(t - start[p])
            if frame >= frames:
                break
            if frame >= 0:
                out[0 if together else int(frame), p] += 1
