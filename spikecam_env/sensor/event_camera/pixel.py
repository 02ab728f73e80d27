"""The pixel of an event camera: it compares its light with a reference, and reports when their ratio has changed.

    c(t) = L(t) + dark                               light and dark current [radiance]
    r(t) = r_0 exp(-leak (t - t_0))                  reference, which leaks downwards since its last reset, t_0
    ON   at the first t with ln c(t) - ln r(t) >= theta_on
    OFF  at the first t with ln c(t) - ln r(t) <= -theta_off
    t_0 = t + refractory,   r_0 = c(t_0)             an event resets the reference, held at the light until then

theta_on and theta_off are each pixel's own, normal with spread `mismatch`.  Without a refractory period the reference
moves by one threshold instead, so that light that jumps gives all its events at once.

A leak of `leak_hz` thresholds a second gives ON events in light that stays.  Noise is a Poisson process of both
polarities, whose rate falls with the light:

    rate(t) = noise_hz (1 - (1 - noise_in_light) min(L(t), 1))

The photoreceptor follows at once.  That of a real camera is a low-pass filter whose bandwidth is proportional to the
light (some 100 Hz in dim rooms, kilohertz in bright ones): in dim light this camera is better than a real one.

Sources: pixel, refractory period and mismatch: Lichtsteiner, Posch and Delbruck, IEEE JSSC 43, 2008.  Rates, and all
values below but `dark`: Hu, Liu and Delbruck, v2e, CVPR workshops 2021, defaults of the public code; `noise_hz` and
`noise_in_light`: its setting "noisy".  Exact crossing times between key frames: as Rebecq, Gehrig and Scaramuzza, ESIM,
CoRL 2018, whose light is linear in its logarithm; here it is linear itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from spikecam_env.sensor.ranges import check_parameters, parameter
from spikecam_env.types import Floats

LEAST_THRESHOLD = 0.01
"""Smallest threshold of a pixel [ln light], whatever its mismatch; as v2e."""

LEAST_DARK, MOST_DARK = 1e-6, 10.0
"""[radiance] The logarithm of no light at all is infinite."""


@dataclass(frozen=True)
class EventPixel:
    """Parameters of an event camera's pixels.

    Raises:
        InputError: for a value outside its range.

    Example:
        >>> EventPixel(threshold_on=0.3).noiseless().mismatch
        0.0
    """

    threshold_on: float = parameter(
        0.2, unit="ln light", bounds=(LEAST_THRESHOLD, 5.0), doc="rise of the logarithm of light that gives an ON event"
    )
    threshold_off: float = parameter(
        0.2, unit="ln light", bounds=(LEAST_THRESHOLD, 5.0), doc="fall of the logarithm that gives an OFF event"
    )
    mismatch: float = parameter(
        0.03, unit="ln light", bounds=(0.0, 1.0), doc="standard deviation of both thresholds over the pixels"
    )
    dark: float = parameter(
        0.0023,
        unit="radiance",
        bounds=(LEAST_DARK, MOST_DARK),
        doc="dark current as light; that of the preset scsim: 0.444 pA of 190 pA at radiance 1",
    )
    refractory_us: float = parameter(
        500.0, unit="us", bounds=(0.0, 1e6), doc="time after an event in which the pixel is held in reset"
    )
    leak_hz: float = parameter(
        0.1, unit="Hz", bounds=(0.0, 1e4), doc="ON events a second of a nominal pixel in light that stays"
    )
    noise_hz: float = parameter(
        5.0, unit="Hz", bounds=(0.0, 1e4), doc="noise events a second in the dark, half of each polarity"
    )
    noise_in_light: float = parameter(
        0.25, unit="share", bounds=(0.0, 1.0), doc="share of `noise_hz` that is left at radiance 1 and above"
    )

    def __post_init__(self) -> None:
        check_parameters(self, "event_pixel")

    def noiseless(self) -> EventPixel:
        """The same without mismatch, leak and noise."""
        return replace(self, mismatch=0.0, leak_hz=0.0, noise_hz=0.0)

    def law(self, frame_rate_hz: float) -> Law:
        """The law in frames."""
        return Law(
            dark=self.dark,
            leak=self.leak_hz * self.threshold_on / frame_rate_hz,
            refractory=self.refractory_us * 1e-6 * frame_rate_hz,
            noise=self.noise_hz / frame_rate_hz,
            noise_in_light=self.noise_in_light,
        )

    def draw_thresholds(self, pixels: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """theta_on and theta_off of each pixel, (P,) each [ln light]."""
        nominal = np.array([[self.threshold_on], [self.threshold_off]])
        on, off = np.maximum(nominal + self.mismatch * rng.standard_normal((2, pixels)), LEAST_THRESHOLD)
        return on, off


class Law(NamedTuple):
    """Parameters that all pixels share, for compiled code; times in frames."""

    dark: float
    """[radiance]."""
    leak: float
    """Fall of the reference [ln light a frame]."""
    refractory: float
    """[frames]."""
    noise: float
    """Noise events a frame in the dark."""
    noise_in_light: float
    """Share of them at radiance 1."""
