"""Temporal noise: from second differences of spike times, and from intervals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from spikecam_env.calibration.jitter import Jitter, fit_jitter
from spikecam_env.gap.observe.conditions import STEADY
from spikecam_env.gap.observe.observation import DIFFERENCES, ObservedRecording
from spikecam_env.gap.report.panels import (
    Array,
    PlotPanel,
    ReportedRecording,
    by_recording,
    mean_known,
    panel_by_recording,
    takes,
)
from spikecam_env.gap.result import Evidence

TITLE = "Temporal noise"
CAPTION = (
    "Noise of single spikes, from second differences A_k of spike times k apart. If A_k is level over k, the noise is "
    "independent from spike to spike; if it rises, the noise is slow. Below: the variance of intervals, and the "
    "correlation of successive ones."
)


def panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[PlotPanel]:
    """Temporal noise of spikes: from A_k over steps and over levels, interval variance and lag-1 by recording."""
    static = takes(evidence, STEADY)
    steps = _noise_by_step(static)
    if steps:
        yield steps
    lit = [t for t in static if t.shown.level > 0 and t.shown.light is not None]
    levels = _noise_by_level(sorted(lit, key=lambda t: t.shown.level), evidence.light)
    if levels:
        yield levels
    enough = [t for t in static if np.isfinite(t.measured.variance - t.before.variance).sum() > 1]
    if enough:
        variance = by_recording(enough, lambda o: o.variance)
        off = variance.less_model(100 / variance.before)
        yield panel_by_recording("Variance of intervals", "variance over the model's, less 1 [%]", enough, off)
        correlation = by_recording(enough, lag_one)
        yield panel_by_recording("Correlation of successive intervals", "lag-1 correlation [1]", enough, correlation)


def lag_one(o: ObservedRecording) -> Array:
    """(P,) covariance of successive intervals over the mean variance; NaN where pixels have too few spikes."""
    return np.asarray(o.covariance / mean_known(o.variance, np.isfinite(o.variance)))


def _noise_by_step(static: Sequence[ReportedRecording]) -> PlotPanel | None:
    """(A_k less the noise of reading in frames) / 2 k T^2 over k, pooled over pixels and recordings."""
    fits = [_jitter([getattr(t, side) for t in static]) for side in ("measured", "before", "after")]
    measured, before, after = fits
    if measured is None or before is None or not np.array_equal(measured.steps, before.steps):
        return None
    return PlotPanel(
        "Noise of a spike from A_k, by k", "k [spikes]", "noise² [1e-5 threshold²]", measured.steps.astype(np.float64),
        1e5 * measured.by_step, 1e5 * before.by_step, 1e5 * after.by_step if after else None,
        1e5 * np.hypot(measured.by_step_sd, before.by_step_sd), log="x",
    )  # fmt: skip


def _noise_by_level(lit: Sequence[ReportedRecording], light: str) -> PlotPanel | None:
    """s^2 of each recording by itself."""
    fits = [[_jitter([getattr(t, side)]) for side in ("measured", "before", "after")] for t in lit]
    whole = [(t, f) for t, f in zip(lit, fits, strict=True) if f[0] and f[1] and (f[2] or t.after is None)]
    if len(whole) < 2:
        return None
    white = np.array([[1e5 * j.white if j else np.nan for j in f] for _, f in whole])
    sd = np.array([1e5 * np.hypot(f[0].white_sd, f[1].white_sd) for _, f in whole])  # type: ignore[union-attr]
    after = None if any(t.after is None for t, _ in whole) else white[:, 2]
    return PlotPanel("Noise of a spike, by level", light, "noise² [1e-5 threshold²]",
                 np.array([t.shown.level for t, _ in whole]), white[:, 0], white[:, 1], after, sd, log="x")  # fmt: skip


def _jitter(observations: Sequence[ObservedRecording | None]) -> Jitter | None:
    """The fit of A_k to static recordings; None where there are too few spikes, or no recordings."""
    known = [o for o in observations if o is not None]
    if not known or len(known) < len(observations):
        return None
    rate = np.stack([np.where(o.times.count / o.frames > 0.9, np.nan, o.times.rate) for o in known])
    square = np.stack([o.times.square for o in known])
    return fit_jitter(np.array(DIFFERENCES), square, np.stack([o.times.terms for o in known]).astype(np.float64), rate)
