"""SNEE: a camera's response and noise by a campaign of flats.

Rates at one V_d fix two numbers a pixel, alpha/phi and I_dark/phi; their temporal noise fixes one more for the camera,
1/N + kappa^2.  With a second V_d the same charge is divided by another threshold, so V_S, N and kappa come apart.
alpha, C_S and I_dark in ampere stay prior: rates know charge only in thresholds.  Source: paper (13)-(17).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from spikecam_env.calibration.charge import ChargeScale, charge_at_one_v_d, charge_at_two_v_d
from spikecam_env.calibration.jitter import Jitter, fit_jitter
from spikecam_env.calibration.population import FLAGS, pixel_flags
from spikecam_env.calibration.response import (
    SATURATION,
    Lines,
    Rates,
    fit_lines,
    rates_from_counts,
    rates_from_times,
    together,
)
from spikecam_env.calibration.spike_times import STEPS, SpikeTimes, spike_times
from spikecam_env.campaign.reading import Campaign, CampaignRecording, read_campaign
from spikecam_env.checked import checked_number
from spikecam_env.errors import InputError
from spikecam_env.sensor import Circuit
from spikecam_env.sensor.unit import MOST_KAPPA, SWING_V
from spikecam_env.types import Floats

SAME_V_D_V = 1e-6
"""Distance up to which two V_d are one [V]: far below a supply's steps, far above the rounding of labels."""

Z90 = 1.6448536
"""Half-width of a 90 % interval [standard deviations]."""


@dataclass(frozen=True)
class Level:
    """One recording of a setting."""

    name: str
    use: str
    frames: int
    radiance: float
    """Median over pixels."""
    rate: float
    """Median over pixels [spikes/frame]."""
    saturated: float
    """Share of pixels that are left out since they saturate."""
    residual: float
    """Median over pixels of measured over fitted rate, less one: the label's error, if the line is right."""


@dataclass(frozen=True)
class Setting:
    """All recordings at one V_d; maps are (H, W)."""

    v_d: float | None
    levels: tuple[Level, ...]
    gain: Floats
    """alpha/phi [thresholds/frame at radiance 1]."""
    gain_sd: Floats
    dark: Floats
    """I_dark/phi [thresholds/frame]."""
    dark_sd: Floats
    covariance: Floats
    """Covariance of gain and dark."""
    chi2: Floats
    """Reduced chi-square."""
    used: NDArray[np.int64]
    """Number of recordings in the line."""
    excess: float
    """Pooled reduced chi-square; above 1.2, standard deviations are widened by its root."""
    flags: NDArray[np.uint8]
    """Bits of `population.FLAGS`."""
    jitter: Jitter | None
    light: Floats
    """(R, H*W) radiance."""
    rate: Floats
    """(R, H*W) measured rates."""
    residual: Floats
    """(R, H*W) distances from the line in standard deviations."""


@dataclass(frozen=True)
class Calibration:
    """A camera as a campaign of flats shows it.

    Example:
        >>> from spikecam_env.sensor import SensorModel
        >>> levels = (0.0, 0.2, 0.5)
        >>> campaign = write_flats("camera", SensorModel.preset("scsim"), levels=levels, frames=400, shape=(8, 8))
        >>> calibration = calibrate(campaign)
        >>> calibration.shape, len(calibration.settings), calibration.flags.shape
        ((8, 8), 1, (8, 8))
    """

    campaign: str
    """Name of the campaign's folder."""
    shape: tuple[int, int]
    frame_rate_hz: float
    settings: tuple[Setting, ...]
    """By V_d, the main one first."""
    flags: NDArray[np.uint8]
    """(H, W) bits of `population.FLAGS`."""
    charge: ChargeScale | None
    """N and kappa, with the prior that they use."""
    swing_V: Floats | None
    """(H, W) V_d + V_S [V], with a second V_d, else None."""
    swing_sd_V: Floats | None
    circuit: Circuit
    """The prior circuit."""
    warnings: tuple[str, ...]
    """Quantities that the data do not identify, and data that contradict each other."""

    @property
    def main(self) -> Setting:
        """The setting with most recordings."""
        return self.settings[0]


