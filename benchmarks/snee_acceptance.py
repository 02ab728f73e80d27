"""SNEE on simulated units it does not know: errors beside the best possible, N, V_S, coverage, time.

python -m benchmarks.snee_acceptance            25 levels, 64 x 64, 20 000 frames each; about three minutes
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from spikecam_env.calibration import Calibration, calibrate, write_flats
from spikecam_env.calibration.response import SATURATION, best_possible
from spikecam_env.calibration.snee import Z90, Setting
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.sensor.effects.dead_pixels import DeadPixels
from spikecam_env.sensor.effects.hot_pixels import HotPixels


@dataclass(frozen=True)
class AcceptanceCase:
    """A unit and its campaign.  unit_seed: the calibration is told neither it nor the model."""

    name: str
    model: SensorModel
    levels: tuple[float, ...]
    second_v_d: float | None = None
    unit_seed: int = 11
    reset_noise_mV: float | None = None


def cases() -> list[AcceptanceCase]:
    """The issue's: a plain unit, one with a second V_d, one with dead and hot pixels and two saturated levels."""
    physical = SensorModel.preset("physical")
    levels = tuple(np.linspace(0.0, 0.75, 25).round(4).tolist())
    odd = physical.with_effect(HotPixels(fraction=0.005, mean_pA=10.0))
    odd = odd.with_effect(DeadPixels(fraction=0.005))
    return [
        AcceptanceCase("physical, one V_d", physical, levels),
        AcceptanceCase("physical, two V_d", physical, levels, second_v_d=0.7),
        AcceptanceCase("scsim, reset noise given", SensorModel.preset("scsim"), levels, reset_noise_mV=6.36),
        AcceptanceCase("dead, hot, two saturated", odd, (*levels[:23], 1.3, 1.6)),
    ]


def judged(case: AcceptanceCase, calibration: Calibration, shape: tuple[int, int], frames: int) -> dict[str, float]:
    """Errors against the truth that the simulation knows."""
    unit = SpikeSensor(case.model, shape, case.unit_seed).unit
    regular = calibration.flags.reshape(-1) == 0
    main = next(s for s in calibration.settings if s.v_d is None or abs(s.v_d - 1.1) < 1e-6)
    light = np.repeat(np.array(case.levels)[:, None], unit.gain.size, axis=1)
    light = np.where(unit.gain * light + unit.dark > SATURATION, 10.0, light)
    white = 1 / unit.electrons + unit.kappa**2
    bounds = best_possible(unit.gain, unit.dark, light, np.full(len(case.levels), float(frames)), white)
    row: dict[str, float] = {}
    for name, truth, bound in zip(("gain", "dark"), (unit.gain, unit.dark), bounds, strict=True):
        row |= _line(name, main, truth, bound, regular)
    true_electrons = float(unit.electrons[regular].mean())
    if calibration.charge is not None:
        row["N off"] = calibration.charge.electrons / true_electrons - 1
        row["reset noise [mV]"] = calibration.charge.reset_noise_mV
    if calibration.swing_V is not None:
        swing = calibration.swing_V.reshape(-1)[regular]
        row["V_S spread off"] = float(swing.std() / unit.swing_V[regular].std() - 1)
        row["V_S rms error [mV]"] = 1e3 * float(np.sqrt(np.mean((swing - unit.swing_V[regular]) ** 2)))
    row["odd pixels"] = float(np.sum(~regular))
    row["dead found"] = float(np.sum((calibration.flags.reshape(-1) & 2 > 0) & (unit.gain == 0)))
    row["dead"] = float(np.sum(unit.gain == 0))
    return row


def _line(name: str, setting: Setting, truth: np.ndarray, bound: np.ndarray, regular: np.ndarray) -> dict[str, float]:
    error = (getattr(setting, name).reshape(-1) - truth)[regular]
    sd = getattr(setting, f"{name}_sd").reshape(-1)[regular]
    best = bound[regular]
    return {
        f"{name} rms error": float(np.sqrt(np.mean(error**2))),
        f"{name} best possible": float(np.sqrt(np.mean(best**2))),
        f"{name} ratio": float(np.sqrt(np.mean(error**2) / np.mean(best**2))),
        f"{name} ratio per pixel": float(np.sqrt(np.mean((error / best) ** 2))),
        f"{name} 90 % covers": float(np.mean(np.abs(error) < Z90 * sd)),
    }


def main(size: int = 64, frames: int = 20_000) -> None:
    """Print one block a case."""
    for case in cases():
        with tempfile.TemporaryDirectory() as folder:
            campaign = write_flats(
                Path(folder) / "campaign",
                case.model,
                levels=case.levels,
                frames=frames,
                shape=(size, size),
                seed=case.unit_seed,
                second_v_d=case.second_v_d,
                progress=True,
            )
            start = time.perf_counter()
            calibration = calibrate(campaign, reset_noise_mV=case.reset_noise_mV)
            elapsed = time.perf_counter() - start
        print(f"\n{case.name}: {len(campaign.recordings)} recordings of {size} x {size} x {frames}, {elapsed:.1f} s")
        for name, value in judged(case, calibration, (size, size), frames).items():
            print(f"  {name:24s}{value:12.5g}")
        for warning in calibration.warnings:
            print(f"  note: {warning}")


if __name__ == "__main__":
    tyro.cli(main)
