"""Evidence as curves: pure functions from what was observed to what the report draws.

An exhibit is one way to look at recordings (rates, noise, spectrum ...), with a few panels: a measured curve, one twin
of the model before and one after, and `sd`, the standard error of measured less before.  It comes from the scatter of
that difference over pixels or columns, which the fixed pattern, the same on both sides, drops out of.

Shares of intervals and coincidences have no such scatter, and regular spikes are far less random than independent
ones: their sd is that of independent spikes, scaled by what two twins of one model differ by, where there are two.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from spikecam_env.calibration.jitter import fit_jitter
from spikecam_env.gap.observe import BIN, STEPS, Observation
from spikecam_env.gap.result import Evidence, Statistic
from spikecam_env.gap.world import STATIC, Shown
from spikecam_env.sensor import Keyframes

Array = NDArray[np.floating[Any]]

LOUD = 4.0
"""|z| from which an exhibit is shown among the evidence."""

_SEGMENT = 1024
_EDGE_BIN, _EDGE_BEFORE, _EDGE_AFTER = 8, 64, 320


@dataclass(frozen=True)
class Panel:
    """One plot.  x, measured, before, sd (N,); after (N,) or None.  log: axes that are logarithmic, "", "x", "y", "xy".

    labels: names on the x axis instead of numbers.  line: whether neighbours on x are joined.
    """

    title: str
    xlabel: str
    ylabel: str
    x: Array
    measured: Array
    before: Array
    after: Array | None
    sd: Array
    log: str = ""
    labels: tuple[str, ...] = ()
    line: bool = True

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
class Maps:
    """One picture (H, W) of every pixel, measured and simulated."""

    title: str
    measured: Array
    before: Array
    after: Array | None


@dataclass(frozen=True)
class Exhibit:
    """One way to look.  words: what groups of statistics that belong to it have in their name."""

    name: str
    title: str
    caption: str
    words: tuple[str, ...]
    panels: tuple[Panel, ...]
    maps: tuple[Maps, ...] = ()

    def z(self, statistics: Sequence[Statistic]) -> float:
        """Largest |z| of its statistics; of its own panels where the bank has none of this kind."""
        own = [abs(s.z) for s in statistics if belongs(s, self.words)]
        return max(own) if own else max((p.z for p in self.panels), default=0.0)


class Take(NamedTuple):
    """One recording: its conditions, and what was observed."""

    shown: Shown
    measured: Observation
    before: Observation
    after: Observation | None
    again: Observation | None


def exhibits(evidence: Evidence, frame_rate_hz: float) -> list[Exhibit]:
    """All that these recordings can show; those without a panel are left out."""
    made = [
        Exhibit(name, title, caption, words, tuple(panels(evidence, frame_rate_hz)), tuple(maps(evidence)))
        for name, title, caption, words, panels, maps in _EXHIBITS
    ]
    return [e for e in made if e.panels or e.maps]


def by_loudness(made: Sequence[Exhibit], statistics: Sequence[Statistic]) -> tuple[list[Exhibit], list[Exhibit]]:
    """Exhibits where measured and before differ, loudest first, and the others."""
    order = sorted(made, key=lambda e: -e.z(statistics))
    return [e for e in order if e.z(statistics) >= LOUD], [e for e in order if e.z(statistics) < LOUD]


def belongs(statistic: Statistic, words: Sequence[str]) -> bool:
    """Whether a statistic is of an exhibit: by its group."""
    return any(word in statistic.group.lower() for word in words)


def takes(evidence: Evidence, kinds: Sequence[str]) -> list[Take]:
    """Recordings of spikes in these kinds of light, in order."""
    nothing = (None,) * len(evidence.conditions)
    after, again = evidence.after or nothing, evidence.again or nothing
    rows = zip(evidence.conditions, evidence.measured, evidence.before, after, again, strict=True)
    return [Take(*row) for row in rows if row[0].kind in kinds and row[1] is not None and row[2] is not None]


def over_pixels(take: Take, of: Callable[[Observation], Array]) -> tuple[Array, Array, Array | None, Array]:
    """Means over the last axis: measured, before, after, and the standard error of measured less before."""
    measured, before = of(take.measured), of(take.before)
    known = np.isfinite(measured) & np.isfinite(before)
    after = of(take.after) if take.after else None
    return (
        _mean(measured, known),
        _mean(before, known),
        None if after is None else _mean(after, np.isfinite(after)),
        _error(measured - before, known),
    )


def _mean(values: Array, known: NDArray[np.bool_]) -> Array:
    """Mean over the last axis of what is known; 0 where nothing is."""
    return np.where(known, values, 0.0).sum(axis=-1) / np.maximum(known.sum(axis=-1), 1)


def _error(values: Array, known: NDArray[np.bool_]) -> Array:
    """Standard error of that mean."""
    off = np.where(known, values - _mean(values, known)[..., None], 0.0)
    count = np.maximum(known.sum(axis=-1), 1)
    return np.sqrt((off**2).sum(axis=-1)) / count


def loudest(panels: Sequence[Panel], number: int) -> list[Panel]:
    """The panels where measured and before differ most, in the order given."""
    kept = sorted(panels, key=lambda p: -p.z)[:number]
    return [p for p in panels if p in kept]


def scaled(sd: Array, difference: Array | None) -> Array:
    """Standard errors times a factor such that the difference of two twins of one model has a root mean square of 1."""
    if difference is None:
        return sd
    known = (sd > 0) & np.isfinite(difference)
    if known.sum() < 3:
        return sd
    return sd * float(np.sqrt(np.mean((difference[known] / sd[known]) ** 2)))


# --- rates


def rate_panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[Panel]:
    """How far rates are off the line of each pixel, and off the model's."""
    static = [c for c in evidence.conditions if c.kind in ("dark", "flat", "picture")]
    lit = np.array([c.level > 0 for c in static])
    bases = (evidence.measured_base, evidence.before_base, evidence.after_base)
    if lit.sum() > 1 and all(b is None or len(b.residual) == len(static) for b in bases):
        level = np.array([c.level for c in static])[lit]
        order = np.argsort(level)
        measured, before, after = (
            None if b is None else 100 * np.where(b.live, b.residual, np.nan)[lit][order] for b in bases
        )
        assert measured is not None and before is not None
        known = np.isfinite(measured - before)
        usable = known.sum(axis=1) > 1
        yield Panel(
            "Rate off each pixel's line", "radiance (label)", "rate off the line [%]", level[order][usable],
            _mean(measured, known)[usable], _mean(before, known)[usable],
            None if after is None else _mean(after, np.isfinite(after))[usable],
            _error(measured - before, known)[usable], log="x",
        )  # fmt: skip
    found = takes(evidence, (*STATIC, "step", "moving"))
    found = [t for t in found if t.before.rate.mean() > 0]
    if found:
        measured, before, after, sd = _by_recording(found, lambda o: o.rate)
        scale = 100 / before
        yield _against_before("Rate of the array, recording by recording", "rate over the model's, less 1 [%]", found,
                              measured, before, after, sd, scale)  # fmt: skip