def calibrate(
    campaign: Campaign | str | Path,
    *,
    circuit: Circuit | None = None,
    reset_noise_mV: float | None = None,
    progress: bool = False,
) -> Calibration:
    """Estimate a camera from static recordings of known light.

    Args:
        campaign: the campaign, or its folder.
        circuit: prior for capacitance and reference voltage, which rates do not show; default: the published one.
        reset_noise_mV: prior for the reset noise, used at a single V_d; default: thermal, sqrt(kT/C).
        progress: show a bar.

    Raises:
        InputError: where nothing can be identified: one level only, all dark, all saturated, no regular pixel, labels
            that contradict the rates.

    Example:
        >>> from spikecam_env.sensor import SensorModel
        >>> levels = (0.0, 0.2, 0.5)
        >>> campaign = write_flats("camera", SensorModel.preset("scsim"), levels=levels, frames=400, shape=(8, 8))
        >>> calibration = calibrate(campaign)
        >>> round(float(calibration.main.gain.mean()), 1)  # spikes a frame at radiance 1
        1.0
    """
    campaign = campaign if isinstance(campaign, Campaign) else read_campaign(campaign)
    prior = circuit or Circuit()
    warnings: list[str] = []
    settings = [
        _fit_setting(v_d, recordings, campaign, warnings, progress)
        for v_d, recordings in _by_v_d(campaign, warnings).items()
    ]
    settings.sort(key=lambda s: -sum(level.use == "fit" for level in s.levels))
    settings = settings[:2]
    main = settings[0]
    flags = np.bitwise_or.reduce([main.flags, *(s.flags & FLAGS["unidentified"] for s in settings[1:])])
    _check_regular(flags)
    if main.v_d is not None:
        prior = replace(prior, reset_V=prior.reference_V + main.v_d)
    most_mV = 1e3 * MOST_KAPPA * prior.swing_V
    noise_mV = prior.thermal_noise_mV if reset_noise_mV is None else reset_noise_mV
    noise_mV = checked_number(noise_mV, "reset_noise_mV", 0.0, most_mV, unit=f"mV, {MOST_KAPPA:g} of the swing")
    swing = swing_sd = charge = None
    if len(settings) == 2 and main.v_d is not None and settings[1].v_d is not None:
        swing, swing_sd = swing_from_two_v_d(main, settings[1])
        known = np.where(flags == 0, swing, np.nan).reshape(-1)
        others = known - main.v_d + settings[1].v_d
        if _are_swings(known) and _are_swings(others):
            prior = replace(prior, bias_V=float(np.nanmean(known)) - main.v_d)
            charge = charge_at_two_v_d(main.jitter, settings[1].jitter, known, others)
        else:
            swing = swing_sd = None
            warnings.append(
                f"V_d = {main.v_d:g} and {settings[1].v_d:g} V give no swing from {SWING_V[0]:g} to {SWING_V[1]:g} V: "
                "they are too near each other, or their labels are wrong; V_S, N and kappa are as of one V_d"
            )
    if charge is None:
        charge = charge_at_one_v_d(main.jitter, prior.swing_V, noise_mV)
    return Calibration(
        campaign.folder.name,
        campaign.shape,
        campaign.frame_rate_hz,
        tuple(settings),
        flags,
        charge,
        swing,
        swing_sd,
        prior,
        tuple(warnings),
    )


def _are_swings(swing_V: Floats) -> bool:
    """Whether the mean of the known pixels is a swing that a circuit can have."""
    return bool(SWING_V[0] <= np.nanmean(swing_V) <= SWING_V[1])


def _check_regular(flags: NDArray[np.uint8]) -> None:
    if np.any(flags == 0):
        return
    counts = ", ".join(f"{int(np.sum(flags & bit > 0))} {name}" for name, bit in FLAGS.items())
    raise InputError(f"no pixel is regular ({counts} of {flags.size}): nothing can be said of this camera; record anew")


def swing_from_two_v_d(one: Setting, other: Setting) -> tuple[Floats, Floats]:
    """(H, W) swing V_d + V_S at the first setting and its standard deviation [V]; NaN for pixels without a slope.

    The same light and charge over another threshold: gain_1 / gain_2 = (V_2 + V_S) / (V_1 + V_S) = q, so
    V_1 + V_S = (V_1 - V_2) / (1 - q).
    """
    difference = float(one.v_d or 0.0) - float(other.v_d or 0.0)
    live = (one.flags | other.flags) & (FLAGS["unidentified"] | FLAGS["dead"]) == 0
    a, b = np.where(live, one.gain, np.nan), np.where(live, other.gain, np.nan)
    q = a / b
    sd_q = np.abs(q) * np.hypot(one.gain_sd / a, other.gain_sd / b)
    return difference / (1 - q), np.abs(difference) / (1 - q) ** 2 * sd_q


