"""Brightness: a factor between rates and the spikes that are made of them, for networks that read spikes in dim light.

    spikes = decoder(brightness * rate)          cut to one spike a frame, where a pixel saturates

Rates themselves stay as they are, so light is read from them; light that is read from spikes has to be divided by the
factor.  A stream of few spikes starves a network that was trained on more: docs/results/denoiser.md has by how much.
"""

from __future__ import annotations

import numpy as np

from spikecam_env.checked import checked_number
from spikecam_env.types import Pictures, Spikes

BOUNDS = (0.01, 100.0)
"""Least and greatest factor: a rate of a spike in 100 frames becomes one in every frame, or the other way round."""
TARGET = 0.1
"""Mean spikes a frame and pixel that `automatic` brings a stream to: one in ten frames, as in the sets of the paper."""
MOST_SATURATED = 0.01
"""Share of pixels that `automatic` lets saturate."""
WINDOW = 41
"""Frames from which `automatic` takes a rate: a spike more or less is 2 % of saturation."""
LOOKS = 16
"""Windows that `automatic` looks at, evenly over a stream."""


def checked_brightness(brightness: float) -> float:
    """The factor; InputError where it is no number in BOUNDS.

    Example:
        >>> checked_brightness(4)
        4.0
    """
    return float(checked_number(brightness, "brightness", *BOUNDS))


def automatic(spikes: Spikes) -> float:
    """The factor that brings the mean of a recorded stream to TARGET; less where more than MOST_SATURATED of its pixels
    would saturate, and never below 1.

    Args:
        spikes: (T, H, W).

    Returns:
        The factor, cut to a tenth.

    Example:
        >>> automatic(np.eye(40, dtype=np.uint8).reshape(40, 1, 40))
        4.0
    """
    frames = len(spikes)
    if not spikes.any():
        return 1.0
    window = min(WINDOW, frames)
    starts = np.unique(np.linspace(0, frames - window, LOOKS).astype(int))
    rates = np.stack([spikes[start : start + window].mean(axis=0, dtype=np.float32) for start in starts])
    brightest = float(np.quantile(rates, 1 - MOST_SATURATED))
    factor = min(TARGET / float(spikes.mean()), 1.0 / brightest if brightest > 0 else np.inf, BOUNDS[1])
    return max(1.0, float(np.floor(10 * factor + 1e-6)) / 10)


def brightened(rates: Pictures, brightness: float) -> Pictures:
    """Rates times a brightness; the same array where that is 1."""
    return rates if brightness == 1.0 else rates * np.float32(brightness)


def saturating(rates: Pictures, brightness: float) -> int:
    """How many rates are cut, since they ask for more than one spike a frame.

    Example:
        >>> saturating(np.array([0.1, 0.3]), 4.0)
        1
    """
    return int(np.count_nonzero(rates > 1.0 / brightness))
