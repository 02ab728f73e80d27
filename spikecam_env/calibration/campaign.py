"""A measurement campaign: a folder of recordings with what the camera was shown, read and checked.

campaign.json, format `spikecam-campaign/1` (docs/calibration.md):

    {"format": "spikecam-campaign/1",
     "camera": {"height": 64, "width": 64, "frame_rate_hz": 40000.0},
     "recordings": [{"name": "flat-120", "spikes": "flat-120.dat", "frames": 8000, "radiance": "flat-120.npz",
                     "use": "fit", "v_d": 1.1, "temperature_k": 300.0, "note": ""}]}

spikes: `.dat`, unflipped.  radiance: npz with `frame` (K,) and `radiance` (K, H, W) or broadcastable, linear between
keys; null = an unknown static scene.  Instead of spikes, rates: npz with `rate` (H, W) [spikes/frame] and `frames`.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError, unknown_name
from spikecam_env.sensor import Keyframes
from spikecam_env.streams import load_vidar_dat
from spikecam_env.streams.packing import packed_bytes

FORMAT = "spikecam-campaign/1"
USES = ("fit", "holdout")
_ENTRIES = ("name", "spikes", "rates", "frames", "radiance", "use", "v_d", "temperature_k", "note")


@dataclass(frozen=True)
class CampaignRecording:
    """One recording: a stream of spikes in a file, or only the rates of its pixels.

    frames: length.  spikes, rates: one of them is a path.  radiance: path, or None for an unknown static scene.
    v_d: V_D - V_ref [V] at which it was taken, or None.  temperature_k: [K], or None.
    """

    name: str
    shape: tuple[int, int]
    frames: int
    spikes: Path | None
    rates: Path | None
    radiance: Path | None
    use: str = "fit"
    v_d: float | None = None
    temperature_k: float | None = None
    note: str = ""

    def light(self) -> Keyframes | None:
        """What the camera was shown; None where that is unknown."""
        if self.radiance is None:
            return None
        arrays = _read_npz(self.radiance, ("frame", "radiance"), self.name)
        frame, radiance = np.atleast_1d(arrays["frame"]), arrays["radiance"]
        try:
            shown = np.broadcast_to(radiance.astype(np.float32), (frame.size, *self.shape))
            return Keyframes(frame.astype(np.float64), shown)
        except ValueError as error:
            raise InputError(
                f"recording {self.name!r}: {self.radiance.name} holds frame {frame.shape}, radiance {radiance.shape}, "
                f"unusable for {self.shape} pixels: {error}"
            ) from error

    def static_radiance(self) -> NDArray[np.float64] | None:
        """(H, W) radiance, or None where it is unknown or changes during the recording."""
        light = self.light()
        if light is None or np.any(light.radiance != light.radiance[0]):
            return None
        return light.radiance[0].astype(np.float64)

    def packed(self) -> NDArray[np.uint8]:
        """(frames, ceil(H W / 8)) uint8 bits of the stream, mapped from the file; raises InputError for rates only."""
        return np.memmap(self._stream(), np.uint8, "r", shape=(self.frames, packed_bytes(self.shape)))

    def load(self) -> NDArray[np.uint8]:
        """(frames, H, W) uint8 spikes; raises InputError for rates only."""
        return load_vidar_dat(self._stream(), height=self.shape[0], width=self.shape[1])

    def rate(self) -> NDArray[np.float64]:
        """(H, W) measured rates of a recording that is rates only [spikes/frame]."""
        if self.rates is None:
            raise InputError(f"recording {self.name!r} is a stream of spikes; read it with load() or packed()")
        return _read_rates(self.rates, self.name, self.shape)[0]

    def _stream(self) -> Path:
        if self.spikes is None:
            raise InputError(f"recording {self.name!r} holds rates only; its spikes are not there")
        return self.spikes


@dataclass(frozen=True)
class Campaign:
    """A folder of recordings of one camera; `read_campaign` makes it."""

    folder: Path
    shape: tuple[int, int]
    frame_rate_hz: float
    recordings: tuple[CampaignRecording, ...]


def read_campaign(folder: str | Path) -> Campaign:
    """Read and check a campaign; raises InputError that names the recording for anything missing or contradictory."""
    root = Path(folder)
    try:
        data = json.loads((root / "campaign.json").read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{root} is no campaign: cannot read its campaign.json ({error.strerror})") from error
    except ValueError as error:
        raise InputError(f"{root / 'campaign.json'} is not JSON: {error}") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        found = data.get("format") if isinstance(data, dict) else type(data).__name__
        raise InputError(f"{root / 'campaign.json'}: format is {found!r}, expected {FORMAT!r}")
    shape, frame_rate_hz = _camera(data.get("camera"))
    entries = data.get("recordings")
    if not isinstance(entries, list) or not entries:
        raise InputError(f"{root / 'campaign.json'} lists no recordings")
    recordings = tuple(_recording(root, shape, entry) for entry in entries)
    names = [r.name for r in recordings]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"recording {name!r} is listed {names.count(name)} times; names must differ")
    return Campaign(root, shape, frame_rate_hz, recordings)


def _camera(camera: Any) -> tuple[tuple[int, int], float]:
    if not isinstance(camera, Mapping):
        raise InputError("campaign.json needs a camera: height, width and frame_rate_hz")
    height, width = (_positive(camera.get(key), f"camera.{key}", whole=True) for key in ("height", "width"))
    return (int(height), int(width)), _positive(camera.get("frame_rate_hz"), "camera.frame_rate_hz")


def _recording(root: Path, shape: tuple[int, int], entry: Any) -> CampaignRecording:
    if not isinstance(entry, Mapping) or not isinstance(entry.get("name"), str):
        raise InputError(f"campaign.json: recording {entry!r} has no name")
    name = entry["name"]
    for key in entry:
        if key not in _ENTRIES:
            raise unknown_name(f"entry of recording {name!r}", key, _ENTRIES)
    use = entry.get("use", "fit")
    if use not in USES:
        raise unknown_name(f"use of recording {name!r}", use, USES)
    spikes, rates, radiance = (_file(root, name, key, entry.get(key)) for key in ("spikes", "rates", "radiance"))
    if (spikes is None) == (rates is None):
        raise InputError(f"recording {name!r} needs either spikes (a .dat) or rates (an .npz)")
    if rates is not None:
        frames = _read_rates(rates, name, shape)[1]
    else:
        frames = int(_positive(entry.get("frames"), f"recording {name!r}: frames", whole=True))
        _check_length(spikes, name, frames, shape)
    optional = {
        key: None if entry.get(key) is None else _positive(entry[key], f"recording {name!r}: {key}")
        for key in ("v_d", "temperature_k")
    }
    note = str(entry.get("note", ""))
    return CampaignRecording(name, shape, frames, spikes, rates, radiance, use, **optional, note=note)


def _check_length(spikes: Path | None, name: str, frames: int, shape: tuple[int, int]) -> None:
    size, frame = spikes.stat().st_size if spikes else 0, packed_bytes(shape)
    if size != frames * frame:
        raise InputError(
            f"recording {name!r}: {spikes} has {size} bytes, {frames} frames of {shape[0]} x {shape[1]} pixels take "
            f"{frames * frame}; correct frames (the file holds {size / frame:g}) or the camera's size"
        )


def _file(root: Path, name: str, key: str, value: Any) -> Path | None:
    if value is None:
        return None
    path = root / str(value)
    if not path.is_file():
        raise InputError(f"recording {name!r}: its {key} file {path} is missing; add it or drop the recording")
    return path


def _read_rates(path: Path, name: str, shape: tuple[int, int]) -> tuple[NDArray[np.float64], int]:
    arrays = _read_npz(path, ("rate", "frames"), name)
    rate = arrays["rate"].astype(np.float64)
    if rate.shape != shape:
        raise InputError(f"recording {name!r}: rate in {path.name} is {rate.shape}, the camera {shape}")
    if not np.all((rate >= 0) & (rate <= 1)):
        raise InputError(
            f"recording {name!r}: rate in {path.name} runs from {rate.min():g} to {rate.max():g}; a pixel has 0 to 1 "
            "spikes a frame"
        )
    return rate, int(_positive(arrays["frames"].item(), f"recording {name!r}: frames", whole=True))


def _read_npz(path: Path, keys: tuple[str, ...], name: str) -> dict[str, NDArray[Any]]:
    try:
        with np.load(path) as arrays:
            missing = [key for key in keys if key not in arrays]
            if missing:
                raise InputError(f"recording {name!r}: {path.name} lacks {', '.join(missing)}; it has {arrays.files}")
            return {key: arrays[key] for key in keys}
    except (OSError, zipfile.BadZipFile, AttributeError) as error:
        raise InputError(f"recording {name!r}: {path} is not a readable npz: {error}") from error


def _positive(value: Any, what: str, *, whole: bool = False) -> float:
    ok = isinstance(value, (int, float)) and not isinstance(value, bool) and 0 < value < np.inf
    if not ok or (whole and value != int(value)):
        raise InputError(f"{what} = {value!r}; it must be a positive {'whole ' if whole else ''}number")
    return value
