"""A measurement campaign: a folder of recordings and of the light that the camera saw, read and checked.

campaign.json, format `spikecam-campaign/1` (docs/calibration.md):

    {"format": "spikecam-campaign/1",
     "camera": {"height": 64, "width": 64, "frame_rate_hz": 40000.0},
     "recordings": [{"name": "flat-120", "spikes": "flat-120.dat", "frames": 8000, "radiance": "flat-120.npz",
                     "use": "fit", "v_d": 1.1, "temperature_k": 300.0, "note": ""}]}

spikes: `.dat`, unflipped.  radiance: npz with `frame` (K,) and `radiance` (K, H, W) or broadcastable, linear between
keys; null = an unknown static scene.  Instead of spikes, rates: npz with `rate` (H, W) [spikes/frame] and `frames`.
Names are plain file names, and files lie in the folder.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spikecam_env.checked import checked_count, checked_memory, checked_shape
from spikecam_env.errors import InputError
from spikecam_env.names import distinct, file_name, inside
from spikecam_env.sensor import Keyframes
from spikecam_env.sensor.model import FRAME_RATES_HZ
from spikecam_env.streams.packing import packed_bytes, unpack_frames
from spikecam_env.types import Floats, Spikes
from spikecam_env.untrusted import (
    Count,
    Declared,
    Name,
    Positive,
    Side,
    checked_format,
    declared,
    number,
    numbers,
    read_arrays,
    read_json,
)

FORMAT = "spikecam-campaign/1"
USES = ("fit", "holdout")


@dataclass(frozen=True)
class CampaignRecording:
    """One recording: a stream of spikes in a file, or only the rates of its pixels.

    Example:
        >>> from spikecam_env.sensor import Keyframes, SensorModel
        >>> light = Keyframes(np.array([0.0]), np.full((1, 1, 1), 0.25, np.float32))
        >>> flats = [PlannedRecording("flat", light, 80)]
        >>> campaign = record_takes("camera", SensorModel.preset("ideal"), flats, shape=(2, 4))
        >>> flat = campaign.recordings[0]
        >>> float(flat.load().mean()), float(flat.static_radiance().mean())
        (0.25, 0.25)
    """

    name: str
    shape: tuple[int, int]
    frames: int
    spikes: Path | None
    rates: Path | None
    """Of `spikes` and `rates` one is a path."""
    radiance: Path | None
    """None for an unknown static scene."""
    use: str = "fit"
    v_d: float | None = None
    """V_D - V_ref [V]."""
    temperature_k: float | None = None
    note: str = ""

    def light(self) -> Keyframes | None:
        """The light that the camera saw; None where it is unknown."""
        if self.radiance is None:
            return None
        where = f"recording {self.name!r}"
        frame, radiance = read_light(self.radiance, where)
        checked_memory(4 * frame.size * math.prod(self.shape), f"{where}: light at {frame.size} keys")
        try:
            return Keyframes(frame, np.broadcast_to(radiance.astype(np.float32), (frame.size, *self.shape)))
        except ValueError as error:
            raise InputError(
                f"{where}: {self.radiance.name} holds frame {frame.shape}, radiance {radiance.shape}, "
                f"unusable for {self.shape} pixels: {error}"
            ) from error

    def static_radiance(self) -> Floats | None:
        """(H, W) radiance, or None where it is unknown or changes during the recording."""
        light = self.light()
        if light is None or np.any(light.radiance != light.radiance[0]):
            return None
        return np.asarray(light.radiance[0].astype(np.float64))

    def packed(self) -> NDArray[np.uint8]:
        """(frames, ceil(H W / 8)) uint8 bits of the stream, mapped from the file; InputError for rates only."""
        if self.spikes is None:
            raise InputError(f"recording {self.name!r} holds rates only, no spikes; read it with rate()")
        return np.memmap(self.spikes, np.uint8, "r", shape=(self.frames, packed_bytes(self.shape)))

    def load(self) -> Spikes:
        """(frames, H, W) uint8 spikes; InputError for rates only."""
        return unpack_frames(np.asarray(self.packed()), self.shape)

    def rate(self) -> Floats:
        """(H, W) measured rates of a recording that is rates only [spikes/frame]."""
        if self.rates is None:
            raise InputError(f"recording {self.name!r} is a stream of spikes; read it with load() or packed()")
        return _rates(self.rates, self.name, self.shape)[0]


@dataclass(frozen=True)
class Campaign:
    """A folder of recordings of one camera; `read_campaign` makes it.

    Example:
        >>> from spikecam_env.sensor import Keyframes, SensorModel
        >>> light = Keyframes(np.array([0.0]), np.full((1, 1, 1), 0.25, np.float32))
        >>> flats = [PlannedRecording("flat", light, 80)]
        >>> campaign = record_takes("camera", SensorModel.preset("ideal"), flats, shape=(2, 4))
        >>> campaign.shape, [recording.name for recording in campaign.recordings]
        ((2, 4), ['flat'])
    """

    folder: Path
    shape: tuple[int, int]
    frame_rate_hz: float
    recordings: tuple[CampaignRecording, ...]


class _Camera(Declared):
    height: Side
    width: Side
    frame_rate_hz: Annotated[float, Field(ge=FRAME_RATES_HZ[0], le=FRAME_RATES_HZ[1])]


class _Entry(Declared):
    """A recording in campaign.json."""

    name: Name
    spikes: Name | None = None
    rates: Name | None = None
    frames: Count | None = None
    radiance: Name | None = None
    use: Literal["fit", "holdout"] = "fit"
    v_d: Positive | None = None
    temperature_k: Positive | None = None
    note: str = ""


class _CampaignFile(Declared):
    format: str
    camera: _Camera
    recordings: list[_Entry]


def read_campaign(folder: str | Path, *, outside: bool = False) -> Campaign:
    """Read and check a campaign.

    Args:
        folder: with campaign.json in it.
        outside: read files that lie outside of the folder too, by `..`, from the root, or over symbolic links.

    Raises:
        InputError: for anything missing or contradictory; it names the recording.

    Example:
        >>> from spikecam_env.sensor import Keyframes, SensorModel
        >>> light = Keyframes(np.array([0.0]), np.full((1, 1, 1), 0.25, np.float32))
        >>> flats = [PlannedRecording("flat", light, 80)]
        >>> recorded = record_takes("camera", SensorModel.preset("ideal"), flats, shape=(2, 4))
        >>> read_campaign("camera") == recorded
        True
    """
    root = Path(folder)
    path = root / "campaign.json"
    if not path.is_file():
        raise InputError(f"{root} is no campaign: there is no campaign.json in it")
    file = declared(_CampaignFile, checked_format(read_json(path), FORMAT, str(path)), str(path))
    shape = checked_shape((file.camera.height, file.camera.width), f"{path}: camera")
    if not file.recordings:
        raise InputError(f"{path} lists no recordings")
    recordings = tuple(_recording(root, shape, entry, outside) for entry in file.recordings)
    distinct((r.name for r in recordings), "recording")
    return Campaign(root, shape, file.camera.frame_rate_hz, recordings)


def read_light(path: Path, where: str) -> tuple[Floats, NDArray[Any]]:
    """Light over time, frame (K,) and radiance as they are stored in an npz of these names.

    Raises:
        InputError: for other arrays, and for radiance that is no number, negative or larger than float32 holds.
    """
    where = f"{where}: {path.name}"
    arrays = read_arrays(path, ("frame", "radiance"))
    frame = np.atleast_1d(numbers(arrays["frame"], "frame", where)).astype(np.float64)
    radiance = numbers(arrays["radiance"], "radiance", where)
    if not (radiance.size and np.all((radiance >= 0) & (radiance <= np.finfo(np.float32).max))):
        raise InputError(
            f"{where}: radiance of shape {radiance.shape} must be finite and >= 0 (1.0 = one spike a frame)"
        )
    return frame, radiance


def read_rates(path: Path, where: str) -> tuple[Floats, int]:
    """Rates (H, W) [spikes/frame] and the frames they were counted over, from an npz of `rate` and `frames`.

    Raises:
        InputError: for other arrays, and for rates that are not 0 to 1.
    """
    where = f"{where}: {path.name}"
    arrays = read_arrays(path, ("rate", "frames"))
    rate = numbers(arrays["rate"], "rate", where).astype(np.float64)
    if rate.ndim != 2 or not rate.size:
        raise InputError(f"{where}: rate is {rate.shape}; it must be (rows, columns)")
    if not np.all((rate >= 0) & (rate <= 1)):
        raise InputError(f"{where}: rate runs from {rate.min():g} to {rate.max():g}; a pixel has 0 to 1 spikes a frame")
    frames = number(arrays, "frames", where)
    if not frames.is_integer():
        raise InputError(f"{where}: frames = {frames:g}; it must be a whole number, 1 or more")
    return rate, checked_count(int(frames), f"{where}: frames")


def _recording(root: Path, shape: tuple[int, int], entry: _Entry, outside: bool) -> CampaignRecording:
    name = file_name(entry.name, "recording name")
    spikes, rates, radiance = (
        _file(root, name, key, getattr(entry, key), outside) for key in ("spikes", "rates", "radiance")
    )
    if (spikes is None) == (rates is None):
        raise InputError(f"recording {name!r} needs either spikes (a .dat) or rates (an .npz)")
    frames = entry.frames
    if rates is not None:
        frames = _rates(rates, name, shape)[1]
    if frames is None:
        raise InputError(f"recording {name!r}: frames is missing; say how many the spikes have")
    _check_length(spikes, name, frames, shape)
    return CampaignRecording(
        name, shape, frames, spikes, rates, radiance, entry.use, entry.v_d, entry.temperature_k, entry.note
    )


def _check_length(spikes: Path | None, name: str, frames: int, shape: tuple[int, int]) -> None:
    if spikes is None:
        return
    size, frame = spikes.stat().st_size, packed_bytes(shape)
    if size != frames * frame:
        raise InputError(
            f"recording {name!r}: {spikes} has {size} bytes, {frames} frames of {shape[0]} x {shape[1]} pixels take "
            f"{frames * frame}; correct frames (the file holds {size / frame:g}) or the camera's size"
        )


def _file(root: Path, name: str, key: str, text: str | None, outside: bool) -> Path | None:
    if text is None:
        return None
    path = inside(root, text, f"recording {name!r}: {key}", outside=outside)
    if not path.is_file():
        raise InputError(f"recording {name!r}: its {key} file {path} is missing; add it or drop the recording")
    return path


def _rates(path: Path, name: str, shape: tuple[int, int]) -> tuple[Floats, int]:
    rate, frames = read_rates(path, f"recording {name!r}")
    if rate.shape != shape:
        raise InputError(f"recording {name!r}: rate in {path.name} is {rate.shape}, the camera {shape}")
    return rate, frames
