"""Random telegraph noise: a trap in some pixels switches an extra dark current on and off.

    I_dark(t) += a s(t),  s in {0, 1}, leaving each state at rate 1/dwell
    count in a window W: variance (a/2)^2 2 (d W - d^2 (1 - exp(-W/d))),  d = dwell/2

Stage: photodiode.  Seen in: dark recordings: counts of these pixels have two levels, windows shorter than the dwell.
Twins: spurious_spikes (no levels), threshold_flicker_noise (all pixels, also in the light).
Within a frame: integrated over the frame; a switch is timed to 2^-16 of a frame.
Source: dark-current RTN in irradiated CCD pixels (Hopkins and Hopkinson 1993); one trap a pixel,
even dwell times assumed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor.effects.base import Acts, Charge, Effect, ExposureBlock, Few, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response
from spikecam_env.types import Floats

AHEAD = 4096
"""Switches that are drawn at once."""

TICKS = 1 << 16
"""To a frame: in whole ones, when a switch comes does not depend on where a recording is cut."""

_LONGEST = 1 << 50
"""Ticks of a gap at most, so that AHEAD of them add up in 64 bits."""


class Traps(NamedTuple):
    """The traps of a unit, and their next switches."""

    pixels: NDArray[np.intp]
    """Flat indices (n,) of pixels with a trap."""
    upper: NDArray[np.bool_]
    """(n,), in the upper state."""
    charge: Floats
    """(n,) thresholds a frame in that state."""
    switches: NDArray[np.int64]
    """(k,) to come, ascending, at least one [ticks]: the n traps' first frames one after the other, then their second
    frames, from the next frame on."""
    rng: np.random.Generator


@dataclass(frozen=True)
class RandomTelegraphNoise(Effect):
    amplitude_pA: float = parameter(0.5, unit="pA", bounds=(0.0, 1e4), doc="extra current a in the upper state")
    fraction: float = parameter(0.02, unit="relative", bounds=(0.0, 1.0), doc="share of pixels with a trap")
    dwell_ms: float = parameter(10.0, unit="ms", bounds=(1e-3, 1e7), doc="mean time in a state")

    stage = Stage.PHOTODIODE
    acts = Acts.INTEGRATED
    strength = "amplitude_pA"
    identification = Identification(
        family="dark",
        fitted=("amplitude_pA", "fraction", "dwell_ms"),
        shapes={"dwell_ms": (0.5, 3.0, 20.0)},
        response=Response.FEW_PIXELS,
        needs=Needs.STEADY,
        share=("fraction", "pixels"),
    )

    def begin(self, first: ExposureBlock, pattern: np.random.Generator, rng: np.random.Generator) -> Traps:
        pixels = np.flatnonzero(pattern.random(first.shape) < self.fraction)
        charge = first.charge_of(self.amplitude_pA).reshape(-1)[pixels]
        upper = rng.random(pixels.size) < 0.5
        return Traps(pixels, upper, charge, self._after(0, first.frame_rate_hz, rng), rng)

    def collect(self, light: Charge, dark: Charge, now: ExposureBlock, memory: Traps) -> tuple[Charge, Charge, Traps]:
        traps = memory.pixels.size
        end, to_come = now.frames * traps * TICKS, [memory.switches]
        while to_come[-1][-1] < end:
            to_come.append(self._after(to_come[-1][-1], now.frame_rate_hz, memory.rng))
        switches = np.concatenate(to_come)
        here = np.searchsorted(switches, end)
        share, upper = share_in_upper(memory.upper, switches[:here], now.frames)
        raised = dark.plus(Few(memory.pixels, memory.charge * share))
        return light, raised, memory._replace(upper=upper, switches=switches[here:] - end)

    def _after(self, last: int, frame_rate_hz: float, rng: np.random.Generator) -> NDArray[np.int64]:
        """(AHEAD,) switches that follow one: in all frames of all traps, laid end to end, a Poisson stream."""
        gaps = rng.exponential(1e-3 * self.dwell_ms * frame_rate_hz * TICKS, AHEAD)
        return np.asarray(last + np.cumsum(np.minimum(gaps, _LONGEST).astype(np.int64)))


def share_in_upper(
    upper: NDArray[np.bool_], switches: NDArray[np.int64], frames: int
) -> tuple[Floats, NDArray[np.bool_]]:
    """Share (F, n) of each frame that each trap spends in the upper state, and the state after them.

    Args:
        upper: (n,) before these frames.
        switches: as of `Traps`, of these frames.
        frames: how many, F.
    """
    place, tick = np.divmod(switches, TICKS)
    odd = np.bincount(place, minlength=frames * upper.size).reshape(frames, upper.size) % 2 == 1
    states = np.logical_xor.accumulate(np.concatenate([upper[None], odd]), axis=0)
    share = states[:-1].astype(np.float64)
    nth = np.arange(place.size) - np.searchsorted(place, place)
    raises = np.where(states[:-1].reshape(-1)[place] ^ (nth % 2 == 1), -1.0, 1.0)
    np.add.at(share.reshape(-1), place, raises * (1.0 - tick / TICKS))
    return share, states[-1].copy()