def _by_recording(
    found: Sequence[Take], of: Callable[[Observation], Array]
) -> tuple[Array, Array, Array | None, Array]:
    rows = [over_pixels(t, of) for t in found]
    after = [r[2] for r in rows]
    return (
        np.array([r[0] for r in rows], dtype=np.float64),
        np.array([r[1] for r in rows], dtype=np.float64),
        None if any(a is None for a in after) else np.array(after, dtype=np.float64),
        np.array([r[3] for r in rows], dtype=np.float64),
    )


def _against_before(
    title: str, ylabel: str, found: Sequence[Take], measured: Array, before: Array, after: Array | None, sd: Array,
    scale: Array,
) -> Panel:  # fmt: skip
    """A quantity of each recording less the model's, times `scale`."""
    return Panel(
        title, "", ylabel, np.arange(len(found), dtype=np.float64), scale * (measured - before), np.zeros(len(found)),
        None if after is None else scale * (after - before), scale * sd, labels=_names(found), line=False,
    )  # fmt: skip


def _names(found: Sequence[Take]) -> tuple[str, ...]:
    return tuple(t.shown.name for t in found)


# --- noise


def noise_panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[Panel]:
    """Temporal noise of spikes: from A_k over steps and over levels, interval variance and lag-1 by recording."""
    static = takes(evidence, STATIC)
    steps = _noise_by_step(static)
    if steps:
        yield steps
    lit = [t for t in static if t.shown.level > 0]
    levels = _noise_by_level(sorted(lit, key=lambda t: t.shown.level))
    if levels:
        yield levels
    enough = [t for t in static if np.isfinite(t.measured.variance - t.before.variance).sum() > 1]
    if enough:
        measured, before, after, sd = _by_recording(enough, lambda o: o.variance)
        yield _against_before("Variance of intervals", "variance over the model's, less 1 [%]", enough, measured,
                              before, after, sd, 100 / before)  # fmt: skip
        measured, before, after, sd = _by_recording(enough, lambda o: o.covariance / np.nanmean(o.variance))
        yield Panel(
            "Correlation of successive intervals", "", "lag-1 correlation", np.arange(len(enough), dtype=np.float64),
            measured, before, after, sd, labels=_names(enough), line=False,
        )  # fmt: skip


