"""Simulated campaigns: one unit of a model records several times, each time in known light.

Every recording, or take, has its own starting phase and temporal noise.  The unit, its fixed pattern, is the same.

A folder holds `model.toml` and `simulation.json` from the start: its model, and the plan of its recordings.
Existing recordings of the same settings are kept, so a stopped run goes on where it was; `campaign.json` comes last.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from spikecam_env.campaign.reading import USES, Campaign, read_campaign
from spikecam_env.campaign.writing import finish_campaign, save_light, save_spikes
from spikecam_env.checked import checked_count, checked_seed, checked_shape
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.names import distinct, file_name
from spikecam_env.run_folder import run_folder
from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor
from spikecam_env.streams.packing import packed_bytes
from spikecam_env.types import Spikes
from spikecam_env.untrusted import read_json
from spikecam_env.version import __version__
from spikecam_env.whole import write_text_whole

FORMAT = "spikecam-simulation/1"

_BLOCK = 2_000_000
"""Pixel-frames simulated between two writes [spikes of uint8]."""


@dataclass(frozen=True)
class PlannedRecording:
    """One recording to be made.

    Example:
        >>> from spikecam_env.sensor import Keyframes
        >>> flat = PlannedRecording("flat", Keyframes(np.array([0.0]), np.full((1, 1, 1), 0.25, np.float32)), frames=80)
        >>> flat.use, flat.frames
        ('fit', 80)
    """

    name: str
    """Of its files."""
    light: Keyframes
    """Radiance (K, H, W), or broadcast to it."""
    frames: int
    use: str = "fit"
    """fit or holdout."""
    v_d: float | None = None
    """V_D - V_ref [V]; None is the model's own, at which light of 1.0 makes the nominal pixel fire once a frame."""
    note: str = ""


def record_takes(
    folder: str | Path,
    model: SensorModel,
    takes: Sequence[PlannedRecording],
    *,
    shape: tuple[int, int],
    seed: int = 0,
    engine: str = "auto",
    progress: bool = False,
) -> Campaign:
    """Record takes of unit `seed` of a model into a campaign, and read it back.

    Same arguments, same bytes.  A folder that a stopped run left unfinished is completed; a finished campaign of the
    same settings is returned as it is.

    Args:
        folder: new, empty, or of the same settings.
        model: of the camera.
        takes: recordings to make.
        shape: (rows, columns).
        seed: of the unit and of all noise.
        engine: as of `SpikeSensor`.
        progress: show a bar.

    Raises:
        InputError: for no takes, repeated or bad names, an unknown use, light of another shape, or a v_d that leaves
            no threshold; and for a folder of other settings, or of a run at work.

    Example:
        >>> from spikecam_env.sensor import Keyframes, SensorModel
        >>> light = Keyframes(np.array([0.0]), np.full((1, 1, 1), 0.25, np.float32))
        >>> flats = [PlannedRecording("flat", light, 80)]
        >>> campaign = record_takes("camera", SensorModel.preset("ideal"), flats, shape=(2, 4))
        >>> int(campaign.recordings[0].load().sum())
        160
    """
    shape, seed = checked_shape(shape), checked_seed(seed)
    _check(takes, shape)
    target = Path(folder)
    plan = _plan(takes, shape, seed, engine)
    if os.path.exists(target / "campaign.json"):
        if _same_simulation(target, model, plan):
            return read_campaign(target)
        raise InputError(f"{target} holds a campaign already; remove it or choose another folder")
    cameras = {v_d: _camera(model, v_d) for v_d in dict.fromkeys(take.v_d for take in takes)}
    with (
        run_folder(target, "a campaign"),
        tqdm(total=sum(take.frames for take in takes), unit="frame", disable=not progress) as bar,
    ):
        _claim(target, model, plan)
        for number, take in enumerate(takes):
            bar.set_description(f"record {take.name}")
            stream = target / f"{take.name}.dat"
            if stream.is_file() and stream.stat().st_size == take.frames * packed_bytes(shape):
                bar.update(take.frames)
                continue
            camera = cameras[take.v_d]
            save_light(target / f"{take.name}.npz", take.light)
            sensor = SpikeSensor(camera, shape, seed, engine, take=number)
            save_spikes(stream, _stream(sensor, take, _light_scale(model, camera), bar))
        entries = [_entry(take, model) for take in takes]
        return finish_campaign(target, shape, model.frame_rate_hz, entries)


