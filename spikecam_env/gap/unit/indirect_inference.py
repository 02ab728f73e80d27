"""The unit under an effect: moved so that with it the camera is refitted as it was measured.

Indirect inference: what an effect does to a refit, the unit of its twins has to undo, or it would borrow from the unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.unit.refit import BaseFit, within
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]

HIDDEN = 0.5
"""Share of a refit's s^2 that is the unit's own, below which it stays: beside so much noise of an effect, the refit of
twins does not tell it (`fit.joint` does, by all statistics)."""

STILL = 3e-4
"""Relative move of a unit's gain up to which its twins say what an effect does: where pixels saturate, statistics are
not those of a unit so much brighter, less what that adds."""

FURTHEST = 4.0
"""Times as far that a unit is shifted at once for a stronger effect: a straight line leads nowhere."""


def settled(model: SensorModel, used: BaseFit, wanted: BaseFit, simulated: Sequence[BaseFit]) -> BaseFit:
    """Indirect inference: shift the unit `used` so that its twins, refitted as `simulated`, are refitted as `wanted`.

    The shift of a pixel is a smooth function of its own response and dark level: pixel by pixel it would be tuned to
    the noise of these very twins.  Where an effect is so strong that most pixels of the twins fall silent, it stays.
    """
    live = wanted.live & (wanted.gain > 0) & np.all([s.gain > 0 for s in simulated], axis=0)
    if live.mean() < 0.5:
        return used
    ratio = np.log(wanted.gain[live] / np.mean([s.gain[live] for s in simulated], axis=0))
    gain = used.gain * np.exp(_surface(used, live, ratio))
    dark = used.dark + _surface(used, live, wanted.dark[live] - np.mean([s.dark[live] for s in simulated], axis=0))
    white = used.white + wanted.white - float(np.mean([s.white for s in simulated]))
    white = used.white if used.white < HIDDEN * wanted.white else max(white, 0.1 * used.white)
    return within(model, replace(used, gain=gain, dark=np.maximum(dark, 0.0), white=white))


def is_still(one: BaseFit, other: BaseFit) -> bool:
    """Whether a unit has moved so little, from one to the other, that twins of it say what an effect does."""
    return moved_by(one, other) <= STILL


def moved_by(one: BaseFit, other: BaseFit) -> float:
    """By how much pixels respond more in one of two units than in the other, relative; the median."""
    there = (one.gain > 0) & (other.gain > 0)
    return abs(float(np.median(np.log(other.gain[there] / one.gain[there])))) if there.any() else 0.0


def _surface(unit: BaseFit, known: NDArray[np.bool_], y: Array) -> Array:
    """(P,) least-squares polynomial of second order through y, of the pixels `known`, over their gain and dark level;
    outliers of y are cut."""
    y = np.clip(y, *np.quantile(y, [0.02, 0.98]))
    g, d = ((v - v[known].mean()) / max(float(v[known].std()), 1e-12) for v in (unit.gain, unit.dark))
    over = np.stack([np.ones_like(g), g, d, g * g, g * d, d * d], axis=1)
    return np.asarray(over @ np.linalg.lstsq(over[known], y)[0], np.float64)


def shifted(bare: BaseFit, settled: BaseFit, factor: float) -> BaseFit:
    """The unit for an effect `factor` times as strong as the one under which `bare` became `settled`; no further than
    FURTHEST times as far, for it will settle anew.  A pixel whose light tells nothing keeps its gain."""
    factor = min(factor, FURTHEST)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where((bare.gain > 0) & (settled.gain > 0), settled.gain / bare.gain, 1.0)
    dark = np.maximum(bare.dark + factor * (settled.dark - bare.dark), 0.0)
    white = bare.white * (settled.white / bare.white) ** factor if bare.white > 0 else settled.white
    return replace(settled, gain=bare.gain * ratio**factor, dark=dark, white=white)
