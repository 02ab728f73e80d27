"""Read-out skew: rows are read one after the other, the first earlier than the last.

    row r is read e = s (1 - r/(H - 1)) frames before the end of the frame that its bit is counted in
    light of its frame: x_t <- (1 - e) x_t + e x_(t-1)

Stage: read-out.  Seen in: steps of light (a row's response comes up to s frames later), moving edges (a slant);
nothing in static light.
Source: sequential read-out of rows, as in a rolling shutter.  Light within a frame, and before
frame 0, is taken as steady.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Array, Charge, Effect, Exposure, Stage, parameter


@dataclass(frozen=True)
class ReadoutSkew(Effect):
    span: float = parameter(0.9, unit="frames", bounds=(0.0, 1.0), doc="time s that reading all rows takes")

    stage = Stage.READOUT
    strength = "span"

    def begin(self, first: Exposure, pattern: np.random.Generator, rng: np.random.Generator) -> None:
        return None

    def collect(
        self, light: Charge, dark: Charge, now: Exposure, memory: Array | None
    ) -> tuple[Charge, Charge, Array | None]:
        x = light.values
        first = x[0] if memory is None else memory
        if len(x) == 1 and np.array_equal(first, x[0]):
            return light, dark, first
        x = np.broadcast_to(x, (now.frames, *now.shape))
        rows = now.shape[0]
        early = self.span * (1.0 - np.arange(rows)[:, None] / max(rows - 1, 1))
        before = np.concatenate([first[None], x[:-1]])
        return Charge(x + early * (before - x)), dark, x[-1].copy()
