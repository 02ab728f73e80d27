"""From maps of pixels to a model: which pixels are odd, and the spreads of those that are not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from spikecam_env.robust import UPPER
from spikecam_env.sensor import CATALOGUE, Circuit, Effect, SensorModel
from spikecam_env.sensor.effects.base import build
from spikecam_env.types import Floats

FLAGS = {
    "unidentified": 1,
    "dead": 2,
    "hot": 4,
    "misfit": 8,
}
"""Bits of a pixel's flag.  unidentified: fewer than two levels below saturation.  dead: responds to light by less than
a tenth of the median pixel.  hot: dark current above `hot_limit`.  misfit: no straight line."""

_DEAD_SHARE = 0.1
_HOT_SIGMAS = 5.0
_MISFIT_P = 1e-7


def pixel_flags(
    gain: Floats, dark: Floats, chi2: Floats, freedom: NDArray[np.int64], excess: float
) -> NDArray[np.uint8]:
    """uint8 bits of FLAGS, of the arrays' shape; chi2 is reduced; excess: reduced chi2 pooled over pixels."""
    flags = np.zeros(gain.shape, dtype=np.uint8)
    unknown = ~np.isfinite(gain)
    flags[unknown] |= FLAGS["unidentified"]
    dead = ~unknown & (np.nan_to_num(gain) < _DEAD_SHARE * np.nanmedian(gain))
    flags[dead] |= FLAGS["dead"]
    live = ~unknown & ~dead
    flags[live & (np.nan_to_num(dark) > hot_limit(dark[live]))] |= FLAGS["hot"]
    p = scipy.stats.chi2.sf(chi2 / max(excess, 1.0) * freedom, np.maximum(freedom, 1))
    flags[live & (freedom > 0) & (p < _MISFIT_P)] |= FLAGS["misfit"]
    return flags


def hot_limit(dark: Floats) -> float:
    """Dark level above which a pixel is hot: five standard deviations of ln(dark), taken from its upper middle."""
    low, high = np.quantile(dark, [0.5, UPPER])
    low = max(low, 1e-12)
    return float(low * (max(high, low) / low) ** _HOT_SIGMAS) if high > 0 else np.inf


@dataclass(frozen=True)
class DarkLaw:
    """Distribution of the dark level over pixels."""

    law: str
    """'normal' or 'log-normal'."""
    first: float
    """Mean of a normal law, median of a log-normal one."""
    second: float
    """Standard deviation, of the logarithm for a log-normal law."""


def dark_law(dark: Floats) -> DarkLaw:
    """Normal or log-normal, whichever is the likelier for these pixels (hot ones left out)."""
    mean, sd = float(dark.mean()), float(dark.std())
    if sd <= 0 or dark.min() <= 0:
        return DarkLaw("normal", mean, sd)
    logs = np.log(dark)
    normal = scipy.stats.norm.logpdf(dark, mean, sd).sum()
    log_normal = (scipy.stats.norm.logpdf(logs, logs.mean(), logs.std()) - logs).sum()
    if log_normal > normal:
        return DarkLaw("log-normal", float(np.exp(logs.mean())), float(logs.std()))
    return DarkLaw("normal", mean, sd)


def spread(values: Floats, sd: Floats) -> float:
    """Standard deviation over mean, less the measurement's own errors `sd`."""
    return float(np.sqrt(max(values.var() - np.mean(sd**2), 0.0)) / values.mean())


