"""Evidence as curves: pure functions from observations to plots of the report.

An exhibit is one way to look at recordings (rates, noise, spectrum ...), with a few panels: a measured curve, one twin
of the model before and one after, and `sd`, the standard error of measured less before.  It comes from the scatter of
that difference over pixels or columns, which the fixed pattern, the same on both sides, drops out of.

Shares of intervals and coincidences have no such scatter, and regular spikes are far less random than independent
ones: their sd is that of independent spikes, scaled by the difference of two twins of one model, if there are two.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import ObservedRecording
from spikecam_env.gap.result import Evidence

Array = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class PlotPanel:
    """One plot: curves of N points."""

    title: str
    xlabel: str
    """With the unit in brackets, [1] of pure numbers."""
    ylabel: str
    """As `xlabel`."""
    x: Array
    measured: Array
    before: Array
    after: Array | None
    sd: Array
    """Standard error of measured less before."""
    log: str = ""
    """Axes that are logarithmic: "", "x", "y", "xy"."""
    labels: tuple[str, ...] = ()
    """Names of the points instead of numbers on the x axis, which then has no label."""

    @property
    def z(self) -> float:
        """Largest |measured - before| in standard errors, of logarithms where y is; 0 where there is none."""
        with np.errstate(divide="ignore", invalid="ignore"):
            if "y" in self.log:
                z = np.abs(np.log(self.measured / self.before)) * self.before / self.sd
            else:
                z = np.abs(self.measured - self.before) / self.sd
        return float(np.max(z[np.isfinite(z)], initial=0.0))


@dataclass(frozen=True)
class PixelMaps:
    """One picture (H, W) of every pixel, measured and simulated, in one unit."""

    title: str
    unit: str
    measured: Array
    before: Array
    after: Array | None


class ReportedRecording(NamedTuple):
    """One recording: conditions, spikes as measured, of twins before and after, and of another twin before."""

    shown: Condition
    measured: ObservedRecording
    before: ObservedRecording
    after: ObservedRecording | None
    again: ObservedRecording | None


def shape_of(evidence: Evidence) -> tuple[int, int] | None:
    """(rows, columns) of the camera: of its spikes, or of the light that it was shown."""
    seen = [o.shape for o in evidence.measured if o is not None]
    shown = [c.light.radiance.shape[1:] for c in evidence.conditions if c.light is not None]
    rows, columns = (*seen, *shown, (0, 0))[0]
    return (rows, columns) if rows else None


def takes(evidence: Evidence, kinds: Sequence[str]) -> list[ReportedRecording]:
    """Recordings of spikes in these kinds of light, in order."""
    nothing = (None,) * len(evidence.conditions)
    after, again = evidence.after or nothing, evidence.again or nothing
    rows = zip(evidence.conditions, evidence.measured, evidence.before, after, again, strict=True)
    return [
        ReportedRecording(*row) for row in rows if row[0].kind in kinds and row[1] is not None and row[2] is not None
    ]


class Curves(NamedTuple):
    """Values at N points (N,): measured, before, after, and the standard error of measured less before."""

    measured: Array
    before: Array
    after: Array | None
    sd: Array

    def less_model(self, scale: Array | float) -> Curves:
        """The same less the model before, times `scale`."""
        after = None if self.after is None else scale * (self.after - self.before)
        return Curves(scale * (self.measured - self.before), np.zeros(len(self.before)), after, scale * self.sd)


def over_pixels(take: ReportedRecording, of: Callable[[ObservedRecording], Array]) -> Curves:
    """Means over the last axis of a quantity of each recording."""
    measured, before = of(take.measured), of(take.before)
    known = np.isfinite(measured) & np.isfinite(before)
    after = of(take.after) if take.after else None
    return Curves(
        mean_known(measured, known),
        mean_known(before, known),
        None if after is None else mean_known(after, np.isfinite(after)),
        error_known(measured - before, known),
    )


def mean_known(values: Array, known: NDArray[np.bool_]) -> Array:
    """Mean of known values over the last axis; 0 where none is known."""
    mean: Array = np.where(known, values, 0.0).sum(axis=-1) / np.maximum(known.sum(axis=-1), 1)
    return mean


def error_known(values: Array, known: NDArray[np.bool_]) -> Array:
    """Standard error of `mean_known`."""
    off = np.where(known, values - mean_known(values, known)[..., None], 0.0)
    count = np.maximum(known.sum(axis=-1), 1)
    error: Array = np.sqrt((off**2).sum(axis=-1)) / count
    return error


def largest(panels: Sequence[PlotPanel], number: int) -> list[PlotPanel]:
    """The panels where measured and before differ most, in the order given."""
    kept = sorted(panels, key=lambda p: -p.z)[:number]
    return [p for p in panels if p in kept]


def scaled_by_twins(sd: Array, difference: Array | None) -> Array:
    """Standard errors, scaled by the root mean square over them of two twins' difference.

    Few points determine that scale poorly: its upper 90 % limit is taken.
    """
    if difference is None:
        return sd
    known = (sd > 0) & np.isfinite(difference)
    if known.sum() < 3:
        return sd
    square = float(np.sum((difference[known] / sd[known]) ** 2))
    scaled: Array = sd * np.sqrt(square / scipy.stats.chi2.ppf(0.1, int(known.sum()) - 1))
    return scaled


def by_recording(recordings: Sequence[ReportedRecording], of: Callable[[ObservedRecording], Array]) -> Curves:
    """A quantity of each recording, its mean over pixels."""
    measured, before, after, sd = zip(*(over_pixels(t, of) for t in recordings), strict=True)
    known = None if any(a is None for a in after) else np.array(after, dtype=np.float64)
    return Curves(np.array(measured, np.float64), np.array(before, np.float64), known, np.array(sd, np.float64))


def panel_by_recording(title: str, ylabel: str, recordings: Sequence[ReportedRecording], curves: Curves) -> PlotPanel:
    """A plot with a point a recording."""
    names = tuple(t.shown.name for t in recordings)
    return PlotPanel(title, "", ylabel, np.arange(len(names), dtype=np.float64), *curves, labels=names)
