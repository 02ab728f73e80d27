"""Flat maps of a real camera, as SpikeNeRF has them, read as rates.

    D_light   spikes are this many empty frames apart, on average, at 335 lux:  D = (R - n) / n,  n spikes in R frames
    Nd        dark level [lux]: at Nd lux a pixel without dark current would fire as this one does in the dark

so that the rates are n / R = 1 / (D + 1), and in the dark 1 / (D (335 + Nd) / Nd + 1).

D is often taken for the mean interval, rate 1/D; two facts speak against it.  R / (D + 1) is a whole number at R = 4000
for all 100 000 pixels, to 7e-5, which is float32's rounding; and one pixel has D = 0.899, more than a spike a frame.
The dark level follows from D as the maps' own correction does, Nl D (335 + Nd) = const, with light as 1/D.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError

FRAMES = 4000
"""R of the module's equation."""

LUX = 335.0

KEYS = frozenset({"D_light", "Nd"})


def read_flat_maps(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(H, W) rates at 335 lux, dark current included, and in the dark [spikes/frame].

    Errors: InputError for maps that differ in shape or hold values that no camera can have.
    """
    with np.load(path) as arrays:
        between, dark_lux = (np.asarray(arrays[name], np.float64) for name in ("D_light", "Nd"))
    if between.ndim != 2 or between.shape != dark_lux.shape:
        raise InputError(f"{path}: D_light is {between.shape}, Nd {dark_lux.shape}; both must be (rows, columns)")
    if not (between.min() >= 0 and dark_lux.min() > 0 and np.isfinite(between + dark_lux).all()):
        raise InputError(f"{path}: D_light must be 0 or more and Nd above 0, all finite; these are no flat maps")
    return 1.0 / (between + 1.0), 1.0 / (between * (LUX + dark_lux) / dark_lux + 1.0)