def _by_v_d(campaign: Campaign, warnings: list[str]) -> dict[float | None, list[tuple[CampaignRecording, Floats]]]:
    """Static recordings of known light, by V_d."""
    groups: dict[float | None, list[tuple[CampaignRecording, Floats]]] = {}
    for recording in campaign.recordings:
        light = recording.static_radiance()
        if light is None:
            warnings.append(f"{recording.name}: not used, its light is unknown or moves")
        else:
            groups.setdefault(_alike(groups, recording.v_d), []).append((recording, light))
    if not groups:
        raise InputError(f"{campaign.folder} has no static recording of known light; SNEE needs flats at known levels")
    if len(groups) > 2:
        warnings.append(f"{len(groups)} values of v_d; the two with most recordings are used")
    return groups


def _alike(known: Iterable[float | None], v_d: float | None) -> float | None:
    """A known V_d within SAME_V_D_V of this one, else this one."""
    near = (one for one in known if one is not None and v_d is not None and abs(one - v_d) <= SAME_V_D_V)
    return next(near, v_d)


def _fit_setting(
    v_d: float | None,
    recordings: list[tuple[CampaignRecording, Floats]],
    campaign: Campaign,
    warnings: list[str],
    progress: bool,
) -> Setting:
    """Fit the lines and the noise of all recordings at one V_d; appends to `warnings`."""
    pixels = campaign.shape[0] * campaign.shape[1]
    use = np.array([r.use == "fit" for r, _ in recordings])
    light = np.stack([x.reshape(-1) for _, x in recordings])
    _check_levels(light[use], v_d)
    times: list[SpikeTimes | None] = [
        spike_times(r.packed(), pixels) if r.spikes else None
        for r, _ in tqdm(recordings, desc="read recordings", unit="recording", disable=not progress)
    ]
    rates = together(
        [
            rates_from_times([t]) if t is not None else rates_from_counts(r.rate().reshape(-1), r.frames)
            for (r, _), t in zip(recordings, times, strict=True)
        ]
    )
    _check_order(recordings, light, rates, use)
    spikes = [t for t in times if t is not None]
    jitter = _pooled_jitter(spikes, np.ones(pixels, dtype=bool))
    if jitter is None:
        warnings.append("no spike times: temporal noise is not identified; intervals assume s^2 of shot noise alone")
    lines = fit_lines(light, rates, jitter.white if jitter else 1.0 / Circuit().threshold_electrons, use)
    _check_lines(lines, v_d)
    excess = _pooled_excess(lines)
    warnings += _warnings_of_lines(lines, excess)
    reduced = lines.chi2 / np.maximum(lines.freedom, 1)
    flags = pixel_flags(lines.gain, lines.dark, reduced, lines.freedom, excess)
    if jitter is not None and np.any(flags):
        jitter = _pooled_jitter(spikes, flags == 0) or jitter
    if jitter is not None and jitter.slow_fitted:
        warnings.append(f"A_k rises with k^2 too: slow noise, b = {jitter.slow:.2g} +- {jitter.slow_sd:.1g}")
    levels = _levels(recordings, light, rates, lines, flags == 0)
    maps = _maps(lines, reduced, flags, excess, campaign.shape)
    return Setting(
        v_d, levels, **maps, excess=excess, jitter=jitter, light=light, rate=rates.rate, residual=lines.residual
    )


def _maps(
    lines: Lines, reduced: Floats, flags: NDArray[np.uint8], excess: float, shape: tuple[int, int]
) -> dict[str, Any]:
    """The (H, W) fields of a `Setting`; errors are widened where the pooled chi-square is clearly above 1."""
    widen = np.sqrt(max(excess, 1.0)) if excess > 1.2 else 1.0
    fields = {
        "gain": lines.gain,
        "gain_sd": widen * np.sqrt(lines.var_gain),
        "dark": lines.dark,
        "dark_sd": widen * np.sqrt(lines.var_dark),
        "covariance": widen**2 * lines.covariance,
        "chi2": reduced,
        "flags": flags,
        "used": lines.used,
    }
    return {name: values.reshape(shape) for name, values in fields.items()}