def _noise_by_step(static: Sequence[Take]) -> Panel | None:
    """(A_k less what reading in frames adds) / 2 k T^2 over k, pooled over pixels and recordings."""
    fits = [_jitter([getattr(t, side) for t in static]) for side in ("measured", "before", "after")]
    measured, before, after = fits
    if measured is None or before is None or not np.array_equal(measured.steps, before.steps):
        return None
    return Panel(
        "Noise of a spike from A_k, by k", "k [spikes]", "noise², 1e-5 threshold²", measured.steps.astype(np.float64),
        1e5 * measured.by_step, 1e5 * before.by_step, 1e5 * after.by_step if after else None,
        1e5 * np.hypot(measured.by_step_sd, before.by_step_sd), log="x",
    )  # fmt: skip


def _noise_by_level(lit: Sequence[Take]) -> Panel | None:
    """s^2 of each recording by itself."""
    fits = [[_jitter([getattr(t, side)]) for side in ("measured", "before", "after")] for t in lit]
    whole = [(t, f) for t, f in zip(lit, fits, strict=True) if f[0] and f[1] and (f[2] or t.after is None)]
    if len(whole) < 2:
        return None
    white = np.array([[1e5 * j.white if j else np.nan for j in f] for _, f in whole])
    sd = np.array([1e5 * np.hypot(f[0].white_sd, f[1].white_sd) for _, f in whole])  # type: ignore[union-attr]
    after = None if any(t.after is None for t, _ in whole) else white[:, 2]
    return Panel("Noise of a spike, by level", "radiance (label)", "noise², 1e-5 threshold²",
                 np.array([t.shown.level for t, _ in whole]), white[:, 0], white[:, 1], after, sd, log="x")  # fmt: skip


def _jitter(observations: Sequence[Observation | None]):  # type: ignore[no-untyped-def]
    """The fit of A_k to static recordings; None where there are too few spikes, or no recordings."""
    known = [o for o in observations if o is not None]
    if not known or len(known) < len(observations):
        return None
    rate = np.stack([np.where(o.times.count / o.frames > 0.9, np.nan, o.times.rate) for o in known])
    square = np.stack([o.times.square for o in known])
    return fit_jitter(np.array(STEPS), square, np.stack([o.times.terms for o in known]).astype(np.float64), rate)


# --- time


def spectrum_panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[Panel]:
    """Power of the population's spike count over frequency: of the lit recording furthest off, and of the dark one."""
    for kind in (("flat", "picture", "unknown"), ("dark",)):
        panels = []
        for t in takes(evidence, kind):
            if t.measured.frame.sum() < 100 or len(t.measured.frame) < 128:
                continue
            frequency, measured, count = spectrum(t.measured.frame, frame_rate_hz)
            before = spectrum(t.before.frame, frame_rate_hz)[1]
            after = spectrum(t.after.frame, frame_rate_hz)[1] if t.after else None
            sd = before * np.sqrt(2 / count)
            sd = np.maximum(sd, before * _local_scatter(measured / before))
            panels.append(Panel(f"Power spectrum, {t.shown.name}", "frequency [Hz]", "power over white noise's",
                                frequency, measured, before, after, sd, log="xy"))  # fmt: skip
        yield from loudest(panels, 1)


