"""Power spectrum of the array's spikes a frame in steady light: bands, and the strongest line.

Reveals light_flicker (lines in the light), supply_ripple (in the dark too), common_threshold_noise and clock_jitter
(white, differenced), lamp_drift (low bands).
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.observe.conditions import STEADY
from spikecam_env.gap.statistics.reading import CampaignReading, log
from spikecam_env.types import Floats

BANDS = 8

_SIDE = 25
"""Bins to either side whose median a line is compared with."""


def spectrum(frame: NDArray[np.int32]) -> Floats:
    """Periodogram of spikes a frame, relative to their mean; bin n is n cycles in the recording.

    It is tapered (Hann): spikes are noise of high frequency, and a recording's two ends, which cut intervals, would
    leak it to the lowest.

    Args:
        frame: (F,) spikes.
    """
    relative = frame / max(float(frame.mean()), 1e-9) - 1.0
    taper = np.hanning(len(frame))
    power: Floats = np.abs(np.fft.rfft(taper * relative)) ** 2 / (taper @ taper)
    return power


def bands(frames: int) -> NDArray[np.int64]:
    """Edges [bins] of the bands, in even steps of log frequency from 3 cycles in the recording to half the rate."""
    return np.unique(np.round(np.geomspace(3, frames // 2, BANDS + 1)).astype(np.int64))


def statistics(reading: CampaignReading, i: int) -> dict[str, float]:
    """Bands and the strongest line.

    Returns:
        band n: log power.
        line: log of the strongest bin over its neighbourhood, below a quarter of the rate.
    """
    if reading.conditions[i].kind not in STEADY:
        return {}
    o = reading.observations[i]
    if o.frame.sum() < 500:
        return {}
    power = spectrum(o.frame)
    edges = bands(o.frames)
    values = {f"band {n}": log(float(power[a:b].mean())) for n, (a, b) in enumerate(itertools.pairwise(edges))}
    values["line"] = log(strongest_line(power)[1])
    return values


def strongest_line(power: Floats) -> tuple[int, float]:
    """The strongest bin above the slowest two.

    The neighbourhood is the side of more power: where dim pixels' own rates begin, power rises a thousandfold in
    ten bins, and the first of them would stand out as a line.

    Args:
        power: (n,) `spectrum`.

    Returns:
        (bin, power over the median of its neighbourhood).
    """
    low = power[3 : max(len(power) // 2, 8)]
    width = min(_SIDE, len(low) - 1)
    padded = np.pad(low, width, mode="reflect")
    sides = np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
    ratio = low / np.maximum(np.maximum(sides[: len(low)], sides[-len(low) :]), 1e-30)
    at = int(np.argmax(ratio))
    return at + 3, float(ratio[at])


def frequency(frame: NDArray[Any], at: int) -> float:
    """Frequency [cycles a frame] of a line near bin `at`: where the transform is largest between the bins."""
    t = np.arange(len(frame))
    relative = (frame - frame.mean()) * np.hanning(len(frame))
    fine = (at + np.linspace(-1.0, 1.0, 41)) / len(frame)
    power = [abs(np.exp(-2j * np.pi * f * t) @ relative) for f in fine]
    return float(fine[int(np.argmax(power))])
