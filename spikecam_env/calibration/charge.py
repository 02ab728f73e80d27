"""The absolute scale of charge from temporal noise: s^2 = 1/N + kappa^2, N electrons to a threshold.

One V_d: kappa = sigma_kTC / (V_d + V_S) is prior, N follows.
Two, with swings V_1, V_2 and r = V_1 / V_2: N goes with the swing, kappa against it, so

    s_1^2 = 1/N + kappa^2,  s_2^2 = r/N + r^2 kappa^2

are two equations for two unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.calibration.jitter import Jitter
from spikecam_env.types import Floats


@dataclass(frozen=True)
class ChargeScale:
    """Charge of a threshold and noise of a reset."""

    electrons: float
    """N, electrons to a nominal threshold; inf where the noise is below the assumed reset noise."""
    electrons_sd: float
    """Standard error of `electrons`."""
    reset_noise_mV: float
    """Standard deviation of a reset."""
    reset_noise_sd_mV: float
    """Standard error of `reset_noise_mV`, 0 where it is prior."""
    prior: str | None
    """Name of the field that was assumed."""


def charge_at_one_v_d(jitter: Jitter | None, swing_V: float, reset_noise_mV: float) -> ChargeScale | None:
    """N given the reset noise; None without spike times."""
    if jitter is None:
        return None
    inverse = jitter.white - (1e-3 * reset_noise_mV / swing_V) ** 2
    if inverse <= 0:
        return ChargeScale(np.inf, np.inf, reset_noise_mV, 0.0, "reset_noise_mV")
    return ChargeScale(1 / inverse, jitter.white_sd / inverse**2, reset_noise_mV, 0.0, "reset_noise_mV")


def charge_at_two_v_d(
    one: Jitter | None, other: Jitter | None, swing_V: Floats, other_swing_V: Floats
) -> ChargeScale | None:
    """N of the mean threshold and the reset noise, by two settings.

    Both are scaled pixel by pixel, with the weights of the pooled jitter.  At 0.6 V a spread of V_S of 50 mV adds 2 %
    to the mean of kappa^2.

    Args:
        one: jitter at the first setting.
        other: jitter at the second.
        swing_V: (P,) swings at the first [V], NaN if unknown.
        other_swing_V: (P,) swings at the second.

    Returns:
        The scale; None without spike times, or where the two contradict the law.
    """
    if one is None or other is None:
        return None
    typical = float(np.nanmean(swing_V))
    design = np.array([_mean_scales(one, typical / swing_V), _mean_scales(other, typical / other_swing_V)])
    inverse = np.linalg.inv(design)
    per_electron, kappa2 = inverse @ np.array([one.white, other.white])
    sd_electron, sd_kappa2 = np.sqrt(inverse**2 @ np.array([one.white_sd, other.white_sd]) ** 2)
    if per_electron <= 0:
        return None
    kappa = float(np.sqrt(max(kappa2, 0.0)))
    sd_kappa = float(sd_kappa2 / (2 * kappa) if kappa2 > sd_kappa2 else np.sqrt(sd_kappa2))
    return ChargeScale(
        float(1 / per_electron),
        float(sd_electron / per_electron**2),
        1e3 * kappa * typical,
        1e3 * sd_kappa * typical,
        None,
    )


def _mean_scales(jitter: Jitter, scale: Floats) -> tuple[float, float]:
    known = np.isfinite(scale)
    weight = jitter.weight[known] / jitter.weight[known].sum()
    return float(weight @ scale[known]), float(weight @ scale[known] ** 2)
