"""Read-out skew: rows are read one after the other, the first earlier than the last.

    row r is read e = s (1 - r/(H - 1)) frames before the end of the frame that its bit is counted in
    light of its frame: x_t <- x_t + e (x_(t-1) - x_t) + e (1 - e) / 2 (d_(t-1) - d_t)

Stage: read-out.  Seen in: steps of light (a row's response comes up to s frames later), moving edges (a slant);
nothing in static light.
Within a frame: integrated over the frame, in light that is linear in it.
Source: sequential read-out of rows, as in a rolling shutter.  The light x_t of a frame rises by d_t from its start to
its end: exact where it is linear in a frame.  Before frame 0 it is taken as steady; where another effect has changed it
otherwise than by a factor, within a frame as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Array, Charge, Effect, Exposure, Stage, Within, parameter


@dataclass(frozen=True)
class ReadoutSkew(Effect):
    span: float = parameter(0.9, unit="frames", bounds=(0.0, 1.0), doc="time s that reading all rows takes")

    stage = Stage.READOUT
    within = Within.INTEGRATED
    strength = "span"
    within_frame = True

    def begin(self, first: Exposure, pattern: np.random.Generator, rng: np.random.Generator) -> None:
        return None

    def collect(
        self, light: Charge, dark: Charge, now: Exposure, memory: tuple[Array, Array] | None
    ) -> tuple[Charge, Charge, tuple[Array, Array]]:
        x, d = light.values, light.rises
        last, last_d = memory or (x[0], np.zeros(now.shape))
        if len(x) == 1 and not d.any() and not last_d.any() and np.array_equal(last, x[0]):
            return light, dark, (last, last_d)
        x, d = np.broadcast_to(x, (now.frames, *now.shape)), np.broadcast_to(d, (now.frames, *now.shape))
        rows = now.shape[0]
        early = self.span * (1.0 - np.arange(rows)[:, None] / max(rows - 1, 1))
        read, slant = _earlier(x, last), _earlier(d, last_d)
        read *= early
        read += x
        slant *= 0.5 * early * (1.0 - early)
        read += slant
        return Charge(read), dark, (x[-1].copy(), d[-1].copy())


def _earlier(now: Array, last: Array) -> Array:
    """(F, H, W) by how much more there was in the frame before; last: in that before the first."""
    more = np.empty(now.shape)
    np.subtract(last, now[0], out=more[0])
    np.subtract(now[:-1], now[1:], out=more[1:])
    return more