def fitted_model(
    name: str,
    circuit: Circuit,
    frame_rate_hz: float,
    *,
    gain: Floats,
    gain_sd: Floats,
    dark: Floats,
    flags: NDArray[np.uint8],
    electrons: float,
    reset_noise_mV: float,
    swing_V: Floats | None,
    swing_sd_V: Floats | None = None,
) -> SensorModel:
    """A model with the spreads of these maps (H, W).

    Without `swing_V` all multiplicative spread goes into the conversion gain.  Rates at one V_d do not distinguish
    alpha, C_S and V_S, which act as one.

    Args:
        name: name of the model.
        circuit: its circuit.
        frame_rate_hz: its frame rate.
        gain: rate over light; the model has it relative to its mean.
        gain_sd: standard errors of `gain`.
        dark: dark level [thresholds/frame].
        flags: bits of `FLAGS`.
        electrons: N, electrons to a threshold; inf for none.
        reset_noise_mV: noise of a reset.
        swing_V: V_d + V_S [V], if known.
        swing_sd_V: standard errors of `swing_V`.
    """
    good = flags == 0
    per_volt = np.ones_like(gain) if swing_V is None else swing_V / swing_V[good].mean()
    effects: list[Effect] = []
    if np.isfinite(electrons):
        effects.append(_effect("shot_noise", quanta=float(electrons)))
    if reset_noise_mV > 0:
        effects.append(_effect("reset_noise", sigma_mV=float(reset_noise_mV)))
    alpha, falloff = flattened(gain * per_volt, good)
    if falloff > 0:
        effects.append(_effect("vignetting", falloff=falloff))
    effects.append(_effect("conversion_gain_spread", sigma=spread(alpha[good], (gain_sd * per_volt)[good])))
    if swing_V is not None:
        within = 0.0 if swing_sd_V is None else float(np.mean(swing_sd_V[good] ** 2))
        sigma_V = float(np.sqrt(max(swing_V[good].var() - within, 0.0)))
        effects.append(_effect("bias_voltage_spread", sigma_V=sigma_V))
    pA = circuit.capacitance_fF * circuit.swing_V * frame_rate_hz * 1e-3
    known = np.isfinite(per_volt) & (flags & (FLAGS["unidentified"] | FLAGS["dead"] | FLAGS["misfit"]) == 0)
    effects += dark_effects(np.maximum(dark * per_volt, 0.0)[known] * pA, (flags & FLAGS["hot"] > 0)[known])
    dead = np.mean(flags & FLAGS["dead"] > 0)
    if dead > 0:
        effects.append(_effect("dead_pixels", fraction=float(dead)))
    return SensorModel(name, circuit, frame_rate_hz, tuple(effects))


def flattened(gain: Floats, good: NDArray[np.bool_]) -> tuple[Floats, float]:
    """The map (H, W) without a bowl about its middle, 1 - v r^2 / r_corner^2, and v; 0 if not five standard errors."""
    rows, columns = gain.shape
    y, x = np.mgrid[:rows, :columns]
    square = (y - (rows - 1) / 2) ** 2 + (x - (columns - 1) / 2) ** 2
    square = square / max(square.max(), 1.0)
    if good.sum() < 10 or square[good].std() == 0:
        return gain, 0.0
    slope, middle = np.polyfit(square[good], gain[good], 1)
    error = np.std(gain[good] - slope * square[good] - middle) / (square[good].std() * np.sqrt(good.sum()))
    falloff = float(-slope / middle)
    if not 5 * error / middle < falloff < 1:
        return gain, 0.0
    return gain / (1 - falloff * square), falloff


def dark_effects(current_pA: Floats, hot: NDArray[np.bool_]) -> list[Effect]:
    """Effects whose dark current is distributed as these pixels' (P,); hot ones are a population of their own."""
    law = dark_law(current_pA[~hot])
    effects = [_effect("dark_current", mean_pA=law.first)]
    if law.law == "normal":
        effects.append(_effect("dark_current_spread", sigma_pA=law.second))
    else:
        effects.append(_effect("dark_current_tail", sigma=law.second))
    if np.any(hot):
        extra = float(np.mean(current_pA[hot] - law.first))
        effects.append(_effect("hot_pixels", fraction=float(np.mean(hot)), mean_pA=extra))
    return effects


def _effect(name: str, **parameters: float) -> Effect:
    return build(CATALOGUE, name, parameters)
