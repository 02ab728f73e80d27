"""The identifiability table of a calibration: identified quantities with 90 % intervals, priors, and the others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from spikecam_env.calibration.population import FLAGS
from spikecam_env.calibration.snee import Z90, Calibration
from spikecam_env.sensor.unit import ELEMENTARY_CHARGE_C

Status = Literal["identified", "assumed", "not identified"]


@dataclass(frozen=True)
class Finding:
    """One line of the identifiability table.

    Example:
        >>> Finding("N", "identified", 29_600.0, 350.0, "electrons a threshold", "two V_d").text
        '2.96e+04 ± 3.5e+02'
    """

    quantity: str
    status: Status
    value: float | None
    half_width: float | None
    """Half-width of the 90 % interval, None where there is none."""
    unit: str
    basis: str
    """The data or the assumption behind it."""

    @property
    def text(self) -> str:
        """The value with its interval."""
        if self.value is None:
            return "-"
        return f"{self.value:.4g}" + (f" ± {self.half_width:.2g}" if self.half_width else "")


def findings(calibration: Calibration) -> list[Finding]:
    """The table, most direct first.

    Example:
        >>> from spikecam_env.sensor import SensorModel
        >>> levels = (0.0, 0.2, 0.5)
        >>> campaign = write_flats("camera", SensorModel.preset("scsim"), levels=levels, frames=400, shape=(8, 8))
        >>> [(finding.quantity, finding.status) for finding in findings(calibrate(campaign))][:2]
        [('alpha/phi, mean', 'identified'), ('alpha/phi, spread', 'identified')]
    """
    return [*_rates(calibration), *_noise(calibration), *_two_v_d(calibration), *_rest(calibration)]


def _rates(c: Calibration) -> list[Finding]:
    main, good = c.main, c.flags == 0
    root = np.sqrt(max(good.sum(), 1))

    def typical(quantity: str, values: np.ndarray, unit: str, basis: str) -> Finding:
        half = Z90 * float(values.std()) / root
        return Finding(quantity, "identified", float(values.mean()), half, unit, basis)

    gain, dark = main.gain[good], main.dark[good]
    each = f"each pixel to ± {Z90 * np.median(main.gain_sd[good]):.2g} (median)"
    each_dark = f"each pixel to ± {Z90 * np.median(main.dark_sd[good]):.2g} (median)"
    return [
        typical("alpha/phi, mean", gain, "thresholds/frame at radiance 1", "slope of rate over light; " + each),
        _spread("alpha/phi, spread", gain),
        typical("I_dark/phi, mean", dark, "thresholds/frame", "rate at no light; " + each_dark),
        _spread("I_dark/phi, spread", dark),
    ]


def _spread(quantity: str, values: np.ndarray) -> Finding:
    """Standard deviation over pixels over their mean, unless that is 0."""
    mean = float(values.mean())
    if mean == 0.0:
        return Finding(quantity, "not identified", None, None, "relative", "the mean is 0")
    return Finding(quantity, "identified", float(values.std()) / mean, None, "relative", "over pixels")


def _noise(c: Calibration) -> list[Finding]:
    jitter = c.main.jitter
    if jitter is None or c.charge is None:
        return [Finding("1/N + kappa²", "not identified", None, None, "", "needs spike times")]
    rows = [
        Finding(
            "1/N + kappa²",
            "identified",
            jitter.white,
            Z90 * jitter.white_sd,
            "",
            "k-slope of A_k over all pixels",
        ),
        Finding(
            "slow noise b",
            "identified",
            jitter.slow,
            Z90 * jitter.slow_sd,
            "",
            "k² in A_k" + ("" if jitter.slow_fitted else "; none found, the interval is the limit"),
        ),
    ]
    basis = "two V_d: N goes with the swing, kappa against it"
    if c.charge.prior is not None:
        basis = f"given a reset noise of {c.charge.reset_noise_mV:.3g} mV"
    if np.isfinite(c.charge.electrons):
        half = Z90 * c.charge.electrons_sd
        rows.append(Finding("N", "identified", c.charge.electrons, half, "electrons a threshold", basis))
    else:
        rows.append(Finding("N", "not identified", None, None, "", "all noise is within the assumed reset noise"))
    if c.charge.prior is None:
        half = Z90 * c.charge.reset_noise_sd_mV
        rows.append(Finding("reset noise", "identified", c.charge.reset_noise_mV, half, "mV", basis))
    else:
        rows.append(Finding("reset noise", "assumed", c.charge.reset_noise_mV, None, "mV", "sqrt(kT/C), or as given"))
    return rows


def _two_v_d(c: Calibration) -> list[Finding]:
    if c.swing_V is None or c.swing_sd_V is None or c.main.v_d is None:
        return [Finding("V_S", "not identified", None, None, "V", "one V_d: it is part of alpha/phi and I_dark/phi")]
    good = c.flags == 0
    bias, sd = c.swing_V[good] - c.main.v_d, c.swing_sd_V[good]
    spread = float(np.sqrt(max(bias.var() - np.mean(sd**2), 0.0)))
    root = np.sqrt(good.sum())
    rows = [
        Finding(
            "V_S, mean",
            "identified",
            float(bias.mean()),
            Z90 * float(bias.std()) / root,
            "V",
            "ratio of slopes at two V_d",
        ),
        Finding(
            "V_S, spread",
            "identified",
            spread,
            Z90 * spread / root / np.sqrt(2),
            "V",
            f"over pixels; each to ± {Z90 * np.median(sd):.2g} V",
        ),
    ]
    if c.charge is not None and c.charge.prior is None:
        swing = float(c.swing_V[good].mean())
        capacitance = c.charge.electrons * ELEMENTARY_CHARGE_C / swing * 1e15
        half = Z90 * c.charge.electrons_sd / c.charge.electrons * capacitance
        rows.append(
            Finding("C, mean", "identified", capacitance, half, "fF", "N q / swing, a quantum being an electron")
        )
    return rows


def _rest(c: Calibration) -> list[Finding]:
    flagged = ", ".join(f"{int(np.sum(c.flags & bit > 0))} {name}" for name, bit in FLAGS.items())
    return [
        Finding("C_S and alpha apart", "not identified", None, None, "", "only alpha/(C + C_S) acts on rates"),
        Finding("I_dark in pA", "assumed", None, None, "pA", f"needs C: taken as {c.circuit.capacitance_fF:g} fF"),
        Finding("odd pixels", "identified", float(np.sum(c.flags > 0)), None, "pixels", flagged),
    ]
