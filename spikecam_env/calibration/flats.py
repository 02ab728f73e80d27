"""Simulated campaigns of flats: one unit of a model before evenly lit screens, in the dark, at one or two V_d."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from spikecam_env.calibration.campaign import FORMAT, Campaign, read_campaign
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.streams import pack_frames
from spikecam_env.whole import whole_file

_CHUNK = 2_000_000
"""Pixel-frames simulated between two writes [spikes of uint8]."""


def write_flats(
    folder: str | Path,
    model: SensorModel,
    *,
    levels: Sequence[float],
    frames: int | Sequence[int] = 20_000,
    shape: tuple[int, int] = (64, 64),
    seed: int = 0,
    second_v_d: float | None = None,
    engine: str = "auto",
    progress: bool = False,
) -> Campaign:
    """Record flats of one unit into a campaign; a level of 0 is a dark recording.

    levels: radiance of each recording, as its label says.  frames: their lengths, or one for all.
    second_v_d: repeat all levels at this V_D - V_ref [V], same light.  seed: which unit, and its temporal noise.
    """
    levels = [float(level) for level in levels]
    lengths = [frames] * len(levels) if isinstance(frames, int) else list(frames)
    if len(lengths) != len(levels) or not levels:
        raise InputError(f"{len(lengths)} lengths for {len(levels)} levels; give one each, or one for all")
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    voltages = [_v_d(model)] if second_v_d is None else [_v_d(model), second_v_d]
    jobs = [(v_d, i) for v_d in voltages for i in range(len(levels))]
    recordings = []
    for take, (v_d, i) in enumerate(tqdm(jobs, desc="record flats", unit="flat", disable=not progress)):
        name = f"flat-{i:02d}" if levels[i] else f"dark-{i:02d}"
        if v_d != voltages[0]:
            name += f"-at-{v_d:g}V"
        camera = at_v_d(model, v_d)
        scale = model.circuit.swing_V / camera.circuit.swing_V
        light = np.full(shape, levels[i] * scale, np.float32)
        _record(target / f"{name}.dat", SpikeSensor(camera, shape, seed, engine, take=take), light, lengths[i])
        with whole_file(target / f"{name}.npz") as beside, beside.open("wb") as file:
            np.savez(file, frame=np.zeros(1), radiance=np.full((1, 1, 1), levels[i], np.float32))
        recordings.append(_entry(name, lengths[i], v_d, model.circuit.temperature_K))
    data = {
        "format": FORMAT,
        "camera": {"height": shape[0], "width": shape[1], "frame_rate_hz": model.frame_rate_hz},
        "recordings": recordings,
    }
    with whole_file(target / "campaign.json") as beside:
        beside.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    return read_campaign(target)


def at_v_d(model: SensorModel, v_d: float) -> SensorModel:
    """The same camera with its reset voltage set so that V_D - V_ref = v_d [V]: fewer or more electrons a spike."""
    circuit = replace(model.circuit, reset_V=model.circuit.reference_V + v_d)
    if circuit.swing_V <= 0:
        raise InputError(f"v_d = {v_d:g} V with a bias of {circuit.bias_V:g} V leaves no threshold")
    changed = replace(model, circuit=circuit)
    for effect in model.effects:
        if effect.name == "shot_noise":
            quanta = effect.parameters()["quanta"] * circuit.swing_V / model.circuit.swing_V
            changed = changed.with_effect(replace(effect, quanta=quanta))  # type: ignore[call-arg]
    return changed


def _v_d(model: SensorModel) -> float:
    return model.circuit.reset_V - model.circuit.reference_V


def _record(path: Path, sensor: SpikeSensor, light: np.ndarray, frames: int) -> None:
    chunk = max(64, _CHUNK // light.size // 64 * 64)
    with whole_file(path) as beside, beside.open("wb") as file:
        for start in range(0, frames, chunk):
            pack_frames(sensor.step(light, min(chunk, frames - start))).tofile(file)


def _entry(name: str, frames: int, v_d: float, temperature_k: float) -> dict[str, Any]:
    return {
        "name": name,
        "spikes": f"{name}.dat",
        "frames": frames,
        "radiance": f"{name}.npz",
        "use": "fit",
        "v_d": v_d,
        "temperature_k": temperature_k,
    }