def at_v_d(model: SensorModel, v_d: float) -> SensorModel:
    """The same camera with its reset voltage set so that V_D - V_ref = v_d [V]: fewer or more electrons a spike.

    Example:
        >>> from spikecam_env.sensor import SensorModel
        >>> round(at_v_d(SensorModel.preset("scsim"), 0.9).circuit.reset_V, 3)
        3.1
    """
    try:
        circuit = replace(model.circuit, reset_V=model.circuit.reference_V + v_d)
    except InputError as error:
        bias_V = model.circuit.bias_V
        raise InputError(f"v_d = {v_d:g} V with a bias of {bias_V:g} V leaves no threshold ({error})") from error
    changed = replace(model, circuit=circuit)
    for effect in model.effects:
        if effect.name == "shot_noise":
            quanta = effect.parameters()["quanta"] * circuit.swing_V / model.circuit.swing_V
            changed = changed.with_effect(replace(effect, quanta=quanta))  # type: ignore[call-arg]
    return changed


def own_v_d(model: SensorModel) -> float:
    """V_D - V_ref of the model's circuit [V]."""
    return model.circuit.reset_V - model.circuit.reference_V


def light_during(light: Keyframes, start: int, stop: int, shape: tuple[int, int], scale: float = 1.0) -> Keyframes:
    """The keys that frames [start, stop) see, scaled and broadcast to (k, H, W); a cut changes no bit of a stream."""
    first = max(int(np.searchsorted(light.frame, start, side="right")) - 1, 0)
    last = max(int(np.searchsorted(light.frame, stop, side="left")), first)
    radiance = light.radiance[first : last + 1] * np.float32(scale)
    return Keyframes(light.frame[first : last + 1], np.broadcast_to(radiance, (len(radiance), *shape)))


def _stream(sensor: SpikeSensor, take: PlannedRecording, scale: float, bar: tqdm) -> Iterator[Spikes]:
    block = max(64, _BLOCK // (sensor.shape[0] * sensor.shape[1]) // 64 * 64)
    for start in range(0, take.frames, block):
        count = min(block, take.frames - start)
        yield sensor.step(light_during(take.light, start, start + count, sensor.shape, scale), count)
        bar.update(count)


def _camera(model: SensorModel, v_d: float | None) -> SensorModel:
    return model if v_d is None or np.isclose(v_d, own_v_d(model), rtol=1e-9) else at_v_d(model, v_d)


def _light_scale(model: SensorModel, camera: SensorModel) -> float:
    """Radiance in the camera's unit of radiance 1 in the model's: a lower threshold is filled by less light."""
    return model.circuit.swing_V / camera.circuit.swing_V


def _entry(take: PlannedRecording, model: SensorModel) -> dict[str, Any]:
    return {
        "name": take.name,
        "spikes": f"{take.name}.dat",
        "frames": take.frames,
        "radiance": f"{take.name}.npz",
        "use": take.use,
        "v_d": own_v_d(model) if take.v_d is None else take.v_d,
        "temperature_k": model.circuit.temperature_K,
        "note": take.note,
    }


def _check(takes: Sequence[PlannedRecording], shape: tuple[int, int]) -> None:
    if not takes:
        raise InputError("a campaign needs at least one recording; give some")
    distinct((file_name(take.name, "recording name") for take in takes), "recording")
    for take in takes:
        if take.use not in USES:
            raise unknown_name(f"use of recording {take.name!r}", take.use, USES)
        checked_count(take.frames)
        size = take.light.radiance.shape[1:]
        if not all(n in (1, m) for n, m in zip(size, shape, strict=True)):
            raise InputError(
                f"recording {take.name!r}: its light is {size} pixels, the camera {shape}; "
                "it must be that size, or 1 along an axis on which it is even"
            )


def _plan(takes: Sequence[PlannedRecording], shape: tuple[int, int], seed: int, engine: str) -> dict[str, Any]:
    """All that the bytes depend on besides the model, as JSON has it."""
    described = [
        {"name": t.name, "frames": t.frames, "use": t.use, "v_d": t.v_d, "note": t.note, "light": _digest(t.light)}
        for t in takes
    ]
    return {
        "format": FORMAT,
        "package_version": __version__,
        "shape": list(shape),
        "seed": seed,
        "engine": engine,
        "recordings": described,
    }


def _digest(light: Keyframes) -> str:
    digest = hashlib.sha256(repr(light.radiance.shape).encode())
    digest.update(light.frame.tobytes())
    digest.update(light.radiance.tobytes())
    return digest.hexdigest()[:16]


def _claim(target: Path, model: SensorModel, plan: dict[str, Any]) -> None:
    """Mark the folder as the recording of this plan; raises InputError where it is that of another."""
    if (target / "simulation.json").exists():
        if not _same_simulation(target, model, plan):
            raise InputError(
                f"{target} holds an unfinished campaign of other settings; remove it or choose another folder"
            )
        return
    model.to_toml(target / "model.toml")
    write_text_whole(target / "simulation.json", json.dumps(plan, indent=1) + "\n")


def _same_simulation(target: Path, model: SensorModel, plan: dict[str, Any]) -> bool:
    try:
        return bool(
            read_json(target / "simulation.json") == plan and SensorModel.from_toml(target / "model.toml") == model
        )
    except InputError:
        return False
