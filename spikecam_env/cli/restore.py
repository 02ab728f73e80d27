"""A recording through the online denoiser: its spikes, rate planes of chosen frames, and figures of both.

A picture is a mean over a window of frames (TFP), or of one instant (TFI of spikes, the denoiser's rate plane).  Every
caption says which: motion smears the first, not the second.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from denoiser.evaluate.metrics import psnr_db
from denoiser.online import OnlineDnSS, pieces_of
from spikecam_env.cli.recording import HDF5
from spikecam_env.cli.screen.screen import PicturePanel, white_of
from spikecam_env.errors import InputError
from spikecam_env.streams import middleTFI, middleTFP, read_truth
from spikecam_env.streams.hdf5 import is_recording
from spikecam_env.types import Pictures, Spikes

WINDOW = 41
"""Frames of a mean (TFP): the width of the denoiser's own window in the paper."""
WHITE = 99.8
"""Percentile of light that is shown white: the few pixels above it are highlights."""
MOST_PICTURES = 240
"""In a film: 8 seconds."""
INTERVAL = "one interval"
"""Frames of a TFI: the table alone has it."""
MOST_JUDGED = 12
"""Frames that the table is of, evenly over the recording."""


@dataclass(frozen=True)
class DenoisedRecording:
    """A recording before and after the denoiser."""

    noisy: Spikes
    """(T, H, W), as recorded."""
    denoised: Spikes
    """(T, H, W)."""
    planes: dict[int, Pictures]
    """Rate planes (H, W) [spikes/frame] by frame."""
    light: dict[int, Pictures]
    """True light (H, W) [spikes/frame] in the middle of frames, where the recording has it."""
    window: int
    """Frames of the pictures that are means."""
    frame_rate_hz: float | None
    """Of the recording, where it is known."""
    seconds: float
    """That the denoiser took."""
    latency: int
    """Of the denoiser [frames]."""
    first: int = field(default=0, kw_only=True)
    """Number in the recording of the first frame."""
    recorded: float = field(default=1.0, kw_only=True)
    """Spikes of `noisy` over those that their light gives."""
    brightness: float = field(default=1.0, kw_only=True)
    """Spikes of `denoised` over those that the rates give."""
    saturated: float = field(default=0.0, kw_only=True)
    """Share of them that are cut to one a frame."""

    @property
    def film_frames(self) -> list[int]:
        """At most MOST_PICTURES frames, evenly over the recording."""
        return picture_frames(len(self.noisy), self.window)

    @property
    def middle(self) -> int:
        """The frame nearest the middle; of those with true light where there are any."""
        return min(self.light or self.film_frames, key=lambda frame: abs(frame - len(self.noisy) // 2))

    def panels(self, frame: int, *, light: bool = True) -> list[PicturePanel]:
        """Before and after at a frame, beside the true light where it is known and asked for."""
        known = self.light.get(frame) if light else None
        panels = []
        for (title, what), picture in self._pictures.items():
            if what != INTERVAL:
                shown = picture(frame)
                line = what if known is None else f"{what}, PSNR {light_db(shown, known):.2f} dB"
                panels.append(PicturePanel(shown, title, line))
        if known is not None:
            panels.append(PicturePanel(known, "true light", instant(self.first + frame, self.frame_rate_hz)))
        return panels

    @property
    def white(self) -> float:
        """The light that pictures show white."""
        planes = [self.planes[frame] for frame in evenly(list(self.planes), MOST_JUDGED)]
        return white_of([_light_of(plane, self.recorded) for plane in planes], WHITE)

    def rows(self) -> list[dict[str, Any]]:
        """A row a picture: mean rate [spikes/frame], and PSNR [dB] where the true light is known; means over the frames
        with true light, or else over MOST_JUDGED of the planes."""
        frames = list(self.light) or evenly(list(self.planes), MOST_JUDGED)
        rows = []
        for (name, of), picture in self._pictures.items():
            shown = [picture(t) for t in frames]
            row: dict[str, Any] = {"picture": name, "of": of, "spikes/frame": float(np.mean(shown))}
            if self.light:
                scores = [light_db(one, self.light[t]) for one, t in zip(shown, frames, strict=True)]
                row["PSNR, light [dB]"] = float(np.mean(scores))
            rows.append(row)
        return rows

    @property
    def _pictures(self) -> dict[tuple[str, str], Callable[[int], Pictures]]:
        """Pictures at a frame, by what they show and the frames that they are of."""
        mean = "one frame" if self.window == 1 else f"mean of {self.window} frames"
        return {
            ("noisy spikes", mean): lambda t: _light_of(middleTFP(self.noisy, t, self.window), self.recorded),
            ("noisy spikes", INTERVAL): lambda t: _light_of(middleTFI(self.noisy, t), self.recorded),
            ("denoised spikes", mean): lambda t: _light_of(
                middleTFP(self.denoised, t, self.window), self.recorded * self.brightness
            ),
            ("denoised rate", "one frame"): lambda t: _light_of(self.planes[t], self.recorded),
        }

    def speed(self) -> dict[str, Any]:
        """How fast the denoiser was, and how late; by the camera's clock too where its frame rate is known."""
        frames, rate = len(self.noisy), self.frame_rate_hz
        known = {} if rate is None else {"camera's time, ms": 1e3 * frames / rate}
        real = {} if rate is None else {"x real time": frames / rate / self.seconds}
        late = {} if rate is None else {"latency, ms": 1e3 * self.latency / rate}
        work = {"denoiser, s": self.seconds, "frames/s": frames / self.seconds}
        return {"frames": frames, **known, **work, **real, "latency, frames": self.latency, **late}


def _light_of(rate: Pictures, brightness: float) -> Pictures:
    """Light [spikes/frame] of a rate of spikes so many times brighter."""
    return rate if brightness == 1.0 else rate / np.float32(brightness)


def instant(frame: int, frame_rate_hz: float | None) -> str:
    """The middle of a frame by its number, and by the camera's clock where its rate is known: `frame 187, 4.69 ms`."""
    return f"frame {frame}" + ("" if frame_rate_hz is None else f", {1e3 * (frame + 0.5) / frame_rate_hz:.2f} ms")


def light_db(picture: Pictures, light: Pictures) -> float:
    """PSNR [dB] of a picture against the true light (H, W), whose brightest pixel is the peak."""
    return psnr_db(picture, light, float(light.max()) or 1.0)


def checked_window(window: int | None, frames: int) -> int:
    """Frames of a mean: WINDOW, or as many as a shorter recording has; odd.

    Raises:
        InputError: `window` is even, or longer than the recording.
    """
    if window is None:
        return min(WINDOW, frames - 1 + frames % 2)
    if window % 2 == 0:
        raise InputError(f"--window {window}; it must be odd and at least 1 (41 is usual)")
    if window > frames:
        raise InputError(f"--window {window}: the recording has {frames} frames; give a window of at most that")
    return window


def evenly(items: Sequence[int], most: int) -> list[int]:
    """At most so many of the items, evenly over them: of `range(10)` three are 0, 4, 8."""
    return list(items[:: -(-len(items) // most) or 1])


def picture_frames(frames: int, window: int) -> list[int]:
    """Frames at the middle of whole windows, at most MOST_PICTURES of them, evenly over a recording."""
    return evenly(whole_windows(frames, window), MOST_PICTURES)


def whole_windows(frames: int, window: int) -> range:
    """Frames at the middle of windows that lie in a recording of so many frames."""
    return range(window // 2, frames - window // 2)


def light_at(path: Path, frames: Sequence[int], shape: tuple[int, int], first: int = 0) -> dict[int, Pictures]:
    """True light of a recording in the middle of some of these frames, at most MOST_JUDGED, by frame.  Frames are
    counted from the recording's frame `first`.

    Empty for a file that is not of this package or has no truth.
    """
    if path.suffix.lower() not in HDF5 or not is_recording(path):
        return {}
    instants = read_truth(path, ("frame",)).get("frame", np.empty(0))
    rows = {int(at) - first: row for row, at in enumerate(instants.ravel().tolist()) if at % 1 == 0.5}
    known = evenly([frame for frame in rows if frame in frames], MOST_JUDGED)
    return {frame: _light(path, rows[frame], shape) for frame in known}


def _light(path: Path, row: int, shape: tuple[int, int]) -> Pictures:
    light = read_truth(path, ("radiance",), slice(row, row + 1)).get("radiance", np.empty(0))
    if light.shape != (1, *shape) or light.dtype.kind not in "iuf" or not np.isfinite(light).all():
        raise InputError(f"{path}: truth: radiance must be finite numbers of shape {shape} at each instant")
    return np.asarray(light[0], np.float32)


def restore(
    noisy: Spikes, online: OnlineDnSS, at: Iterable[int], chunk: int = 16
) -> tuple[Spikes, dict[int, Pictures], float]:
    """Denoise a stream.

    Args:
        noisy: (T, H, W) spikes.
        online: The denoiser, with output "both".
        at: Frames whose rate plane is kept: planes are four bytes a pixel.
        chunk: Frames that are pushed at a time.

    Returns:
        (T, H, W) denoised spikes, rate planes (H, W) [spikes/frame] by frame in order, and the denoiser's time [s].
    """
    wanted = set(at)
    planes: dict[int, Pictures] = {}
    spikes = np.empty_like(noisy)
    began = time.perf_counter()
    for first, (fired, rates) in pieces_of(online, noisy, chunk, title="denoise"):
        spikes[first : first + len(fired)] = fired
        planes |= {frame: plane for frame, plane in enumerate(rates, first) if frame in wanted}
    return spikes, planes, time.perf_counter() - began
