"""The calibration report: one HTML file with its pictures inside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spikecam_env.calibration.population import FLAGS
from spikecam_env.calibration.snee import Calibration, Setting
from spikecam_env.page import captioned, element, page, picture, table
from spikecam_env.version import __version__

if TYPE_CHECKING:
    from spikecam_env.calibration.findings import Finding


def report(calibration: Calibration, findings: Sequence[Finding]) -> str:
    """The whole page."""
    c = calibration
    rows, columns = c.shape
    parts = [
        element("h1", f"Calibration of {c.campaign}"),
        element(
            "p",
            f"{rows} × {columns} pixels at {c.frame_rate_hz:g} Hz; "
            + "; ".join(f"{len(s.levels)} recordings{_at(s)}" for s in c.settings)
            + f". {int(np.sum(c.flags == 0))} of {c.flags.size} pixels regular. spikecam-env {__version__}.",
        ),
        *(element("p", w, class_="warn") for w in c.warnings),
        element("h2", "Identified quantities"),
        _findings_table(findings),
    ]
    figures: list[tuple[str, Callable[[Figure, Setting, Calibration], None], tuple[float, float], str]] = [
        ("Response", _response, (10, 4), "Left: rate over light of 40 pixels and the median pixel's line. "
         "Right: error of each label, if the line is exact: medians over pixels, bars from 10 to 90 % of them."),
        ("Residuals", _residuals, (10, 3.6), "Left: residuals of all pixels and levels in standard deviations of the "
         "law, with a normal curve. Right: reduced chi-square of each pixel."),
        ("Temporal noise", _noise, (10, 4), "A_k less its part by reading in whole frames, over 2 k T², pooled over "
         "pixels and levels. Level: noise drawn anew for each spike. Rising: slow noise."),
        ("Maps", _maps, (10, 4), "alpha/phi and I_dark/phi of every pixel, and which pixels are odd."),
        ("Distributions", _histograms, (10, 3.6), "Regular pixels; the dark level on a logarithmic axis with normal "
         "and log-normal of the same moments."),
    ]  # fmt: skip
    for setting in c.settings:
        for title, draw, size, caption in figures:
            if title == "Temporal noise" and setting.jitter is None:
                continue
            parts += [element("h2", title + _at(setting)), _figure(draw, setting, c, size, caption)]
        parts += [element("h2", f"Recordings{_at(setting)}"), _levels_table(setting)]
    if c.swing_V is not None:
        parts += [
            element("h2", "V_S"),
            _figure(_swing, c.main, c, (10, 3.6), "V_d + V_S of every pixel, from two V_d."),
        ]
    return page(f"Calibration of {c.campaign}", parts)


def _at(setting: Setting) -> str:
    return "" if setting.v_d is None else f" at V_d = {setting.v_d:g} V"


def _findings_table(findings: Sequence[Finding]) -> str:
    head = ("quantity", "status", "value (90 %)", "unit", "from")
    rows = [(f.quantity, f.status, f.text, f.unit, f.basis) for f in findings]
    return table(head, rows, numbers=(2,), classes=[f.status.split()[0] for f in findings])


def _levels_table(setting: Setting) -> str:
    head = ("recording", "use", "frames", "radiance", "rate", "saturated", "off")
    rows = [
        (v.name, v.use, str(v.frames), f"{v.radiance:.4g}", f"{v.rate:.5f}", f"{v.saturated:.1%}", _signed(v.residual))
        for v in setting.levels
    ]
    return table(head, rows, numbers=range(2, 7))


def _signed(value: float) -> str:
    return f"{value:+.1e}" if np.isfinite(value) else "-"


def _figure(
    draw: Callable[[Figure, Setting, Calibration], None],
    setting: Setting,
    calibration: Calibration,
    size: tuple[float, float],
    caption: str,
) -> str:
    figure = Figure(figsize=size, layout="constrained")
    draw(figure, setting, calibration)
    return captioned(picture(figure, caption, form="png"), caption)


def _response(figure: Figure, s: Setting, c: Calibration) -> None:
    left, right = figure.subplots(1, 2)
    good = np.flatnonzero(c.flags.reshape(-1) == 0)
    order = np.argsort(s.light[:, good[0]])
    for p in good[:: max(1, good.size // 40)]:
        left.plot(s.light[order, p], s.rate[order, p], color="0.75", lw=0.7, zorder=1)
    for p in np.flatnonzero(c.flags.reshape(-1) > 0)[:10]:
        left.plot(s.light[order, p], s.rate[order, p], color="tab:red", lw=0.7, zorder=2)
    x = np.array([0.0, s.light.max()])
    left.plot(x, np.median(s.gain.flat[good]) * x + np.median(s.dark.flat[good]), "k--", lw=1, zorder=3)
    left.set(
        xlabel="radiance (label)", ylabel="spikes / frame", ylim=(-0.03, 1.08), title="grey: regular, red: odd pixels"
    )
    expected = s.gain.reshape(-1)[good] * s.light[:, good] + s.dark.reshape(-1)[good]
    with np.errstate(invalid="ignore", divide="ignore"):
        off = np.where(s.rate[:, good] < 0.97, s.rate[:, good] / expected - 1.0, np.nan)
    shown = np.flatnonzero(np.isfinite(off).mean(axis=1) > 0.5)
    low, middle, high = np.nanquantile(off[shown], [0.1, 0.5, 0.9], axis=1)
    x = np.median(s.light[shown], axis=1)
    right.errorbar(x, middle, yerr=[middle - low, high - middle], fmt="o", ms=3, lw=0.8)
    right.axhline(0.0, color="0.5", lw=0.8)
    right.set_yscale("symlog", linthresh=1e-4)
    right.set(xlabel="radiance (label)", ylabel="measured / line − 1")


def _residuals(figure: Figure, s: Setting, c: Calibration) -> None:
    left, right = figure.subplots(1, 2)
    good = c.flags.reshape(-1) == 0
    z = s.residual[:, good]
    z = z[np.isfinite(z)]
    edges = np.linspace(-5, 5, 81)
    left.plot(edges, np.exp(-(edges**2) / 2) / np.sqrt(2 * np.pi), "k", lw=1)
    left.set(xlabel="residual [sd]", title="two levels leave no residuals")
    if z.size:
        left.hist(np.clip(z, -5, 5), edges, density=True, color="tab:blue", alpha=0.7)
        left.set(title=f"rms {np.sqrt(np.mean(z**2)):.3f}")
    image = right.imshow(s.chi2, vmin=0, vmax=3, interpolation="nearest", cmap="viridis")
    figure.colorbar(image, ax=right, label="reduced chi²")


def _noise(figure: Figure, s: Setting, c: Calibration) -> None:
    axis = figure.subplots()
    j = s.jitter
    if j is None:
        return
    axis.errorbar(j.steps, 1e5 * j.by_step, yerr=1e5 * j.by_step_sd, fmt="o", ms=4, label="from each k alone")
    law = 1e5 * (j.white + j.steps * j.slow / 2)
    axis.plot(j.steps, law, "k", lw=1, label=f"s² = {j.white:.3g} ± {j.white_sd:.1g}, b = {j.slow:.2g}")
    if c.charge is not None and np.isfinite(c.charge.electrons) and s is c.main:
        axis.axhline(
            1e5 / c.charge.electrons, color="tab:green", lw=0.8, ls="--", label=f"1/N, N = {c.charge.electrons:.0f}"
        )
    axis.set(xscale="log", xlabel="k", ylabel="noise a spike, squared [1e-5 threshold²]", ylim=(0, 1.4 * max(law)))
    axis.legend(loc="lower right")


def _maps(figure: Figure, s: Setting, c: Calibration) -> None:
    axes = figure.subplots(1, 3)
    good = c.flags == 0
    for axis, name, label in zip(axes, ("gain", "dark"), ("alpha/phi", "I_dark/phi"), strict=False):
        values = getattr(s, name)
        low, high = np.quantile(values[good], [0.005, 0.995])
        image = axis.imshow(values, vmin=low, vmax=high, interpolation="nearest", cmap="viridis")
        figure.colorbar(image, ax=axis, shrink=0.8)
        axis.set_title(label)
    axes[2].imshow(c.flags > 0, interpolation="nearest", cmap="gray_r", vmin=0, vmax=1)
    counts = ", ".join(f"{name} {int(np.sum(c.flags & bit > 0))}" for name, bit in FLAGS.items())
    axes[2].set_title(f"odd pixels: {counts}", fontsize=8)


def _histograms(figure: Figure, s: Setting, c: Calibration) -> None:
    left, right = figure.subplots(1, 2)
    good = c.flags == 0
    _normal_histogram(left, s.gain[good], "alpha/phi")
    dark = s.dark[good & (s.dark > 0)]
    if dark.size < 2 or dark.max() <= dark.min():
        return
    edges = np.geomspace(0.5 * np.quantile(dark, 0.02), dark.max(), 50)
    right.hist(dark, edges, density=True, color="tab:blue", alpha=0.6)
    logs = np.log(dark)
    bell = np.exp(-((np.log(edges) - logs.mean()) ** 2) / (2 * logs.var())) / (edges * np.sqrt(2 * np.pi * logs.var()))
    right.plot(edges, bell, "k", lw=1, label=f"log-normal, σ = {logs.std():.3f}")
    bell = np.exp(-((edges - dark.mean()) ** 2) / (2 * dark.var())) / np.sqrt(2 * np.pi * dark.var())
    right.plot(edges, bell, "k--", lw=1, label=f"normal, sd/mean = {dark.std() / dark.mean():.3f}")
    right.set(xscale="log", xlabel="I_dark/phi [thresholds/frame]")
    right.legend(fontsize=8)


def _swing(figure: Figure, s: Setting, c: Calibration) -> None:
    left, right = figure.subplots(1, 2)
    if c.swing_V is None:
        return
    good = c.flags == 0
    _normal_histogram(left, c.swing_V[good], "V_d + V_S [V]")
    image = right.imshow(np.where(good, c.swing_V, np.nan), interpolation="nearest", cmap="viridis")
    figure.colorbar(image, ax=right, label="V_d + V_S [V]")


def _normal_histogram(axis: Axes, values: NDArray[np.float64], label: str) -> None:
    axis.hist(values, 60, density=True, color="tab:blue", alpha=0.6)
    if values.var() > 0:
        x = np.linspace(values.min(), values.max(), 200)
        axis.plot(
            x, np.exp(-((x - values.mean()) ** 2) / (2 * values.var())) / np.sqrt(2 * np.pi * values.var()), "k", lw=1
        )
    axis.set(xlabel=label, title=f"{values.mean():.4g} ± {values.std():.2g} (sd)")
