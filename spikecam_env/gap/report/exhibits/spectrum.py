"""The spectrum of the array's spikes a frame, in the light and in the dark."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy
from numpy.typing import NDArray

from spikecam_env.gap.report.panels import Array, PlotPanel, largest, takes
from spikecam_env.gap.result import Evidence

TITLE = "Spectrum of the population"
CAPTION = (
    "Power of the number of spikes of the whole array, over that of independent random spikes. Lines are flicker or "
    "ripple: in lit recordings only, or in the dark too. Combs at multiples of the rate are the pixels' own beat."
)

NONE = 1e-12
"""Power over white noise's that is none: a model without dark current is silent in the dark."""

_SEGMENT = 1024
"""Frames of a window at most."""


def panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[PlotPanel]:
    """Power of the population's spike count over frequency: of the lit recording furthest off, and of the dark one."""
    for kind in (("flat", "picture", "unknown"), ("dark",)):
        made = []
        for t in takes(evidence, kind):
            if t.measured.frame.sum() < 100 or len(t.measured.frame) < 128:
                continue
            frequency, measured, count = averaged(t.measured.frame, frame_rate_hz)
            before = averaged(t.before.frame, frame_rate_hz)[1]
            after = averaged(t.after.frame, frame_rate_hz)[1] if t.after else None
            sd = before * np.sqrt(2 / count)
            sd = np.maximum(sd, before * _local_scatter(np.log(np.maximum(measured, NONE) / np.maximum(before, NONE))))
            made.append(PlotPanel(f"Power spectrum, {t.shown.name}", "frequency [Hz]", "power over white noise's [1]",
                                frequency, measured, before, after, sd, log="xy"))  # fmt: skip
        yield from largest(made, 1)


def _local_scatter(log_ratio: Array) -> Array:
    """Scatter of the logarithm of a ratio between adjacent frequencies.

    Pixels that keep their beat make periodogram values depend on one another, more at some frequencies than at others;
    their scatter shows it, and sees neither a few lines nor a broad rise.
    """
    jumps = np.abs(np.diff(log_ratio))
    local = scipy.ndimage.median_filter(jumps, 21, mode="nearest") * 1.4826 / np.sqrt(2)
    return np.append(local, local[-1])


def averaged(counts: NDArray[np.int32], frame_rate_hz: float) -> tuple[Array, Array, Array]:
    """Frequency [Hz], power over that of Poisson spikes of the same mean, and how many values each mean is over.

    Half-overlapping Hann windows; frequencies are pooled to 24 an octave and three at least.
    """
    length = min(_SEGMENT, len(counts) // 4 // 2 * 2)
    first = np.arange(0, len(counts) - length + 1, length // 2)
    window = np.hanning(length)
    parts = np.stack([counts[i : i + length] for i in first]).astype(np.float64)
    scale = (window**2).sum() * max(float(parts.mean()), 1e-12)
    power = np.abs(np.fft.rfft((parts - parts.mean()) * window, axis=1)) ** 2 / scale
    frequency = np.fft.rfftfreq(length, 1 / frame_rate_hz)
    band = np.round(24 * np.log2(np.maximum(np.arange(frequency.size), 1))).astype(int)
    _, inverse = np.unique(band[1:], return_inverse=True)
    size = np.bincount(inverse).astype(np.float64)
    mean = np.bincount(inverse, power.mean(axis=0)[1:]) / size
    return np.bincount(inverse, frequency[1:]) / size, mean, size * max(1.0, 0.55 * len(first))
