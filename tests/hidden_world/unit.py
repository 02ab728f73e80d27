"""One camera of the hidden world: its own parameters, its own fixed patterns.

    phi = C V,  C = C0 + C_S,  V = 1.1 V + bias + V_S;   x = G L phi0/phi + I dt/phi;  N = N0 phi/phi0;  kappa = sigma/V

Published spreads, each off by 5 to 20 % in a unit; a pattern's shape is not always Gaussian (`PATTERNS`).  Where the
charge scale is first principles (`physical`), N and the reset noise follow from this unit's own C, V and temperature.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FRAME_S = 25e-6
ELECTRON_C = 1.602176634e-19
BOLTZMANN = 1.380649e-23
SWING_V = 1.1 - 0.0076
CAPACITANCE_FF = 4.348


@dataclass(frozen=True)
class Base:
    """A kind of camera.  electrons: to a nominal threshold (None: C V / q; 0: no shot noise).

    reset_mv: threshold noise of a reset (None: sqrt(kT/C)).  The rest: pA, fF, V, relative.
    """

    electrons: float | None
    reset_mv: float | None
    dark_pa: float = 0.4442
    dark_sd_pa: float = 0.1731
    gain_sd: float = 0.0584 / 1.0128
    capacitance_sd_ff: float = 0.0128
    bias_sd_v: float = 0.0497


BASES = {"scsim": Base(5e4, 6.36), "physical": Base(None, None), "ideal": Base(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)}

PATTERNS: dict[str, Callable[[np.random.Generator, tuple[int, ...]], Array]] = {
    "normal": lambda rng, shape: rng.standard_normal(shape),
    "sum of uniforms": lambda rng, shape: (rng.random((8, *shape)).sum(axis=0) - 4.0) * np.sqrt(12.0 / 8.0),
    "student": lambda rng, shape: rng.standard_t(40, shape) * np.sqrt(38.0 / 40.0),
    "two waferfuls": lambda rng, shape: (
        np.where(rng.random(shape) < 0.5, 0.3, -0.3) + np.sqrt(1 - 0.09) * rng.standard_normal(shape)
    ),
}
"""Shapes of mean 0, variance 1 and excess kurtosis 0, -0.15, +0.17, -0.02."""


@dataclass(frozen=True)
class Camera:
    """A unit.  gain, dark, quiet, kappa, per_mv: (rows, columns), as in `integrator.Physics`.

    drawn: parameters of this unit, for its key.  phi_fc: (rows, columns) threshold [fC].
    """

    shape: tuple[int, int]
    gain: Array
    dark: Array
    quiet: Array
    kappa: Array
    per_mv: Array
    phi_fc: Array
    drawn: dict[str, float | str]

    def charge_of(self, current_pa: float) -> Array:
        """(rows, columns) charge a frame [thresholds] of a current."""
        return current_pa * FRAME_S * 1e3 / self.phi_fc


def draw_camera(base: str, shape: tuple[int, int], rng: np.random.Generator, reset_noise_times: float = 1.0) -> Camera:
    """A unit of its kind; reset_noise_times: a parameter that is wrong, for a trial of it."""
    kind = BASES[base]

    def off(nominal: float) -> float:
        return float(nominal * (1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.20)))

    light, dark_pa, dark_sd = off(1.0), off(kind.dark_pa), off(kind.dark_sd_pa)
    gain_sd, c_sd, v_sd = off(kind.gain_sd), off(kind.capacitance_sd_ff), off(kind.bias_sd_v)
    c0 = off(CAPACITANCE_FF) if kind.electrons is None else CAPACITANCE_FF
    electrons = 1e-15 * c0 * SWING_V / ELECTRON_C if kind.electrons is None else off(kind.electrons)
    reset_mv = (
        1e3 * np.sqrt(BOLTZMANN * rng.uniform(290, 320) / (c0 * 1e-15)) if kind.reset_mv is None else off(kind.reset_mv)
    )
    reset_mv = float(reset_mv) * reset_noise_times
    names = [str(name) for name in rng.choice(list(PATTERNS), 3)]
    shapes = [PATTERNS[name] for name in names]
    swing = SWING_V + v_sd * shapes[0](rng, shape)
    capacitance = c0 * (1.0 + c_sd / CAPACITANCE_FF * shapes[0](rng, shape))
    phi = capacitance * swing
    gain = light * np.maximum(1.0 + gain_sd * shapes[1](rng, shape), 0.0) * c0 * SWING_V / phi
    current = np.maximum(dark_pa + dark_sd * shapes[2](rng, shape), 0.0)
    drawn: dict[str, float | str] = {
        "light": light, "dark_pA": dark_pa, "dark_sd_pA": dark_sd, "gain_sd": gain_sd, "capacitance_fF": c0,
        "capacitance_sd_fF": c_sd, "bias_sd_V": v_sd, "electrons": electrons, "reset_mV": reset_mv,
        "swing pattern": names[0], "gain pattern": names[1], "dark pattern": names[2],
    }  # fmt: skip
    return Camera(
        shape=shape,
        gain=gain,
        dark=current * FRAME_S * 1e3 / phi,
        quiet=np.zeros(shape) if electrons == 0.0 else c0 * SWING_V / (electrons * phi),
        kappa=1e-3 * reset_mv / swing,
        per_mv=1e-3 / swing,
        phi_fc=phi,
        drawn=drawn,
    )
