"""The unit under an effect, by indirect inference: the unit is adjusted until its twins refit to the measured refit.

An effect biases the refit.  Without the adjustment the fitted unit would already contain part of the effect.

Source: Gourieroux, Monfort and Renault, "Indirect inference", 1993.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats

IDENTIFIABLE = 0.5
"""Share of the refit's s^2 that is the unit's own, below which s^2 stays: beside so much noise of an effect the refits
of twins do not identify it (`fit.joint` does, by all statistics)."""

CONVERGED = 3e-4
"""Largest change of a unit's median gain, relative, up to which it is not simulated again: a thirtieth of the
rate that four kicks of 0.0025 add, the crosstalk of `tests/gap/fit/test_candidate.py`.  A unit so much brighter has
other statistics where pixels saturate."""


def inferred_unit(model: SensorModel, used: BaseFit, wanted: BaseFit, simulated: Sequence[BaseFit]) -> BaseFit:
    """A step of indirect inference: the unit shifted by the measured refit less its twins' refits.

    The shift of a pixel is a smooth function of its own response and dark level: pixel by pixel it would be fitted to
    the noise of these very twins.  Where most pixels of the twins are silent under a strong effect, the unit stays.

    Args:
        model: constrains the result.
        used: the unit of the twins.
        wanted: the measured refit.
        simulated: the twins' refits.
    """
    live = wanted.live & (wanted.gain > 0) & np.all([s.gain > 0 for s in simulated], axis=0)
    if live.mean() < 0.5:
        return used
    ratio = np.log(wanted.gain[live] / np.mean([s.gain[live] for s in simulated], axis=0))
    gain = used.gain * np.exp(_surface(used, live, ratio))
    dark = used.dark + _surface(used, live, wanted.dark[live] - np.mean([s.dark[live] for s in simulated], axis=0))
    white = used.white + wanted.white - float(np.mean([s.white for s in simulated]))
    white = used.white if used.white < IDENTIFIABLE * wanted.white else max(white, 0.1 * used.white)
    return constrained_refit(model, replace(used, gain=gain, dark=np.maximum(dark, 0.0), white=white))


def has_converged(one: BaseFit, other: BaseFit) -> bool:
    """Whether the change between two units is so small that twins of one serve for the other (`CONVERGED`)."""
    return gain_change(one, other) <= CONVERGED


def gain_change(one: BaseFit, other: BaseFit) -> float:
    """Relative change of the gain between two units, at least 0: the median over pixels that respond in both."""
    both = (one.gain > 0) & (other.gain > 0)
    return abs(float(np.median(np.log(other.gain[both] / one.gain[both])))) if both.any() else 0.0


def _surface(unit: BaseFit, known: NDArray[np.bool_], y: Floats) -> Floats:
    """(P,) least-squares polynomial of second order through y, of the pixels `known`, over their gain and dark level.

    Outliers of y are cut.  Other pixels get the value at the nearest gain and dark level of those known: the polynomial
    says nothing beyond.
    """
    y = np.clip(y, *np.quantile(y, [0.02, 0.98]))
    ranges = ((v, v[known]) for v in (unit.gain, unit.dark))
    g, d = ((np.clip(v, k.min(), k.max()) - k.mean()) / max(float(k.std()), 1e-12) for v, k in ranges)
    over = np.stack([np.ones_like(g), g, d, g * g, g * d, d * d], axis=1)
    return np.asarray(over @ np.linalg.lstsq(over[known], y)[0], np.float64)


def extrapolated_unit(bare: BaseFit, inferred: BaseFit, factor: float, most: float) -> BaseFit:
    """The unit for an effect `factor` times as strong as the one under which `bare` became `inferred`; `most` times as
    far at most, for it is inferred anew.  A pixel without gain in one of them keeps its own."""
    factor = min(factor, most)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where((bare.gain > 0) & (inferred.gain > 0), inferred.gain / bare.gain, 1.0)
    dark = np.maximum(bare.dark + factor * (inferred.dark - bare.dark), 0.0)
    white = bare.white * (inferred.white / bare.white) ** factor if bare.white > 0 else inferred.white
    return replace(inferred, gain=bare.gain * ratio**factor, dark=dark, white=white)
