"""Spikes against the read-out's clock: pixels by how far their mean interval is from a whole number of frames."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from spikecam_env.calibration.spike_times import ideal_second_difference
from spikecam_env.gap.observe.observation import ObservedRecording
from spikecam_env.gap.report.panels import PlotPanel, takes
from spikecam_env.gap.result import Evidence
from spikecam_env.types import Floats

TITLE = "Spikes against the clock"
CAPTION = (
    "Pixels of a scene by how far their mean interval is from a whole number of frames. A pixel that integrates freely "
    "does not depend on frames: counts run evenly through 0, and noise is the same on both sides of it."
)


_COUNTED = np.linspace(-0.05, 0.05, 21)
_NOISY = np.array([-0.5, -0.3, -0.15, -0.08, -0.04, -0.02, 0.0, 0.02, 0.04, 0.08, 0.15, 0.3, 0.5])


def panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[PlotPanel]:
    """Pixels near a whole interval, and noise of successive spikes on either side of it, of unknown scenes."""
    for t in takes(evidence, ("unknown",)):
        sides = [None if o is None else _counts(o) for o in (t.measured, t.before, t.after)]
        measured, before, after = sides
        assert measured is not None and before is not None
        yield PlotPanel(
            f"Pixels by interval, {t.shown.name}", "mean interval less a whole number [frames]", "pixels [count]",
            (_COUNTED[1:] + _COUNTED[:-1]) / 2, measured, before, after, np.sqrt(np.maximum(measured + before, 1.0)),
        )  # fmt: skip
        parts = [None if o is None else _excess(o) for o in (t.measured, t.before, t.after)]
        seen, model, patched = parts
        assert seen is not None and model is not None
        known = np.isfinite(seen[0]) & np.isfinite(model[0])
        if known.sum() > 3:
            yield PlotPanel(
                f"Noise beyond an ideal pixel's, {t.shown.name}", "mean interval less a whole number [frames]",
                "excess of A_1 / 2 [1e-3 frames²]", ((_NOISY[1:] + _NOISY[:-1]) / 2)[known], seen[0][known],
                model[0][known], None if patched is None else patched[0][known],
                np.hypot(seen[1], model[1])[known],
            )  # fmt: skip


def _off(o: ObservedRecording) -> tuple[NDArray[np.bool_], Floats]:
    """(P,) which pixels count, and how far their interval is from whole."""
    good = (o.times.count > 8) & (o.times.rate < 0.8)
    interval = 1.0 / np.where(good, o.times.rate, 1.0)
    return good, interval - np.round(interval)


def _counts(o: ObservedRecording) -> Floats:
    good, off = _off(o)
    return np.histogram(off[good], _COUNTED)[0].astype(np.float64)


def _excess(o: ObservedRecording) -> tuple[Floats, Floats]:
    """Mean over pixels of a bin, and its standard error."""
    good, off = _off(o)
    terms = np.where(good, o.times.terms[:, 0], 0)
    ideal = ideal_second_difference(np.array(1), 1.0 / np.where(good, o.times.rate, 1.0))
    bins = np.clip(np.searchsorted(_NOISY, off, "right") - 1, 0, _NOISY.size - 2)
    above = np.where(good, o.times.square[:, 0] - terms * ideal, 0.0)
    total = np.bincount(bins, terms, _NOISY.size - 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.bincount(bins, above, _NOISY.size - 1) / total
        sd = np.sqrt(np.bincount(bins, (above - mean[bins] * terms) ** 2, _NOISY.size - 1)) / total
    return 500 * mean, 500 * sd
