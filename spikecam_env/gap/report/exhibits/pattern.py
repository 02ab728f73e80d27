"""The fixed pattern: maps, histograms, and profiles by row and column, beside those of fresh units of the models.

A twin has the measured unit's own pattern wherever its model has one: only a fresh unit shows the pattern to expect.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from spikecam_env.gap.report.panels import Array, Curves, PixelMaps, PlotPanel, shape_of
from spikecam_env.gap.result import Evidence

TITLE = "Fixed pattern"
CAPTION = (
    "Response and dark level of every pixel, from straight lines through its rates, beside a fresh unit of the model: "
    "single pixels differ, as those of two cameras do; spread, tails, shading and lines should not. Row and column "
    "profiles are means over the other direction."
)
_TITLES = {"gain": "Response", "dark": "Dark level"}
_UNITS = {"gain": "thresholds a frame at radiance 1", "dark": "thresholds a frame"}


def panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[PlotPanel]:
    """Dark level and response of pixels: how they are spread, and by row and column."""
    if np.ptp(evidence.free_refit.gain) == 0:  # unknown scenes: their light hides the pattern
        return
    for what in _TITLES:
        histogram = _histogram(what, _values(evidence, what))
        if histogram:
            yield histogram
    shape = shape_of(evidence)
    if shape is None:
        return
    for axis, name in ((1, "row"), (0, "column")):
        relative = [
            None if v is None else 100 * (v / max(v.mean(), 1e-12) - 1).reshape(shape)
            for v in _values(evidence, "gain")
        ]
        measured, before, after = relative
        assert measured is not None and before is not None
        sd = (measured - before).std(axis=axis) / np.sqrt(shape[axis])
        after_mean = None if after is None else after.mean(axis=axis)
        curves = Curves(measured.mean(axis=axis), before.mean(axis=axis), after_mean, sd)
        x = np.arange(sd.size, dtype=np.float64)
        yield PlotPanel(f"Response by {name}", f"{name} [pixels]", "off the mean [%]", x, *curves)


def maps(evidence: Evidence) -> Iterator[PixelMaps]:
    """Maps of dark level and response."""
    shape = shape_of(evidence) if np.ptp(evidence.free_refit.gain) > 0 else None
    for what, title in _TITLES.items() if shape else ():
        measured, before, after = (None if v is None else v.reshape(shape) for v in _values(evidence, what))
        assert measured is not None and before is not None
        yield PixelMaps(title, _UNITS[what], measured, before, after)


def _values(evidence: Evidence, what: str) -> list[Array | None]:
    """Measured, before, after (P,): of fresh units where there are any, else of the twins."""
    index = list(_TITLES).index(what)
    bases = (evidence.free_refit, evidence.before_base, evidence.after_base)
    drawn = (None, evidence.drawn_before, evidence.drawn_after)
    return [
        d[index] if d is not None else None if b is None else np.asarray(getattr(b, what))
        for d, b in zip(drawn, bases, strict=True)
    ]


def _histogram(what: str, values: Sequence[Array | None]) -> PlotPanel | None:
    """Pixels by value; dark levels on a logarithmic axis.  Bands: the root of the counts."""
    measured, before = values[0], values[1]
    assert measured is not None and before is not None
    log = what == "dark"
    known = np.concatenate([v[np.isfinite(v) & ((v > 0) | (not log))] for v in (measured, before)])
    if known.size < 20 or np.ptp(known) <= 0:
        return None
    if log:
        edges = np.geomspace(np.quantile(known, 0.01) / 1.5, known.max() * 1.05, 30)
    else:
        edges = np.linspace(known.min(), known.max(), 30)
    counts = [None if v is None else np.histogram(v, edges)[0].astype(np.float64) for v in values]
    assert counts[0] is not None and counts[1] is not None
    middle = np.sqrt(edges[1:] * edges[:-1]) if log else (edges[1:] + edges[:-1]) / 2
    title, xlabel = f"{_TITLES[what]} of pixels", f"{_TITLES[what].lower()} [{_UNITS[what]}]"
    return PlotPanel(title, xlabel, "pixels [count]", middle, counts[0], counts[1], counts[2],
                 np.sqrt(np.maximum(counts[0] + counts[1], 1)), log="x" if log else "")  # fmt: skip
