"""One camera: its fixed pattern drawn, each pixel reduced to the numbers of the firing law.

charge of a frame = gain * radiance + dark [thresholds]; it fires at 1 (1 + kappa n), n ~ N(0, 1) drawn at each reset;
with shot noise the charge arrives as a Poisson stream of `electrons` to a threshold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor.light import GRAINS

ELEMENTARY_CHARGE_C = 1.602176634e-19
BOLTZMANN_J_PER_K = 1.380649e-23


@dataclass(frozen=True)
class Circuit:
    """The nominal pixel circuit, paper (6) and (12).

    Threshold phi = C (V_D - V_ref + V_bias).  Defaults: the public SCSim script's constants.
    """

    reset_V: float = 3.3
    reference_V: float = 2.2
    bias_V: float = -0.0076
    capacitance_fF: float = 4.348
    temperature_K: float = 300.0

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


@dataclass(frozen=True)
class PixelArray:
    """The array in circuit units, as the effects leave their fixed pattern on it; arrays are (H, W) float64."""

    circuit: Circuit
    frame_rate_hz: float
    gain: NDArray[np.float64]
    dark_current_pA: NDArray[np.float64]
    capacitance_fF: NDArray[np.float64]
    swing_V: NDArray[np.float64]
    reset_noise_mV: float = 0.0
    quanta: float = 0.0
    dark_is_noisy: bool = True

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


@dataclass(frozen=True)
class Unit:
    """The firing law of every pixel; arrays are (H*W,) float64.

    gain: thresholds a frame at radiance 1.  dark: thresholds a frame.  electrons: electrons to a threshold.
    kappa: relative standard deviation of the threshold, drawn at each reset.  swing_V: voltage from reset to reference.
    threshold_fC: charge of a threshold.
    shot: whether charge is Poisson; dark_is_noisy: whether that holds for dark charge too.
    """

    gain: NDArray[np.float64]
    dark: NDArray[np.float64]
    electrons: NDArray[np.float64]
    kappa: NDArray[np.float64]
    swing_V: NDArray[np.float64]
    threshold_fC: NDArray[np.float64]
    shot: bool
    dark_is_noisy: bool

    @property
    def grains_per_frame(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Gain and dark in the light law's unit, (P,) float32 each."""
        return (self.gain * GRAINS).astype(np.float32), (self.dark * GRAINS).astype(np.float32)


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
    )
