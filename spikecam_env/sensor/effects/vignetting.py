"""Vignetting: the lens passes less light towards the corners.

    alpha(r) <- alpha (1 - v r^2 / r_corner^2)        r from the centre, r_corner to the corner farthest from it

Stage: optics.  Seen in: flats: a radial bowl, in proportion to light; absent in the dark.
Twins: conversion_gain_spread (rough, not radial).
Within a frame: constant in time.
Source: first order of the cos^4 law, v = 2 tan^2(field angle); measured flat maps show 4 to 5 % of smooth
shading about a centre above the middle, of which 1 % is left beside this law.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.sensor.unit import PixelArray


@dataclass(frozen=True)
class Vignetting(Effect):
    falloff: float = parameter(0.1, unit="relative", bounds=(0.0, 1.0), doc="light lost in the farthest corner, v")
    centre_x: float = parameter(0.5, unit="relative", bounds=(0.0, 1.0), doc="first column 0, last column 1")
    centre_y: float = parameter(0.5, unit="relative", bounds=(0.0, 1.0), doc="first row 0, last row 1")

    stage = Stage.OPTICS
    acts = Acts.CONSTANT
    strength = "falloff"
    identification = Identification(family="optics", needs=Needs.EVEN)

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        rows, columns = pixels.gain.shape
        y, x = np.mgrid[:rows, :columns]
        square = (y - self.centre_y * (rows - 1)) ** 2 + (x - self.centre_x * (columns - 1)) ** 2
        return replace(pixels, gain=pixels.gain * (1.0 - self.falloff * square / max(square.max(), 1.0)))
