"""From a refit to a unit that can be simulated, and from a drawn unit to the refit that is without error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from spikecam_env.gap.unit.refit import NOISE, BaseFit
from spikecam_env.gap.unit.traps import less_traps
from spikecam_env.sensor import SensorModel
from spikecam_env.sensor.unit import PixelArray, Unit, firing_law
from spikecam_env.types import Floats

LINES = {"row_fixed_pattern": 1, "column_fixed_pattern": 0}
"""Offsets of the swing by row and column, and the axis along which they are the same: they change how noisy pixels are,
too, and not the pattern alone."""


def unit_from_refit(model: SensorModel, base: BaseFit, shape: tuple[int, int]) -> Unit:
    """The unit to simulate: N of the model, and the rest of s^2 as reset noise; an s^2 below 1/N is all shot noise.

    Both follow a pixel's swing, estimated from its response: N = N0 swing, kappa = sigma / swing.

    Args:
        model: its effects give N and the share of bias in the pattern.
        base: the refit.
        shape: (rows, columns).
    """
    nominal = PixelArray.nominal(model.circuit, model.frame_rate_hz, shape)
    names = {e.name: e for e in model.effects}
    for name in NOISE:
        if name in names:
            nominal = names[name].imprint(nominal, np.random.default_rng(0))
    law = firing_law(nominal)
    shot = law.shot and base.white > 0
    inverse = 1.0 / law.electrons[0] if shot else 0.0
    if "reset_noise" not in names and "excess_threshold_noise" not in names:
        inverse = base.white if shot else 0.0
    inverse = min(inverse, base.white)
    swing = _swings(model, base.gain, shape)
    reset = max(base.white - inverse, 0.0)
    more = np.mean(inverse / swing + reset / swing**2) / base.white if base.white > 0 else 1.0
    electrons = swing * more / inverse if inverse > 0 else law.electrons
    kappa = np.sqrt(reset / more) / swing
    dark = less_traps(model, law, base.dark)
    return replace(law, gain=base.gain, dark=dark, electrons=electrons, kappa=kappa,
                   swing_V=law.swing_V * swing, shot=inverse > 0).limited()  # fmt: skip


def exact_refit(unit: Unit) -> BaseFit:
    """A drawn unit in the refit's terms: the result of a refit without error."""
    white = float(np.mean((1 / unit.electrons if unit.shot else 0.0) + unit.kappa**2))
    zero = np.zeros_like(unit.gain)
    return BaseFit(unit.gain, unit.dark, zero, zero, white, np.zeros((0, unit.gain.size)), unit.gain > 0)


def _swings(model: SensorModel, gain: Floats, shape: tuple[int, int]) -> Floats:
    """(P,) swing of each pixel over nominal, estimated from its response.

    A share of the model's spread between pixels is their bias: a slow pixel has a large swing, for which a millivolt is
    less.  The common factor of a row or column is its offset, where the model has one, and a matter of swing alone.
    """
    usual = float(np.median(gain))
    if usual <= 0:
        return np.ones_like(gain)
    names = {e.name for e in model.effects}
    own, lines = (gain / usual).reshape(shape), np.ones(shape)
    for name, along in LINES.items():
        if name in names:
            line = np.median(own, axis=along, keepdims=True)
            own, lines = own / np.maximum(line, 1e-9), lines * line
    return np.asarray(np.clip(lines, 0.5, 2.0) ** -1 * np.clip(own, 0.5, 2.0) ** -_share_of_bias(model)).reshape(-1)


def _share_of_bias(model: SensorModel) -> float:
    """Share of bias in the variance of pixels' response, rows and columns apart."""
    circuit, spreads = model.circuit, {e.name: e.parameters() for e in model.effects}
    bias = spreads.get("bias_voltage_spread", {}).get("sigma_V", 0.0) / circuit.swing_V
    others = np.hypot(
        spreads.get("conversion_gain_spread", {}).get("sigma", 0.0),
        spreads.get("capacitor_spread", {}).get("sigma_fF", 0.0) / circuit.capacitance_fF,
    )
    return float(bias**2 / (bias**2 + others**2)) if bias > 0 else 0.0
