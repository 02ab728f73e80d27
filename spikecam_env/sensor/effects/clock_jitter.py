"""Clock jitter: the read-out comes early or late, for all pixels alike.

    frame t lasts 1 + j_(t+1) - j_t frames,  j ~ N(0, sigma^2)        (each edge is off by itself; no drift)

Stage: read-out.  Seen in: spikes a frame over the whole array: variance 2 (x sigma)^2, lag-1 correlation -1/2.
Twins: common_threshold_noise (does not grow with light), light_flicker (a line).
Within a frame: integrated over the frame between its edges, in light that is linear on both sides of each; refused
where light bends so much that an edge late by sigma is off by 1 %.
Source: period jitter of a clock; nanoseconds in practice.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Bend, Charge, Effect, ExposureBlock, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response
from spikecam_env.types import Floats


class Edge(NamedTuple):
    """The last edge."""

    at: float
    """Delay of the last read-out [standard deviations]."""
    rng: np.random.Generator


@dataclass(frozen=True)
class ClockJitter(Effect):
    sigma_ns: float = parameter(20.0, unit="ns", bounds=(0.0, 5000.0), doc="standard deviation of an edge")

    stage = Stage.READOUT
    acts = Acts.INTEGRATED
    strength = "sigma_ns"
    wants_rise = True
    identification = Identification(family="common", response=Response.QUADRATIC, needs=Needs.STEADY)

    def begin(self, first: ExposureBlock, pattern: np.random.Generator, rng: np.random.Generator) -> Edge:
        return Edge(rng.standard_normal(), rng)

    def collect(self, light: Charge, dark: Charge, now: ExposureBlock, memory: Edge) -> tuple[Charge, Charge, Edge]:
        edges = np.concatenate([[memory.at], memory.rng.standard_normal(now.frames)])
        late = (edges * (self.sigma_ns * 1e-9 * now.frame_rate_hz))[:, None, None]
        begin, end = late[:-1], late[1:]
        length = 1.0 + (end - begin)
        rises = light.rises
        read = light.scaled(length)
        if rises.any():
            read = Charge(read.values + rises * ((end + begin) * length / 2.0), 1.0, rises)
        return read, dark.scaled(length), Edge(edges[-1], memory.rng)

    def off_the_line(self, bend: Bend, now: ExposureBlock) -> Floats:
        return bend.bent * (self.sigma_ns * 1e-9 * now.frame_rate_hz)
