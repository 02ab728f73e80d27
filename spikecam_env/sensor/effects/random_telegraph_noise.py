"""Random telegraph noise: a trap in some pixels switches an extra dark current on and off.

    I_dark(t) += a s(t),  s in {0, 1}, leaving each state at rate 1/dwell
    count in a window W: variance (a/2)^2 2 (d W - d^2 (1 - exp(-W/d))),  d = dwell/2

Stage: photodiode.  Seen in: dark recordings: counts of these pixels have two levels, windows shorter than the dwell.
Twins: spurious_spikes (no levels), threshold_flicker_noise (all pixels, also in the light).
Source: dark-current RTN in irradiated CCD pixels (Hopkins and Hopkinson 1993); one trap a pixel,
even dwell times assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor.effects.base import Array, Charge, Effect, Exposure, Few, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs

AHEAD = 4096
"""Switches that are drawn at once."""


class Traps(NamedTuple):
    """pixels: flat indices (n,) of those with a trap.  upper: (n,) which are in the upper state.

    charge: (n,) thresholds a frame in that state.  switches: (k,) those to come, ascending, as places in the frames'
    states (F, n), flat, from the next frame on; at least one.  rng: what draws more.
    """

    pixels: NDArray[np.intp]
    upper: NDArray[np.bool_]
    charge: Array
    switches: NDArray[np.int64]
    rng: np.random.Generator


@dataclass(frozen=True)
class RandomTelegraphNoise(Effect):
    amplitude_pA: float = parameter(0.5, unit="pA", bounds=(0.0, 1e4), doc="extra current a in the upper state")
    fraction: float = parameter(0.02, unit="relative", bounds=(0.0, 1.0), doc="share of pixels with a trap")
    dwell_ms: float = parameter(10.0, unit="ms", bounds=(1e-3, 1e7), doc="mean time in a state")

    stage = Stage.PHOTODIODE
    strength = "amplitude_pA"
    identification = Identification(
        family="dark",
        fitted=("amplitude_pA", "fraction", "dwell_ms"),
        shapes={"dwell_ms": (0.5, 3.0, 20.0)},
        square=True,
        needs=Needs.STEADY,
        few_pixels=True,
        share=("fraction", "pixels"),
    )

    def begin(self, first: Exposure, pattern: np.random.Generator, rng: np.random.Generator) -> Traps:
        pixels = np.flatnonzero(pattern.random(first.shape) < self.fraction)
        charge = first.charge_of(self.amplitude_pA).reshape(-1)[pixels]
        upper = rng.random(pixels.size) < 0.5
        return Traps(pixels, upper, charge, self._after(-1, first.frame_rate_hz, rng), rng)

    def collect(self, light: Charge, dark: Charge, now: Exposure, memory: Traps) -> tuple[Charge, Charge, Traps]:
        upper = np.zeros((now.frames, memory.pixels.size), np.bool_)
        to_come = [memory.switches]
        while to_come[-1][-1] < upper.size:
            to_come.append(self._after(to_come[-1][-1], now.frame_rate_hz, memory.rng))
        switches = np.concatenate(to_come)
        here = np.searchsorted(switches, upper.size)
        upper.reshape(-1)[switches[:here]] = True
        for before, after in pairwise([memory.upper, *upper]):
            np.logical_xor(before, after, out=after)
        raised = dark.plus(Few(memory.pixels, memory.charge * upper))
        return light, raised, memory._replace(upper=upper[-1].copy(), switches=switches[here:] - upper.size)

    def _after(self, last: int, frame_rate_hz: float, rng: np.random.Generator) -> NDArray[np.int64]:
        """(AHEAD,) places of the switches that follow one: each frame every trap switches with the same probability."""
        leaves = -math.expm1(-2e3 / (self.dwell_ms * frame_rate_hz)) / 2.0
        return np.asarray(last + np.cumsum(rng.geometric(leaves, AHEAD)))