def _local_scatter(ratio: Array) -> Array:
    """Scatter of log(ratio) between adjacent frequencies.

    Pixels that keep their beat make periodogram values depend on one another, more at some frequencies than at others;
    their scatter shows it, and sees neither a few lines nor a broad rise.
    """
    jumps = np.abs(np.diff(np.log(ratio)))
    local = ndimage.median_filter(jumps, 21, mode="nearest") * 1.4826 / np.sqrt(2)
    return np.append(local, local[-1])


def spectrum(counts: NDArray[np.int32], frame_rate_hz: float) -> tuple[Array, Array, Array]:
    """Frequency [Hz], power over that of Poisson spikes of the same mean, and how many values each mean is over.

    Half-overlapping Hann windows; frequencies are pooled to 24 an octave and three at least.
    """
    length = min(_SEGMENT, len(counts) // 4 // 2 * 2)
    first = np.arange(0, len(counts) - length + 1, length // 2)
    window = np.hanning(length)
    parts = np.stack([counts[i : i + length] for i in first]).astype(np.float64)
    power = np.abs(np.fft.rfft((parts - parts.mean()) * window, axis=1)) ** 2 / (window**2).sum() / parts.mean()
    frequency = np.fft.rfftfreq(length, 1 / frame_rate_hz)
    band = np.round(24 * np.log2(np.maximum(np.arange(frequency.size), 1))).astype(int)
    _, inverse = np.unique(band[1:], return_inverse=True)
    size = np.bincount(inverse).astype(np.float64)
    mean = np.bincount(inverse, power.mean(axis=0)[1:]) / size
    return np.bincount(inverse, frequency[1:]) / size, mean, size * max(1.0, 0.55 * len(first))


def drift_panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[Panel]:
    """The rate of the array in sixteen parts of a recording."""
    panels = []
    for t in takes(evidence, STATIC):
        if t.before.blocks.sum() < 100:
            continue
        measured, before, after, sd = over_pixels(t, lambda o: o.blocks / max(o.blocks.mean(), 1e-9))
        x = (np.arange(len(measured)) + 0.5) * (t.measured.frames / len(measured)) * 1e3 / frame_rate_hz
        panels.append(Panel(f"Rate through {t.shown.name}", "time [ms]", "rate over its mean, less 1 [%]", x,
                            100 * (measured - before), np.zeros(x.size),
                            None if after is None else 100 * (after - before), 100 * sd))  # fmt: skip
    yield from loudest(panels, 2)


# --- edges and motion


def step_panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[Panel]:
    """The array's rate around rises and falls of uniform light, and what it lacks of the model's."""
    for t in takes(evidence, ("step",)):
        assert t.shown.light is not None
        edges = edges_of(t.shown.light, t.measured.frames)
        for name, sign in (("rise", 1), ("fall", -1)):
            mine = [e for e, s in edges if s == sign]
            if not mine:
                continue
            x, measured = around(t.measured, mine)
            before = around(t.before, mine)[1]
            after = around(t.after, mine)[1].mean(axis=1) if t.after else None
            ms = x * 1e3 / frame_rate_hz
            sd = (measured - before).std(axis=1) / np.sqrt(measured.shape[1])
            rates = Panel(f"Rate around a {name} ({t.shown.name})", f"time from the {name} [ms]", "spikes a frame", ms,
                          measured.mean(axis=1), before.mean(axis=1), after, sd)  # fmt: skip
            height = abs(rates.before[x > 0].mean() - rates.before[x < 0].mean())
            scale = 100 / max(height, 1e-9)
            yield rates
            yield Panel(
                f"What is left after a {name} ({t.shown.name})", f"time from the {name} [ms]",
                "less the model's [% of step]", ms, scale * (rates.measured - rates.before), np.zeros(x.size),
                None if after is None else scale * (after - rates.before), scale * sd,
            )  # fmt: skip


def edges_of(light: Keyframes, frames: int) -> list[tuple[int, int]]:
    """Frames at which uniform light jumps by a third of its range or more within two frames, and the jumps' signs."""
    level = np.interp(np.arange(frames) + 0.5, light.frame, light.radiance.mean(axis=(1, 2)))
    jump = level[2:] - level[:-2]
    large = np.flatnonzero(np.abs(jump) > max(np.ptp(level) / 3, 1e-12))
    groups = np.split(large, np.flatnonzero(np.diff(large) > _EDGE_BIN) + 1) if large.size else []
    peaks = [int(g[np.argmax(np.abs(jump[g]))]) for g in groups]
    return [(f + 1, int(np.sign(jump[f]))) for f in peaks]


def around(observation: Observation, edges: Sequence[int]) -> tuple[Array, Array]:
    """Middles of bins from an edge on [frames] and, mean over edges, spikes a frame of a pixel (bins, W columns)."""
    bins = np.arange(-_EDGE_BEFORE, _EDGE_AFTER, _EDGE_BIN)
    total = np.zeros((bins.size, observation.shape[1]))
    seen = np.zeros((bins.size, 1))
    for edge in edges:
        for i, first in enumerate(edge + bins):
            if first >= 0 and first + _EDGE_BIN <= observation.frames:
                total[i] += observation.column[first : first + _EDGE_BIN].sum(axis=0)
                seen[i] += 1
    known = seen[:, 0] > 0
    per = seen[known] * _EDGE_BIN * observation.shape[0]
    return bins[known] + _EDGE_BIN / 2, total[known] / per


def motion_panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[Panel]:
    """Spikes too many or too few where moving light brightens, has just been brighter, has brighter neighbours ..."""
    panels = []
    for t in takes(evidence, ("moving",)):
        films = [o.film if o is not None else None for o in (t.measured, t.before, t.after)]
        if films[0] is None or films[1] is None:
            continue
        assert t.shown.light is not None
        for name, feature in features(t.shown.light, len(films[0]), t.measured.shape).items():
            panel = _over_feature(f"{name} ({t.shown.name})", feature, films)
            if panel:
                panels.append(panel)
    yield from loudest(panels, 4)


def features(light: Keyframes, bins: int, shape: tuple[int, int]) -> dict[str, Array]:
    """What about moving light a pixel may notice, (bins, P) each, relative to the mean light."""
    at = np.clip((np.arange(bins) + 0.5) * BIN, light.frame[0], light.frame[-1])
    film = _film_of(light, at)
    film = film / max(film.mean(), 1e-12)
    change = np.gradient(film, axis=0)
    past = film.copy()
    for i in range(1, bins):
        past[i] = 0.75 * past[i - 1] + 0.25 * film[i]
    padded = np.pad(film, ((0, 0), (1, 1), (1, 1)), mode="edge")
    around_it = (padded[:, 2:, 1:-1] + padded[:, :-2, 1:-1] + padded[:, 1:-1, 2:] + padded[:, 1:-1, :-2]) / 4
    row = (np.arange(shape[0]) / max(shape[0] - 1, 1) - 0.5)[None, :, None]
    found = {
        "Where it brightens": change,
        "Where it was brighter just before": past - film,
        "Where neighbours are brighter": around_it - film,
        "Where it brightens in low rows": row * change,
    }
    return {name: f.reshape(bins, -1) for name, f in found.items()}


def _film_of(light: Keyframes, at: Array) -> Array:
    """Radiance (N, H, W) at times [frames]."""
    right = np.clip(np.searchsorted(light.frame, at), 1, max(len(light.frame) - 1, 1))
    if len(light.frame) == 1:
        return np.repeat(light.radiance.astype(np.float64), at.size, axis=0)
    share = (at - light.frame[right - 1]) / (light.frame[right] - light.frame[right - 1])
    share = share[:, None, None]
    return (1 - share) * light.radiance[right - 1] + share * light.radiance[right]


def _over_feature(title: str, feature: Array, films: Sequence[NDArray[np.uint8] | None]) -> Panel | None:
    """Spikes of bins of a feature with as many entries each; None where the feature does not vary."""
    edges = np.unique(np.quantile(feature, np.linspace(0, 1, 10)))
    if edges.size < 4 or np.ptp(edges) < 1e-9:
        return None
    where = np.clip(np.searchsorted(edges, feature.reshape(-1), side="right") - 1, 0, edges.size - 2)
    size = np.maximum(np.bincount(where, minlength=edges.size - 1), 1)

    def mean(values: Array) -> Array:
        return np.bincount(where, values, edges.size - 1) / size

    measured, before, after = (None if f is None else f.reshape(-1).astype(np.float64) for f in films)
    assert measured is not None and before is not None
    off = measured - before
    scale = 100 / np.maximum(mean(before), 1e-9)
    sd = np.sqrt(np.maximum(mean(off**2) - mean(off) ** 2, 0) / size)
    return Panel(
        title, "feature over mean light", "spikes over the model's, less 1 [%]", mean(feature.reshape(-1)),
        scale * mean(off), np.zeros(edges.size - 1), None if after is None else scale * mean(after - before),
        scale * sd,
    )  # fmt: skip


# --- pixels


def pattern_panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[Panel]:
    """Dark level and response of pixels: how they are spread, and by row and column."""
    shape = evidence.measured[0].shape if evidence.measured and evidence.measured[0] is not None else None
    bases = (evidence.measured_base, evidence.before_base, evidence.after_base)
    for what, title in (("gain", "Response of pixels"), ("dark", "Dark level of pixels")):
        values = [None if b is None else np.asarray(getattr(b, what)) for b in bases]
        histogram = _histogram(title, values, log=what == "dark")
        if histogram:
            yield histogram
    if shape is None:
        return
    for axis, name in ((1, "row"), (0, "column")):
        relative = [None if b is None else 100 * (b.gain / max(b.gain.mean(), 1e-12) - 1).reshape(shape) for b in bases]
        measured, before, after = relative
        assert measured is not None and before is not None
        sd = (measured - before).std(axis=axis) / np.sqrt(shape[axis])
        yield Panel(f"Response by {name}", name, "off the mean [%]", np.arange(sd.size, dtype=np.float64),
                    measured.mean(axis=axis), before.mean(axis=axis),
                    None if after is None else after.mean(axis=axis), sd)  # fmt: skip


def _histogram(title: str, values: Sequence[Array | None], *, log: bool) -> Panel | None:
    """Pixels by value; bands by the root of the count."""
    measured, before = values[0], values[1]
    assert measured is not None and before is not None
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
    unit = "thresholds a frame" + ("" if log else " at radiance 1")
    return Panel(title, unit, "pixels", middle, counts[0], counts[1], counts[2],
                 np.sqrt(np.maximum(counts[0] + counts[1], 1)), log="x" if log else "")  # fmt: skip


def pattern_maps(evidence: Evidence) -> Iterator[Maps]:
    """Maps of dark level and response."""
    shape = evidence.measured[0].shape if evidence.measured and evidence.measured[0] is not None else None
    if shape is None:
        return
    bases = (evidence.measured_base, evidence.before_base, evidence.after_base)
    for what, title in (
        ("gain", "Response [thresholds a frame at radiance 1]"),
        ("dark", "Dark level [thresholds a frame]"),
    ):
        measured, before, after = (None if b is None else np.asarray(getattr(b, what)).reshape(shape) for b in bases)
        assert measured is not None and before is not None
        yield Maps(title, measured, before, after)


# --- intervals and neighbours


def interval_panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[Panel]:
    """Intervals by length, and how their shares differ."""
    panels = []
    for t in takes(evidence, STATIC):
        total = [max(float(o.lengths.sum()), 1.0) if o else 1.0 for o in (t.measured, t.before, t.after)]
        if min(total[:2]) < 100:
            continue
        both = t.measured.lengths + t.before.lengths
        shown = np.flatnonzero(both > 0)
        shown = np.arange(shown[0], shown[-1] + 1)
        measured, before = t.measured.lengths[shown] / total[0], t.before.lengths[shown] / total[1]
        after = t.after.lengths[shown] / total[2] if t.after else None
        sd = np.sqrt(np.maximum(measured, 1 / total[0]) / total[0] + np.maximum(before, 1 / total[1]) / total[1])
        sd = scaled(sd, t.again.lengths[shown] / max(t.again.lengths.sum(), 1) - before if t.again else None)
        panels.append(Panel(
            f"Intervals by length, {t.shown.name}", "length [frames]", "share, less the model's [%]",
            shown + 1.0, 100 * (measured - before), np.zeros(shown.size),
            None if after is None else 100 * (after - before), 100 * sd,
        ))  # fmt: skip
    yield from loudest(panels, 3)


def neighbour_panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[Panel]:
    """Spikes of a pixel with its neighbour's, in the same frame and one or two after."""
    panels = []
    for t in takes(evidence, STATIC):
        measured, before = (o.coincidences.T.reshape(-1) for o in (t.measured, t.before))
        if min(measured.min(), before.min()) < 20:
            continue
        after = t.after.coincidences.T.reshape(-1) if t.after else None
        labels = tuple(f"{where}, {lag}" for where in ("in a row", "in a column") for lag in range(len(measured) // 2))
        again = t.again.coincidences.T.reshape(-1) if t.again else None
        # Every pair is counted both ways round.
        sd = scaled(np.sqrt(2 / measured + 2 / before), None if again is None else again / before - 1)
        panels.append(Panel(
            f"Coincidences of neighbours, {t.shown.name}", "", "over the model's, less 1 [%]",
            np.arange(len(labels), dtype=np.float64), 100 * (measured / before - 1), np.zeros(len(labels)),
            None if after is None else 100 * (after / before - 1), 100 * sd,
            labels=labels, line=False,
        ))  # fmt: skip
    yield from loudest(panels, 2)


def _no_maps(evidence: Evidence) -> Iterator[Maps]:
    return iter(())


_EXHIBITS: tuple[tuple[str, str, str, tuple[str, ...], Callable, Callable], ...] = (
    ("rates", "Rates and levels",
     "How far mean rates are off a straight line through each pixel's own levels (a camera that saturates bends down "
     "at high levels), and the array's rate over the model's, recording by recording.",
     ("rate", "level", "linear", "response curve"), rate_panels, _no_maps),
    ("noise", "Temporal noise",
     "Noise of single spikes, from second differences A_k of spike times k apart. Level over k: drawn anew for each "
     "spike; rising: slow noise. Then the variance of intervals, and whether a long one follows a short one.",
     ("noise", "jitter", "variance", "a_k", "lag-1", "lag1"), noise_panels, _no_maps),
    ("spectrum", "Spectrum of the population",
     "Power of the number of spikes of the whole array, over that of independent random spikes. Lines are flicker or "
     "ripple: in lit recordings only, or in the dark too. Combs at multiples of the rate are the pixels' own beat.",
     ("spectr", "line", "band", "frequency", "waveform"), spectrum_panels, _no_maps),
    ("drift", "Through the recording", "The array's rate in sixteen parts of a recording, less the model's.",
     ("drift", "block", "slow", "stationar"), drift_panels, _no_maps),
    ("step", "After a step of light",
     "The array's rate around sudden changes of light. A tail after the step is lag; an offset is not.",
     ("step", "edge", "lag_"), step_panels, _no_maps),
    ("motion", "Moving light",
     "Spikes over the model's, of all moments and pixels at which the light did the same: brightened, had just been "
     "brighter (lag), had brighter neighbours (blur, crosstalk), brightened in low rows (rows read at other times).",
     ("motion", "moving", "film", "skew"), motion_panels, _no_maps),
    ("pattern", "Fixed pattern",
     "Response and dark level of every pixel, from straight lines through its rates, and their profiles. Row and "
     "column profiles are means over the other direction.",
     ("pattern", "map", "dark", "row", "column", "radial", "quantile", "profile", "spread", "shading", "autocorr"),
     pattern_panels, pattern_maps),
    ("intervals", "Lengths of intervals", "How often intervals of each length occur, less the model's share.",
     ("interval", "short", "long", "histogram"), interval_panels, _no_maps),
    ("neighbours", "Neighbours",
     "How often a pixel fires with its neighbour, in the same frame (0) and one or two frames after, over the model's.",
     ("neighbour", "coincid", "common"), neighbour_panels, _no_maps),
)  # fmt: skip
