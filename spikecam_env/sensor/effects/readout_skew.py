"""Read-out skew: rows are read one after the other, by the array's clock, the first or the last row first.

    s > 0, first row first: row r is read e = s (1 - r/(H - 1)) frames before the end of the frame its bit is counted in
    s < 0, last row first:                e = -s r/(H - 1)
    light of its frame: x_t <- x_t + e (x_(t-1) - x_t) + e (1 - e) / 2 (d_(t-1) - d_t);  e > 1: t - 1 for t, e - 1 for e
    the array's clock at u of a row's own frame (u: 0 .. 1): v = u - e

Stage: read-out.  Seen in: steps of light (a row's response comes up to |s| frames later), moving edges (a slant).
In static light it acts only through effects that follow the array's clock: the phase of supply_ripple and
clock_feedthrough then differs from row to row.
Within a frame: integrated over the frame, in light that is linear in it.
Source: sequential read-out of rows, as in a rolling shutter; a wall recording by a public camera has s near -1.1.  The
light x_t of a frame rises by d_t from its start to its end: exact where it is linear in a frame.  Before frame 0 it is
taken as steady; where another effect has changed it otherwise than by a factor, within a frame as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Charge, Effect, ExposureBlock, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.types import Floats, Masks


@dataclass(frozen=True)
class ReadoutSkew(Effect):
    span: float = parameter(
        0.9,
        unit="frames",
        bounds=(-1.25, 1.25),
        doc="time s that reading all rows takes; below 0: the last row is read first",
    )

    stage = Stage.READOUT
    acts = Acts.INTEGRATED
    strength = "span"
    wants_rise = True
    identification = Identification(
        family="readout",
        needs=Needs.MOTION,
        acts_through=("clock_feedthrough", "supply_ripple"),
        start_with={
            "clock_feedthrough": {
                "span": (0.25, 0.5, 1.0, -0.25, -0.5, -1.0),
                "phase_frames": (0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875),
                "tau_us": (8.0,),
            }
        },
        only_contrast=True,
    )

    def begin(self, first: ExposureBlock, pattern: np.random.Generator, rng: np.random.Generator) -> None:
        return None

    def lead(self, first: ExposureBlock) -> Floats:
        rows = first.shape[0]
        in_order = np.arange(rows)[:, None] / max(rows - 1, 1)
        return self.span * (1.0 - in_order) if self.span > 0.0 else -self.span * in_order

    def collect(
        self, light: Charge, dark: Charge, now: ExposureBlock, memory: tuple[Floats, Floats] | None
    ) -> tuple[Charge, Charge, tuple[Floats, Floats]]:
        x, d = light.values, light.rises
        last, last_d = memory or (np.repeat(x[:1], 2, axis=0), np.zeros((2, *now.shape)))
        if len(x) == 1 and not d.any() and not last_d.any() and np.all(last == x[0]):
            return light, dark, (last, last_d)
        x, d = (
            np.concatenate([before, np.broadcast_to(new, (now.frames, *now.shape))])
            for before, new in ((last, x), (last_d, d))
        )
        early = self.lead(now)
        over = early > 1.0
        early = early - over
        read, slant = _earlier(x, over), _earlier(d, over)
        read *= early
        read += np.where(over, x[1:-1], x[2:]) if over.any() else x[2:]
        slant *= 0.5 * early * (1.0 - early)
        read += slant
        return Charge(read), dark, (x[-2:].copy(), d[-2:].copy())


def _earlier(values: Floats, over: Masks) -> Floats:
    """(F, H, W) by how much more there was in the frame before, of F + 2; of rows `over` (H, 1): one before that."""
    last = values[1:-1] - values[2:]
    return np.where(over, values[:-2] - values[1:-1], last) if over.any() else last
