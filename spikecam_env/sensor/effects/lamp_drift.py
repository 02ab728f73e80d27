"""Lamp drift: the light wanders slowly, for all pixels alike.

    L(t) <- L(t) max(1 + w(t), 0),   w a random walk with w(0) = 0 and variance sigma^2 t

Stage: optics.  Seen in: lit recordings: the population's rate wanders, variance growing with time, dark does not.
Twins: light_flicker (a line), dark_current_drift (in the dark).
Within a frame: integrated over the frame, but where the walk would make light negative in a part of it.
Source: form assumed; a random walk is the usual model of a free-running source (power as 1/f^2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Charge, Effect, ExposureBlock, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response


class Walk(NamedTuple):
    """State of the random walk."""

    at: float
    rng: np.random.Generator
    """For steps from frame to frame."""
    within: np.random.Generator
    """For the walk within frames."""


@dataclass(frozen=True)
class LampDrift(Effect):
    sigma_per_root_s: float = parameter(
        0.02, unit="1/sqrt(s)", bounds=(0.0, 10.0), doc="relative standard deviation after one second"
    )

    stage = Stage.OPTICS
    acts = Acts.INTEGRATED
    strength = "sigma_per_root_s"
    identification = Identification(family="light", response=Response.COURSE, needs=Needs.STEADY)

    def begin(self, first: ExposureBlock, pattern: np.random.Generator, rng: np.random.Generator) -> Walk:
        return Walk(0.0, rng, rng.spawn(1)[0])

    def collect(self, light: Charge, dark: Charge, now: ExposureBlock, memory: Walk) -> tuple[Charge, Charge, Walk]:
        sigma = self.sigma_per_root_s / math.sqrt(now.frame_rate_hz)
        steps, bridge = (sigma * rng.standard_normal(now.frames) for rng in (memory.rng, memory.within))
        path = np.cumsum(np.concatenate([[memory.at], steps]))
        mean = (path[1:] + path[:-1]) / 2.0 + bridge / math.sqrt(12.0)
        return light.scaled(np.maximum(1.0 + mean[:, None, None], 0.0)), dark, memory._replace(at=path[-1])
