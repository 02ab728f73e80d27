"""Flat maps of a real camera, as SpikeNeRF has them: spikes of each pixel in three recordings of R = 4000 frames.

    D_light   D at 335 lux, where D = (R - n) / n for n spikes in R frames: empty frames between spikes
    Nd        dark level [lux]:  Nd = 153 D_153 / (D_dark - D_153),  D_dark = 1 / (n_dark / R + 1e-5) - 1

so that rates are n / R = 1 / (D + 1).  D is often taken for the mean interval, rate 1 / D.  Two facts contradict that:
R / (D + 1) is whole for all 100 000 pixels to 7e-5, float32's rounding, and SpikeNeRF's own code has D = 1 / rate - 1.
The maps come without the law of Nd; the second line follows from its values.  They are only 5479 different ones, each
made of two whole numbers, n_dark and n_153: to 1e-4 in all 100 000 pixels, where chance would give it to 0.3 %.  In 2
of 10 000 pixels another pair is as near.  In maps without such a pair, the dark level follows from D_light by their own
correction, D_dark = D_light (335 + Nd) / Nd, right to a few per cent.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError
from spikecam_env.types import Floats
from spikecam_env.untrusted import numbers, read_arrays

FRAMES = 4000
"""R of the module's equations."""

LUX = 335.0
DIM_LUX = 153.0

KEYS = frozenset({"D_light", "Nd"})

_NEVER = 1e-5
"""Added to the dark rate by the maps' authors, against division by zero."""

_SEARCH = 0.25
"""How far a dark count may be from that of the maps' correction, relative; two counts more for the darkest."""

_WHOLE = 1e-3

_MOST = 1e9
"""Of D_light and Nd, and of 1 / Nd [lux]: far beyond any map, far from where numbers overflow."""


@dataclass(frozen=True)
class FlatMaps:
    """(H, W) rates [spikes/frame] in FRAMES frames; dark current is in all."""

    lit: Floats
    """Rates at 335 lux."""
    dim: Floats
    """Rates at 153 lux, NaN where not `counted`."""
    dark: Floats
    """Rates in the dark, approximate where not `counted`."""
    counted: NDArray[np.bool_]
    """Whether n_dark and n_153 are whole."""


def read_flat_maps(path: Path) -> FlatMaps:
    """Read D_light and Nd (module's equations) from an npz.

    Raises:
        InputError: for a file that cannot be read, maps that differ in shape, values that no camera can have.
    """
    arrays = read_arrays(path, ("D_light", "Nd"))
    between, dark_lux = (numbers(array, name, str(path)).astype(np.float64) for name, array in arrays.items())
    if between.ndim != 2 or not between.size or between.shape != dark_lux.shape:
        raise InputError(f"{path}: D_light is {between.shape}, Nd {dark_lux.shape}; both must be (rows, columns)")
    if not (np.all((between >= 0) & (between <= _MOST)) and np.all((dark_lux >= 1 / _MOST) & (dark_lux <= _MOST))):
        raise InputError(f"{path}: D_light must be 0 or more and Nd above 0, at most {_MOST:g}; these are no flat maps")
    corrected = 1.0 / (between * (LUX + dark_lux) / dark_lux + 1.0)
    dark, dim, off = _whole_counts(dark_lux.ravel(), FRAMES * corrected.ravel())
    counted = (off < _WHOLE).reshape(between.shape)
    return FlatMaps(
        1.0 / (between + 1.0),
        np.where(counted, np.round(dim).reshape(between.shape) / FRAMES, np.nan),
        np.where(counted, dark.reshape(between.shape) / FRAMES, corrected),
        counted,
    )


def counted(rate: Floats, seed: int = 0) -> Floats:
    """Spikes in FRAMES frames of pixels of this rate and any phase, over FRAMES."""
    return np.floor(FRAMES * rate + np.random.default_rng(seed).random(rate.shape)) / FRAMES


def spread_counts(rate: Floats, seed: int = 1) -> Floats:
    """Counted rates spread evenly within a count, so that quantiles of small counts are no whole numbers."""
    return rate + (np.random.default_rng(seed).random(rate.shape) - 0.5) / FRAMES


def _whole_counts(dark_lux: Floats, about: Floats) -> tuple[Floats, Floats, Floats]:
    """n_dark near `about` (P,) that makes n_153 the most nearly whole, that n_153, and its distance from whole."""
    reach = np.ceil(_SEARCH * about) + 2
    dark, dim, off = about.copy(), np.zeros(about.size), np.full(about.size, np.inf)
    for step in range(-int(reach.max()), int(reach.max()) + 1):
        pixels = np.flatnonzero((np.abs(step) <= reach) & (np.round(about) + step >= 0))
        n_dark = np.round(about[pixels]) + step
        empty = 1.0 / (n_dark / FRAMES + _NEVER) - 1.0
        n_dim = FRAMES / (dark_lux[pixels] * empty / (DIM_LUX + dark_lux[pixels]) + 1.0)
        distance = np.abs(n_dim - np.round(n_dim))
        better = distance < off[pixels]
        at = pixels[better]
        dark[at], dim[at], off[at] = n_dark[better], n_dim[better], distance[better]
    return dark, dim, off