def _warnings_of_lines(lines: Lines, excess: float) -> list[str]:
    """Warnings on lines that were not tested, or that do not fit; excess: pooled reduced chi-square."""
    warnings = []
    if lines.freedom.max() == 0:
        warnings.append("two levels only: that rate is linear in light is assumed, not tested")
    if excess > 1.5:
        warnings.append(
            f"residuals are {np.sqrt(excess):.1f} times as large as by jitter: labels, linearity or steadiness of the "
            "light are off by that much; intervals are widened"
        )
    return warnings


def _check_lines(lines: Lines, v_d: float | None) -> None:
    if not np.any(np.isfinite(lines.gain)):
        raise InputError(
            f"no pixel has two levels{_at(v_d)} below saturation, {SATURATION:g} spikes a frame; "
            "add flats of less light"
        )


def _check_levels(light: Floats, v_d: float | None) -> None:
    at = _at(v_d)
    if light.size == 0 or light.max() <= 0:
        raise InputError(f"all fit recordings{at} are dark: the response to light cannot be identified; add a lit flat")
    if np.all(light == light[0]):
        raise InputError(
            f"one level only{at}: its rate fixes gain * {np.median(light):g} + dark together, neither alone; "
            "add a recording at another level or in the dark"
        )


def _at(v_d: float | None) -> str:
    return "" if v_d is None else f" at v_d = {v_d:g} V"


def _check_order(
    recordings: list[tuple[CampaignRecording, Floats]], light: Floats, rates: Rates, use: NDArray[np.bool_]
) -> None:
    """Refuse labels that contradict the rates: medians over pixels that fall by more than 1 % with more light."""
    label, rate = np.median(light, axis=1), np.nanmedian(rates.rate, axis=1)
    lit = rate[use & (label > 0)]
    if lit.size and lit.max() <= 2 / rates.frames.max():
        best = np.nanmax(rates.rate[use & (label > 0)], axis=0)
        some = int(np.sum(best > 2 / rates.frames.max()))
        pixels = (
            f"all but {some} pixels respond to light in no recording"
            if some
            else "no pixel responds to light in any recording"
        )
        raise InputError(f"{pixels}: was the cap on, or are these the right files?")
    order = np.argsort(label, kind="stable")
    for a, b in pairwise(order):
        if label[b] > label[a] and rate[b] < 0.99 * rate[a] - 2 / min(rates.frames[a], rates.frames[b]):
            raise InputError(
                f"recordings {recordings[a][0].name!r} and {recordings[b][0].name!r} contradict their labels: radiance "
                f"{label[a]:g} gave {rate[a]:.4g} spikes a frame, {label[b]:g} gave {rate[b]:.4g}; are labels swapped?"
            )


def _pooled_jitter(times: list[SpikeTimes], pixels: NDArray[np.bool_]) -> Jitter | None:
    if not times:
        return None
    saturated = np.stack([t.count / t.frames > 0.97 for t in times])
    rate = np.where(saturated | ~pixels, np.nan, np.stack([t.rate for t in times]))
    square, terms = np.stack([t.square for t in times]), np.stack([t.terms for t in times]).astype(np.float64)
    return fit_jitter(np.array(STEPS), square, terms, rate)


def _pooled_excess(lines: Lines) -> float:
    """Reduced chi-square of the middle four fifths of pixels, so that odd pixels do not count."""
    good = lines.freedom > 0
    if not np.any(good):
        return 1.0
    reduced = lines.chi2[good] / lines.freedom[good]
    low, high = np.quantile(reduced, [0.1, 0.9])
    return float(reduced[(reduced >= low) & (reduced <= high)].mean())


def _levels(
    recordings: list[tuple[CampaignRecording, Floats]],
    light: Floats,
    rates: Rates,
    lines: Lines,
    regular: NDArray[np.bool_],
) -> tuple[Level, ...]:
    fitted = lines.gain * light + lines.dark
    with np.errstate(invalid="ignore", divide="ignore"):
        off = np.where(rates.saturated | ~regular, np.nan, rates.rate / fitted - 1.0)
    return tuple(
        Level(
            r.name,
            r.use,
            r.frames,
            float(np.median(light[i])),
            float(np.nanmedian(rates.rate[i])),
            float(rates.saturated[i].mean()),
            float(np.nanmedian(off[i])) if np.any(np.isfinite(off[i])) else np.nan,
        )
        for i, (r, _) in enumerate(recordings)
    )
