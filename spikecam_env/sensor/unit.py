"""One camera: its fixed pattern drawn, each pixel reduced to the numbers of the firing law.

charge of a frame = gain * radiance + dark [thresholds]; it fires at 1 (1 + kappa n), n ~ N(0, 1) drawn at each reset;
with shot noise the charge arrives as a Poisson stream of `electrons` to a threshold.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from spikecam_env.errors import InputError
from spikecam_env.sensor.light import GRAINS
from spikecam_env.sensor.ranges import check_parameters, parameter
from spikecam_env.types import Floats, Pictures

ELEMENTARY_CHARGE_C = 1.602176634e-19
BOLTZMANN_J_PER_K = 1.380649e-23

SWING_V = (0.05, 20.0)
"""Lowest and highest swing of a circuit.  Below, a comparator's own offset (published spread 49.7 mV) is the swing."""

LEAST_SHARE = 0.01
"""Smallest swing or capacitance of a pixel over nominal, whatever the spread."""

MOST_SPREAD = 0.5
"""Largest standard deviation over pixels of swing or capacitance over nominal: one pixel in forty is then at none."""

MOST_KAPPA = 0.25
"""Largest reset noise over the swing: a threshold, a charge, is negative from four standard deviations on."""

FEWEST_ELECTRONS = 1.0
"""Electrons to a threshold, at least."""


@dataclass(frozen=True)
class Circuit:
    """The nominal pixel circuit, paper (6) and (12).

    Threshold phi = C (V_D - V_ref + V_bias).  Defaults: the public SCSim script's constants.

    Raises:
        InputError: for a value outside its range, and for a swing outside SWING_V.

    Example:
        >>> circuit = Circuit()
        >>> round(circuit.swing_V, 4), round(circuit.threshold_electrons)
        (1.0924, 29646)
    """

    reset_V: float = parameter(3.3, unit="V", bounds=(-20.0, 20.0), doc="voltage that a reset leaves")
    reference_V: float = parameter(2.2, unit="V", bounds=(-20.0, 20.0), doc="voltage at which the comparator trips")
    bias_V: float = parameter(-0.0076, unit="V", bounds=(-5.0, 5.0), doc="mean bias of the comparators")
    capacitance_fF: float = parameter(4.348, unit="fF", bounds=(0.01, 1e5), doc="capacitance that light discharges")
    temperature_K: float = parameter(300.0, unit="K", bounds=(1.0, 1000.0), doc="temperature of the array")

    def __post_init__(self) -> None:
        check_parameters(self, "circuit")
        if not SWING_V[0] <= self.swing_V <= SWING_V[1]:
            raise InputError(
                f"circuit: the swing reset_V - reference_V + bias_V = {self.reset_V:g} - {self.reference_V:g} + "
                f"{self.bias_V:g} = {self.swing_V:g} V is outside {SWING_V[0]:g} .. {SWING_V[1]:g} V"
            )

    @property
    def swing_V(self) -> float:
        """Voltage between reset and comparator reference, with the mean bias."""
        return self.reset_V - self.reference_V + self.bias_V

    @property
    def threshold_electrons(self) -> float:
        """Electrons that discharge the nominal pixel from reset to reference: N = C V / q."""
        return self.capacitance_fF * 1e-15 * self.swing_V / ELEMENTARY_CHARGE_C

    @property
    def thermal_noise_mV(self) -> float:
        """kTC noise of a reset, sqrt(kT/C), paper (7)."""
        return 1e3 * float(np.sqrt(BOLTZMANN_J_PER_K * self.temperature_K / (self.capacitance_fF * 1e-15)))


_OF_SWINGS = "the spread of swings over pixels (bias_voltage_spread, row_fixed_pattern, column_fixed_pattern)"
_OF_CAPACITANCES = "the spread of capacitances over pixels (capacitor_spread)"
_OF_RESETS = "the noise of a reset (reset_noise, excess_threshold_noise)"


@dataclass(frozen=True)
class PixelArray:
    """The array in circuit units, as the effects leave their fixed pattern on it; arrays are (H, W) float64."""

    circuit: Circuit
    frame_rate_hz: float
    gain: Floats
    dark_current_pA: Floats
    capacitance_fF: Floats
    swing_V: Floats
    reset_noise_mV: float = 0.0
    quanta: float = 0.0
    dark_is_noisy: bool = True
    swing_spread_V: float = 0.0
    """Standard deviation over pixels by the effects so far."""
    capacitance_spread_fF: float = 0.0
    """As swing_spread_V."""

    @classmethod
    def nominal(cls, circuit: Circuit, frame_rate_hz: float, shape: tuple[int, int]) -> PixelArray:
        """Every pixel alike, no noise."""
        full = np.full
        return cls(
            circuit,
            frame_rate_hz,
            gain=full(shape, 1.0),
            dark_current_pA=full(shape, 0.0),
            capacitance_fF=full(shape, circuit.capacitance_fF),
            swing_V=full(shape, circuit.swing_V),
        )

    def check(self) -> None:
        """Raise InputError where the effects together leave no sensor, whatever the pixels draw."""
        swing_V, capacitance_fF = self.circuit.swing_V, self.circuit.capacitance_fF
        for name, value, share, whole, unit, of in (
            (_OF_SWINGS, self.swing_spread_V, MOST_SPREAD, swing_V, "V", "the swing"),
            (_OF_CAPACITANCES, self.capacitance_spread_fF, MOST_SPREAD, capacitance_fF, "fF", "circuit.capacitance_fF"),
            (_OF_RESETS, self.reset_noise_mV, MOST_KAPPA, 1e3 * swing_V, "mV", "the swing"),
        ):
            most = share * whole
            if value > most * (1.0 + 1e-9):
                raise InputError(
                    f"{name} is {value:g} {unit}; at most {most:g} {unit}, {share:g} of {of}; "
                    "lower the one or raise the other"
                )

    def with_swings_off(self, sigma_V: float, normal: Floats) -> PixelArray:
        """Swings off by sigma_V times normal numbers, (H, W) or broadcast to it; each keeps LEAST_SHARE of nominal."""
        swing = np.maximum(self.swing_V + sigma_V * normal, LEAST_SHARE * self.circuit.swing_V)
        return replace(self, swing_V=swing, swing_spread_V=math.hypot(self.swing_spread_V, sigma_V))

    def with_capacitances_off(self, sigma_fF: float, normal: Floats) -> PixelArray:
        """Capacitances off by sigma_fF times normal numbers (H, W); each keeps LEAST_SHARE of nominal."""
        capacitance = np.maximum(self.capacitance_fF + sigma_fF * normal, LEAST_SHARE * self.circuit.capacitance_fF)
        spread = math.hypot(self.capacitance_spread_fF, sigma_fF)
        return replace(self, capacitance_fF=capacitance, capacitance_spread_fF=spread)

    def with_reset_noise(self, sigma_mV: float) -> PixelArray:
        """More noise of a reset: variances add."""
        return replace(self, reset_noise_mV=math.hypot(self.reset_noise_mV, sigma_mV))


