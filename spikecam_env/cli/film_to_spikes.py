"""`spikecam film`: a film of yours through the sensor into a file."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import tyro

from spikecam_env.cli.camera import CameraOptions
from spikecam_env.cli.options import Size
from spikecam_env.cli.without_effect import WithoutEffect
from spikecam_env.errors import InputError
from spikecam_env.numbers import LARGEST_COUNT, Count, Positive, Seed, Whole

if TYPE_CHECKING:
    from scenes import VideoScene

MOST_OFF = 0.25
"""Share by which spikes may differ from their expected number without a warning; four standard deviations of
their number come to it."""


@dataclass
class FilmToSpikes:
    """Record a film of yours: a video, a folder of pictures, or a list of pictures with the time of each.

    Light is linear, averaged over area to the sensor's size, and scaled to the mean interval.  The recording lasts as
    long as the film.

    example:  spikecam film clip.mp4 --out clip.h5
              spikecam film pictures --film-rate 1000 --transfer linear --out clip.dat
    """

    film: tyro.conf.Positional[Path]
    """A video; a folder of pictures in the order of their numbers; a .csv file whose first line is name,time_s; or a
    .npy array (T, h, w) or (T, h, w, 3)."""
    out: Path
    """Output file: .h5 (bits with attributes), .dat (raw Vidar bits, geometry in .dat.json) or .npz (key `spikes`)."""
    film_rate: Positive | None = None
    """Pictures a second when the film was taken; default: its time stamps.  A folder and an array need it."""
    slow: Positive = 1.0
    """Factor of slow motion: the film's time stamps are divided by it."""
    transfer: str | None = None
    """From its values to linear light: srgb, bt709, gamma2.2 (or another power), linear; default: the file's."""
    channel: Literal["luminance", "red", "green", "blue"] = "luminance"
    """Colour to take as light: luminance, or one channel."""
    interpolation: Literal["motion", "linear", "hold"] = "motion"
    """Light between two pictures: carried along the motion that is found between them (slower); a straight line; or the
    earlier picture held until the next."""
    mean_interval: Positive = 10.0
    """Exposure: frames between spikes, on average over the film and the picture."""
    frames: Count | None = None
    """Spike frames to record; default: the whole film."""
    seconds: Positive | None = None
    """The same, in seconds of the film's true time."""
    size: Size = (250, 400)
    """Rows and columns; the middle of the film that has these proportions is seen."""
    camera: CameraOptions = field(default_factory=CameraOptions)
    seed: Seed = 0
    """Seed of the camera unit and its noise."""
    truth_every: Whole | None = None
    """Frames between ground truths (the film's light) in an .h5 file; 0: none.  Default: the frame in the middle alone,
    beside which `spikecam denoise` shows its pictures."""
    clean: bool = False
    """Also keep the spikes of the noise-free camera before the same light, in an .h5 file of twice the size: to train
    on."""

    without_effect: ClassVar = (WithoutEffect(("seconds",), lambda c: c.frames is not None, "--frames says how long"),)

    def run(self) -> None:
        from scenes import VideoScene
        from spikecam_env.cli.recording import check_out, lit_frames, record_scene, size_and_time
        from spikecam_env.cli.table import table
        from spikecam_env.sensor import SpikeSensor

        check_out(self.out, self.frames or 1, self.size, self.truth_every, clean=self.clean)
        model = self.camera.load()
        sensor = SpikeSensor(model, self.size, self.seed, engine="auto")
        limit = self._limit(model.frame_rate_hz)
        scene = VideoScene(
            self.film,
            self.film_rate,
            self.size,
            frame_rate_hz=model.frame_rate_hz,
            transfer=self.transfer,
            channel=self.channel,
            interpolation=self.interpolation,
            slow=self.slow,
            seconds=None if limit is None else limit / model.frame_rate_hz,
            mean_interval=self.mean_interval,
        )
        frames = self._frames(limit, scene)
        check_out(self.out, frames, self.size, clean=self.clean)
        print(size_and_time(self.out, scene, sensor, frames, clean=self.clean), flush=True)
        attributes: dict[str, object] = {"model": model.name, "seed": self.seed, "scene": repr(scene)}
        attributes |= {"film": self.film.name, "transfer": scene.transfer, "gain": scene.gain}
        truth, what = lit_frames(self.out, frames, self.truth_every), f"record {self.film.name}"
        spikes = record_scene(self.out, scene, sensor, frames, what, attributes, truth, clean=self.clean)
        self._warn_if_off(frames * math.prod(self.size), spikes)
        done = self._done(scene, frames, sensor.engine, spikes)
        print(table([{"film to spikes": name, "": value} for name, value in done.items()]))

    def _limit(self, rate_hz: float) -> int | None:
        """Frames to record, where an option says so."""
        if self.seconds is not None and not self.seconds * rate_hz <= LARGEST_COUNT:
            raise InputError(f"--seconds {self.seconds:g} are more frames than can be counted; give fewer")
        asked = self.frames if self.seconds is None else round(self.seconds * rate_hz)
        if asked is not None and asked < 1:
            raise InputError(f"{asked} frames are asked; record at least 1")
        return asked

    def _frames(self, limit: int | None, scene: VideoScene) -> int:
        """Frames to record; raises InputError where the film is shorter."""
        whole = math.floor(scene.frames + 1e-6)
        if whole < 1:
            raise InputError(f"{self.film} lasts {scene.frames:.3g} frames of the camera; it must last 1 or more")
        if limit is not None and limit > whole:
            raise InputError(
                f"{limit} frames are asked; {self.film} lasts {whole} ({scene.frames / scene.frame_rate_hz:.4g} s)"
            )
        return whole if limit is None else limit

    def _warn_if_off(self, pixels: int, spikes: int) -> None:
        """Warn where spikes are far from the mean interval.  `pixels` are those of all frames together."""
        asked = pixels / self.mean_interval
        if abs(spikes - asked) <= MOST_OFF * asked + 4.0 * math.sqrt(asked):
            return
        why = (
            "dark current and noise fire besides light that is so faint"
            if spikes > asked
            else "a pixel fires once a frame at most, however bright its light, and effects of the model take light"
        )
        got = f"{pixels / spikes:.4g}" if spikes else "no spike"
        warnings.warn(f"--mean-interval {self.mean_interval:g} became {got}: {why}", UserWarning, stacklevel=2)

    def _done(self, scene: VideoScene, frames: int, engine: str, spikes: int) -> dict[str, Any]:
        pixels = frames * math.prod(self.size)
        return {
            "pictures": scene.pictures,
            "times": scene.times_from,
            "duration [s]": frames / scene.frame_rate_hz,
            "transfer": scene.transfer,
            "light of": self.channel,
            "between pictures": self.interpolation,
            "gain": scene.gain,
            "mean interval asked [frames]": self.mean_interval,
            "mean interval got [frames]": pixels / spikes if spikes else None,
            "frames": frames,
            "frames a second": f"{scene.frame_rate_hz:g}",
            "engine": engine,
            "file": str(self.out),
        }
