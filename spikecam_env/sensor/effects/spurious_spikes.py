"""Spurious spikes: the read-out reports a spike where there was none; the pixel goes on collecting.

    each empty bit becomes a spike with probability p;   dark rate = p

Stage: read-out.  Seen in: the dark (a rate that is Poisson, unlike the pixel's); static light: intervals cut in two.
Twins: random_telegraph_noise (two levels), afterpulsing (a fixed time after a spike), dark_current (regular).
Within a frame: at the end of the frame; it acts on the bit that is read.
Source: bit errors of the link or a metastable latch; independent by assumption.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor.effects.base import Acts, Effect, ExposureBlock, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response
from spikecam_env.types import Masks

_AT_ONCE = 256
"""Gaps drawn at a time."""

_LONGEST = 1 << 52
"""A gap of never, short enough that a few hundred of them still add up in 64 bits."""


class Strikes(NamedTuple):
    """The next bits struck."""

    at: NDArray[np.int64]
    """As frame * pixels + pixel (n,), in order, at least one."""
    rng: np.random.Generator


@dataclass(frozen=True)
class SpuriousSpikes(Effect):
    probability: float = parameter(1e-5, unit="per frame", bounds=(0.0, 1.0), doc="chance p of a false spike")

    stage = Stage.READOUT
    acts = Acts.END
    strength = "probability"
    identification = Identification(
        family="readout", response=Response.EVENTS, needs=Needs.STEADY, share=("probability", "frames")
    )

    def begin(self, first: ExposureBlock, pattern: np.random.Generator, rng: np.random.Generator) -> Strikes:
        return Strikes(np.array([-1]), rng)

    def read_out(self, spikes: Masks, now: ExposureBlock, memory: Strikes) -> tuple[Masks, Strikes]:
        if self.probability == 0.0:
            return spikes, memory
        start = now.number * (spikes.size // now.frames)
        at = self.struck_until(start + spikes.size, memory)
        due = at[(at >= start) & (at < start + spikes.size)]
        reported = spikes.copy()
        reported.reshape(-1)[due - start] = True
        return reported, Strikes(at[at >= start + spikes.size], memory.rng)

    def struck_until(self, end: int, memory: Strikes) -> NDArray[np.int64]:
        """Bits struck, up to one at or after `end`: the gaps between them are geometric."""
        runs = [memory.at]
        while runs[-1][-1] < end:
            gaps = np.minimum(memory.rng.geometric(self.probability, _AT_ONCE), _LONGEST)
            runs.append(runs[-1][-1] + np.cumsum(gaps))
        return np.concatenate(runs)
