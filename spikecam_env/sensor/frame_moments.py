"""Closed forms of factors that change within a frame: means over it, and moments about its middle.

An effect that multiplies charge by w(t) needs, of t in frames from the middle of the frame,

    mean = integral of w        tilt = 12 integral of t w        square = 12 integral of t^2 w        over [-1/2, 1/2]

for light x + d t then collects x mean + d tilt / 12 and rises by x tilt + d square (`Charge.modulated`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spikecam_env.types import Floats

_SMALL = 0.01
"""Angle a frame below which a series to its square is exact to 1e-10, and the closed forms lose as many digits."""


class Moments(NamedTuple):
    """Moments of a factor of light in every frame of a block, (F, 1, 1) each; see the module's equation."""

    mean: Floats
    tilt: Floats
    square: Floats


def wave_moments(amplitude: float, cycles_per_frame: float, cycles_at_middle: Floats) -> Moments:
    """Of 1 + amplitude sin(2 pi (cycles_at_middle + cycles_per_frame t)); exactly 1, 0, 1 at amplitude 0."""
    angle = 2.0 * math.pi * cycles_at_middle
    a = 2.0 * math.pi * cycles_per_frame
    sine, cosine = amplitude * np.sin(angle), amplitude * np.cos(angle)
    first, second = _odd_moment(a), _even_moment(a)
    return Moments(1.0 + float(np.sinc(cycles_per_frame)) * sine, 12.0 * first * cosine, 1.0 + 12.0 * second * sine)


def mean_decay(frames_before: Floats, tau: float) -> Floats:
    """Mean of exp(-t/tau) over the frame that begins so many frames after t = 0; tau [frames]."""
    mean: Floats = np.exp(-frames_before / tau) * (-math.expm1(-1.0 / tau) * tau)
    return mean


def decay_moment(tau: float) -> float:
    """Integral of (t - 1/2) exp(-t/tau) over [0, 1]; tau [frames]."""
    b = 1.0 / tau
    if b < _SMALL:
        return -math.exp(-b / 2.0) * b / 12.0 * (1.0 + b * b / 40.0)
    return -((1.0 + math.exp(-b)) / 2.0 + math.expm1(-b) / b) / b


def _odd_moment(a: float) -> float:
    """Integral of t sin(a t) over [-1/2, 1/2]."""
    if a < _SMALL:
        return a / 12.0 * (1.0 - a * a / 40.0)
    return (2.0 * math.sin(a / 2.0) / a - math.cos(a / 2.0)) / a


def _even_moment(a: float) -> float:
    """Integral of t^2 cos(a t) over [-1/2, 1/2]."""
    if a < _SMALL:
        return 1.0 / 12.0 - a * a / 160.0
    return math.sin(a / 2.0) / (2.0 * a) + 2.0 * math.cos(a / 2.0) / a**2 - 4.0 * math.sin(a / 2.0) / a**3