UNIT_RANGES = {
    "gain": (0.0, 1e30),
    "dark": (0.0, 1e30),
    "electrons": (FEWEST_ELECTRONS, 1e15),
    "kappa": (0.0, MOST_KAPPA),
    "swing_V": (1e-6, 1e3),
    "threshold_fC": (1e-9, 1e9),
}
"""Lowest and highest value of a pixel in a unit.  Light is capped at two thresholds a frame, so gain and dark need only
stay finite in single precision."""


@dataclass(frozen=True)
class Unit:
    """The firing law of every pixel; arrays are (H*W,) float64.

    Example:
        >>> SensorModel.preset("ideal").draw_unit((1, 2), seed=0).gain.tolist()
        [1.0, 1.0]
        >>> bool(SensorModel.preset("scsim").draw_unit((1, 2), seed=0).shot)
        True
    """

    gain: Floats
    """Thresholds a frame at radiance 1."""
    dark: Floats
    """Thresholds a frame."""
    electrons: Floats
    """Electrons to a threshold."""
    kappa: Floats
    """Relative standard deviation of the threshold, drawn at each reset."""
    swing_V: Floats
    """Voltage from reset to reference."""
    threshold_fC: Floats
    """Charge of a threshold."""
    shot: bool
    """Whether charge is Poisson."""
    dark_is_noisy: bool
    """Whether dark charge is Poisson too."""

    def owned(self) -> Unit:
        """This unit with read-only arrays, copied where somebody may change them in place."""
        arrays = {name: getattr(self, name) for name in UNIT_RANGES}
        copies: dict[str, Any] = {
            name: np.array(array, dtype=np.float64) for name, array in arrays.items() if not _is_own(array)
        }
        for copy in copies.values():
            copy.flags.writeable = False
        return replace(self, **copies) if copies else self

    def limited(self) -> Unit:
        """This unit with electrons and kappa cut to UNIT_RANGES, which single pixels of a spread may exceed."""
        within: dict[str, Any] = {
            name: np.clip(getattr(self, name), *UNIT_RANGES[name]) for name in ("electrons", "kappa")
        }
        return replace(self, **within)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of all fields."""
        sha = hashlib.sha256()
        for f in fields(self):
            sha.update(np.ascontiguousarray(getattr(self, f.name)).tobytes())
        return sha.hexdigest()

    @property
    def grains_per_frame(self) -> tuple[Pictures, Pictures]:
        """Gain and dark in the light law's unit, (P,) float32 each."""
        return (self.gain * GRAINS).astype(np.float32), (self.dark * GRAINS).astype(np.float32)


def _is_own(array: Floats) -> bool:
    """Whether nobody can change an array: read-only, and no view of another."""
    return isinstance(array, np.ndarray) and not array.flags.writeable and array.base is None


def firing_law(pixels: PixelArray) -> Unit:
    """Reduce circuit units to thresholds: phi = (C + C_S)(V_d + V_S), paper (12)."""
    nominal_fC = pixels.circuit.capacitance_fF * pixels.circuit.swing_V
    threshold_fC = pixels.capacitance_fF * pixels.swing_V
    dark_fC_per_frame = pixels.dark_current_pA * 1e3 / pixels.frame_rate_hz
    quanta = pixels.quanta if pixels.quanta > 0 else pixels.circuit.threshold_electrons
    return Unit(
        gain=(pixels.gain * nominal_fC / threshold_fC).reshape(-1),
        dark=(dark_fC_per_frame / threshold_fC).reshape(-1),
        electrons=(quanta * threshold_fC / nominal_fC).reshape(-1),
        kappa=(1e-3 * pixels.reset_noise_mV / pixels.swing_V).reshape(-1),
        swing_V=pixels.swing_V.reshape(-1),
        threshold_fC=threshold_fC.reshape(-1),
        shot=pixels.quanta > 0,
        dark_is_noisy=pixels.dark_is_noisy,
    ).limited()
