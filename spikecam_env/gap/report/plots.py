"""Plots of a diagnosis: one small figure a panel, so that a page can lay them out for any width.

Measured black dots, model before orange dashes and squares, model after blue line and triangles, noise band grey:
colours of Okabe and Ito, separate by form as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import matplotlib.ticker
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spikecam_env.gap.report.panels import Array, PlotPanel
from spikecam_env.gap.report.quantities import three_digits
from spikecam_env.gap.result import Gap, Statistic

MEASURED, BEFORE, AFTER, BAND, FLOOR = "#000000", "#D55E00", "#0072B2", "#D9D9D9", "#8C8C8C"

_WIDTH, _HEIGHT = 4.8, 3.3
_FONTS: Any = {"font.size": 10, "axes.titlesize": 10.5, "axes.spines.top": False, "axes.spines.right": False,
          "font.family": "DejaVu Sans", "axes.titlelocation": "left"}  # fmt: skip
_MANY = 40
"""Points from which measured is drawn as a thin line, not as dots."""

_TICKS_OF_LONG_NUMBERS = 5
"""Intervals between ticks at most, for numbers of eight characters not to touch."""

_plain = mpl.ticker.FuncFormatter(lambda value, _: f"{value:g}")


def panel(p: PlotPanel) -> Figure:
    """Measured, before and after, with a band of two standard errors around before."""
    with mpl.rc_context(_FONTS):
        figure, axis = _plot(_height(len(p.labels)), p.labels)
        if p.labels:
            _by_name(axis, p)
        else:
            _over_x(axis, p)
        axis.set_title(p.title)
        return figure


def _plot(height: float, names: Sequence[str] = (), top: float = 0.32) -> tuple[Figure, Axes]:
    """A figure with one axis; margins in inches, wide enough for names on the left.  (A layout engine draws twice.)"""
    left = max(0.78, 0.25 + 0.087 * max(map(len, names), default=0))
    bottom, right = 0.52, 0.12
    figure = Figure((_WIDTH, height))
    box = (left / _WIDTH, bottom / height, 1 - (left + right) / _WIDTH, 1 - (bottom + top) / height)
    return figure, figure.add_axes(box)


def _height(names: int) -> float:
    return max(_HEIGHT, 1.1 + 0.26 * names)


def _over_x(axis: Axes, p: PlotPanel) -> None:
    low, high = _band(p)
    many = p.x.size > _MANY
    axis.fill_between(p.x, low, high, color=BAND, lw=0, zorder=0)
    axis.plot(p.x, p.before, color=BEFORE, ls=(0, (5, 2)), lw=1.4, marker=None if many else "s", ms=4, zorder=2)
    if p.after is not None:
        axis.plot(p.x, p.after, color=AFTER, lw=1.4, marker=None if many else "^", ms=7, zorder=3)
    dots: Any = {"lw": 0.9, "marker": ".", "ms": 3, "alpha": 0.8} if many else {"ls": "", "marker": "o", "ms": 4.5}
    axis.plot(p.x, p.measured, color=MEASURED, zorder=4, **dots)
    if "y" in p.log:
        axis.set_yscale("log")
    axis.set(xlabel=p.xlabel, ylabel=p.ylabel)
    if "x" in p.log and p.x.min() > 0:
        axis.set_xscale("log")
        axis.xaxis.set_major_formatter(_plain)
        axis.xaxis.set_minor_formatter(mpl.ticker.NullFormatter())
        if p.x.size <= 8:
            axis.set_xticks(p.x, [f"{v:.3g}" for v in p.x])
    elif np.all(p.x == np.round(p.x)):
        axis.xaxis.set_major_locator(mpl.ticker.MaxNLocator(8, integer=True))


def _band(p: PlotPanel) -> tuple[Array, Array]:
    """Two standard errors around before; of its logarithm where y is logarithmic."""
    if "y" in p.log:
        return p.before * np.exp(-2 * p.sd / p.before), p.before * np.exp(2 * p.sd / p.before)
    return p.before - 2 * p.sd, p.before + 2 * p.sd


def _by_name(axis: Axes, p: PlotPanel) -> None:
    """Names down the left, values across."""
    y = -p.x
    axis.barh(y, 4 * p.sd, left=p.before - 2 * p.sd, height=0.8, color=BAND, zorder=0)
    axis.plot(p.before, y, color=BEFORE, marker="s", ms=5, ls="", zorder=2)
    if p.after is not None:
        axis.plot(p.after, y, color=AFTER, marker="^", ms=8, ls="", zorder=3)
    axis.plot(p.measured, y, color=MEASURED, marker="o", ms=4.5, ls="", zorder=4)
    axis.set_yticks(y, p.labels)
    axis.use_sticky_edges = False
    axis.autoscale()
    axis.xaxis.set_major_locator(mpl.ticker.MaxNLocator(_TICKS_OF_LONG_NUMBERS))
    axis.set(xlabel=p.ylabel)
    axis.grid(axis="y", color="0.93", zorder=-1)


def pixel_map(values: Array, title: str, limits: tuple[float, float], unit: str) -> Figure:
    """Every pixel (H, W) in colour, between limits; of large arrays means of several pixels."""
    values = _shrunk(values)
    with mpl.rc_context(_FONTS):
        figure = Figure((3.4, 2.9))
        axis = figure.add_axes((0.02, 0.02, 0.7, 0.87))
        image = axis.imshow(values, vmin=limits[0], vmax=limits[1], interpolation="nearest", cmap="viridis")
        bar = figure.colorbar(image, cax=figure.add_axes((0.74, 0.1, 0.04, 0.7)))
        bar.set_label(f"[{unit}]", fontsize=8)
        axis.set_title(title)
        axis.set(xticks=[], yticks=[])
        return figure


def motion_map(rate: Array, moving: NDArray[np.bool_], title: str) -> Figure:
    """A recording (H, W) in grey, its moving pixels in orange; axes in pixels of the campaign."""
    low, high = map_limits(rate)
    grey = np.repeat(np.clip((rate - low) / (high - low), 0.0, 1.0)[..., None], 3, axis=2)
    orange = np.array(mpl.colors.to_rgb(BEFORE))
    with mpl.rc_context(_FONTS):
        figure = Figure((_WIDTH, max(2.2, 0.6 + min(rate.shape[0] / rate.shape[1], 1.2) * 4.0)))
        axis = figure.add_axes((0.13, 0.16, 0.84, 0.74))
        axis.imshow(np.where(moving[..., None], 0.45 * grey + 0.55 * orange, grey), interpolation="nearest")
        axis.set(title=title, xlabel="column [pixel]", ylabel="row [pixel]")
        return figure


_LARGEST = 128
"""Pixels along a side up to which a map is drawn as it is."""


def _shrunk(values: Array) -> Array:
    n = -(-max(values.shape) // _LARGEST)
    rows, columns = (size // n * n for size in values.shape)
    shrunk: Array = values[:rows, :columns].reshape(rows // n, n, columns // n, n).mean(axis=(1, 3))
    return shrunk


def map_limits(values: Array) -> tuple[float, float]:
    """Colour limits: all but half a per cent of the pixels at either end."""
    low, high = np.quantile(values[np.isfinite(values)], [0.005, 0.995])
    return float(low), float(max(high, low + 1e-12))


def strip(statistics: Sequence[Statistic]) -> Figure:
    """z of every statistic by group, before and after; the group that is furthest off on top."""
    patched = any(s.after != s.before for s in statistics)
    names = dict.fromkeys(s.group for s in statistics)
    groups = sorted(names, key=lambda g: max(abs(s.z) for s in statistics if s.group == g))
    with mpl.rc_context(_FONTS):
        figure, axis = _plot(0.8 + 0.36 * len(groups), groups, top=0.08)
        axis.axvspan(-3, 3, color=BAND, lw=0, zorder=0)
        for y, group in enumerate(groups):
            mine = [s for s in statistics if s.group == group]
            rows = [([s.z for s in mine], 0.18, BEFORE, "s"), ([s.z_after for s in mine], -0.18, AFTER, "^")]
            for values, up, colour, mark in rows if patched else rows[:1]:
                axis.plot(values, np.full(len(values), y + up), ls="", marker=mark, ms=4.5, color=colour, alpha=0.6)
        largest = max((abs(z) for s in statistics for z in (s.z, s.z_after) if np.isfinite(z)), default=1.0)
        axis.set_xscale("symlog", linthresh=5)
        axis.set_xlim(-1.3 * max(largest, 5), 1.3 * max(largest, 5))
        ticks = [t for t in (3, 10, 30, 100, 300, 1000, 10_000, 100_000) if t <= 1.3 * max(largest, 5)]
        axis.set_xticks([*(-t for t in ticks), 0, *ticks], [*(f"−{t}" for t in ticks), "0", *map(str, ticks)])
        axis.minorticks_off()
        axis.set_yticks(range(len(groups)), groups)
        axis.set(xlabel="z: measured less model [standard deviations]", ylim=(-0.6, len(groups) - 0.4))
        axis.grid(axis="y", color="0.93", zorder=-1)
        return figure


def gap_bars(gap: Gap, recordings: Sequence[str]) -> Figure:
    """Gap of these recordings and of all that are held out, before and after, and the floor."""
    rows = [gap.by_recording[name] for name in recordings]
    rows.append({"before": gap.before, "after": gap.after, "floor": gap.floor})
    names = [*recordings, "all held out"]
    y = -np.arange(len(rows), dtype=np.float64)
    with mpl.rc_context(_FONTS):
        figure, axis = _plot(0.7 + 0.5 * len(rows), names, top=0.08)
        values = [v for row in rows for v in row.values() if np.isfinite(v) and v > 0]
        left = 0.5 * min(values, default=1.0)
        patched = gap.after != gap.before
        bars = [("before", 0.27, BEFORE), *([("after", 0.0, AFTER)] if patched else []), ("floor", -0.27, FLOOR)]
        for key, up, colour in bars:
            widths = np.array([row.get(key, np.nan) for row in rows], dtype=np.float64)
            axis.barh(y + up, np.maximum(widths - left, 0), left=left, height=0.25, color=colour)
            for at, value in zip(y + up, widths, strict=True):
                if np.isfinite(value):
                    axis.annotate(three_digits(value), (max(value, left), at), (3, 0), textcoords="offset points",
                                  va="center", fontsize=8)  # fmt: skip
        axis.set_xscale("log")
        axis.set_xlim(left, max(values, default=1.0) * (max(values, default=1.0) / left) ** 0.15)
        axis.xaxis.set_major_formatter(_plain)
        axis.xaxis.set_minor_formatter(mpl.ticker.NullFormatter())
        axis.set_yticks(y, names)
        axis.set(xlabel="mean square distance [noise²]")
        return figure


def rungs(names: Sequence[str], gaps: Sequence[float], groups: Sequence[dict[str, float]]) -> Figure:
    """Models one above the other: the gap of each as a bar, and of its groups of statistics as dots."""
    height, left = 0.95 + 0.55 * len(names), 0.25 + 0.087 * max(map(len, names))
    whole, low = left + 4.6, 0.1
    most = max((v for g in groups for v in g.values()), default=1.0)
    y = -np.arange(len(names), dtype=np.float64)
    with mpl.rc_context(_FONTS):
        figure = Figure((whole, height))
        axis = figure.add_axes((left / whole, 0.55 / height, 3.2 / whole, 1 - 0.65 / height))
        axis.barh(y, np.maximum(np.array(gaps) - low, 0.0), left=low, height=0.45, color="#BFD7EA", zorder=0)
        worst = sorted({k for g in groups for k in g}, key=lambda k: -max(g.get(k, 0.0) for g in groups))
        for number, name in enumerate(worst):
            at = [max(g.get(name, np.nan), low) for g in groups]
            colour = mpl.color_sequences["tab10"][number % 10]
            axis.plot(at, y, ls="", marker="o^svDP"[number % 6], ms=5, color=colour, label=name, clip_on=False)
        for place, gap in zip(y, gaps, strict=True):
            axis.annotate(f"{gap:.2g}", (max(gap, low), place), (3, 9), textcoords="offset points", va="bottom",
                          fontsize=9, fontweight="bold")  # fmt: skip
        axis.axvline(1.0, color=FLOOR, lw=1, ls=":")
        axis.set_xscale("log")
        axis.set_xlim(low, 4 * max(most, *gaps))
        axis.set_ylim(float(y[-1]) - 0.5, 0.75)
        axis.set_yticks(y, names)
        axis.set(xlabel="mean square distance [noise²]; 1: chance")
        axis.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=8, frameon=False)
        return figure
