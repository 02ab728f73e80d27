"""`spikecam live`: a stream as it comes, denoised, in a window, as a film, or as figures."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import tyro

from spikecam_env.cli.camera import CameraOptions
from spikecam_env.cli.options import Size
from spikecam_env.cli.reading import ReadingOptions
from spikecam_env.cli.without_effect import WithoutEffect
from spikecam_env.errors import unknown_name
from spikecam_env.numbers import Count, Positive, Range, Rpm, Seed

if TYPE_CHECKING:
    from spikecam_env.streams.sources import Source, StoredFrames

MOST_PICTURES_S = 1000.0
SLOWEST, FASTEST = 1e-6, 1e6
"""Speeds of a file or a scene: a frame in 25 s, and more frames a second than any machine takes in."""
READ_AHEAD = 2.0
"""Frames that can be read a second, over those that are needed: the reader has half a core beside the network."""


@dataclass
class Live:
    """Watch a spike stream as it comes, denoised: every frame is taken in, and a picture knows all before it.

    In a window where there is a display (Esc ends), as a film with --film; else the figures alone: frames a second that
    came, pictures a second, frames that were lost, and the latency.

    example:  spikecam live disk
              spikecam live recording.dat --flip --loop --seconds 60
              spikecam live tcp://camera:5000 --film live.mp4 --seconds 20
              cat recording.dat | spikecam live - --frames 40000
    """

    source: tyro.conf.Positional[str]
    """A scene of `spikecam scenes`; a file as `spikecam denoise` takes it; packed frames from standard input (-), a
    server (tcp://HOST:PORT, unix://PATH), a named pipe or a socket by its path."""
    film: Path | None = None
    """Write a film (.mp4) instead of opening a window; it is kept when the stream, or --seconds, is over."""
    frames: Count | None = None
    """End after so many frames."""
    seconds: Positive | None = None
    """End after so long."""
    speed: Annotated[float | None, Range(SLOWEST, FASTEST)] = None
    """Speed of a file or a scene.  Default: 1, real time, the camera's frame rate of 40 000 frames a second."""
    loop: bool = False
    """Begin a file again when it is over."""
    pictures: Annotated[float, Range(0.01, MOST_PICTURES_S)] = 30.0
    """Pictures a second, at most.  Mode `picture` makes so many at the stream's frame rate and --speed, each of 8 to
    4000 frames."""
    mode: Literal["picture", "best", "fast", "paper"] = "picture"
    """Which DnSS.  `picture` uses every frame; the others skip those for which they are too slow."""
    weights: Path | None = None
    """A checkpoint of `spikecam train` instead of the mode's shipped weights."""
    passes: Count | None = None
    """Not for `picture`: passes of the network for a picture, 1 by default; more passes use more of the frames before
    it, and take longer."""
    calibration: Path | None = None
    """Not for `paper`: maps.h5 of `spikecam calibrate`, or its folder: the camera's fixed pattern is then taken out."""
    size: Size = (250, 400)
    """Rows and columns of a scene."""
    rpm: Rpm | None = None
    """Speed of the scene `disk`; default 2000."""
    seed: Seed = 0
    """Of a scene, its camera unit and noise."""
    camera: CameraOptions = field(default_factory=CameraOptions)
    reading: ReadingOptions = field(default_factory=ReadingOptions)

    without_effect: ClassVar = (
        WithoutEffect(("mode",), lambda c: c.weights is not None, "--weights says which network"),
        WithoutEffect(("size", "rpm", "seed", "camera"), lambda c: not c.is_scene, "{source} is no scene"),
        WithoutEffect(("rpm",), lambda c: c.source != "disk", "{source} has a speed of its own"),
        WithoutEffect(("loop", "reading"), lambda c: c.is_scene, "{source} is a scene, and no file"),
        WithoutEffect(("speed",), lambda c: c.is_flow, "{source} has a pace of its own"),
    )

    @property
    def is_scene(self) -> bool:
        """Whether it is a scene of the catalogue."""
        from scenes.catalogue import SCENES

        return self.source in SCENES

    @property
    def is_flow(self) -> bool:
        """Whether it is a pipe or a socket."""
        from spikecam_env.streams.sources import is_flow

        return is_flow(self.source)

    def run(self) -> None:
        from denoiser.live import LiveDnSS
        from denoiser.live.session import PICTURES_S, Session
        from spikecam_env.cli.files import check_place
        from spikecam_env.cli.live.watching import Watching
        from spikecam_env.cli.screen.film import film
        from spikecam_env.cli.screen.window import DisplayWindow, has_display
        from spikecam_env.cli.table import table

        check_place("film", self.film, ".mp4")
        with self._source() as source:
            live = LiveDnSS(source.shape, self.weights or self.mode, passes=self.passes, unit=self.calibration)
            pace = {"speed": self.speed or 1.0, "pictures": self.pictures}
            session = Session(source, live, **pace, frames=self.frames, seconds=self.seconds)
            watching = Watching(session, source, str(self.weights or self.mode))
            with session:
                if self.film is not None:
                    with film(self.film, PICTURES_S, bar=False) as end:
                        watching.on_screen(end)
                elif has_display():
                    watching.on_screen(DisplayWindow(f"spikecam live {source.title}"))
                else:
                    print("no display: the figures alone; --film FILE.mp4 writes the pictures", flush=True)
                    watching.as_figures()
            print(table([watching.summary()]))
        if self.film is not None:
            print(f"wrote {self.film}")

    @contextmanager
    def _source(self) -> Iterator[Source]:
        from scenes.catalogue import SCENES
        from spikecam_env.cli.live.simulated import SimulatedSource
        from spikecam_env.cli.named_scene import scene_named
        from spikecam_env.sensor import SpikeSensor
        from spikecam_env.streams.sources import StoredFrames, open_source

        if self.is_scene:
            model = self.camera.load()
            scene = scene_named(self.source, self.size, self.seed, model.frame_rate_hz, self.rpm)
            sensor = SpikeSensor(model, self.size, self.seed, engine="auto")
            yield SimulatedSource(self.source, scene, sensor, self.speed or 1.0)
            return
        if not Path(self.source).suffix and not self.is_flow:
            raise unknown_name("scene, file or address", self.source, SCENES)
        with open_source(self.source, loop=self.loop, **self.reading.options()) as source:
            if isinstance(source, StoredFrames):
                _say_if_read_slowly(source, self.speed or 1.0)
            yield source


def _say_if_read_slowly(source: StoredFrames, speed: float) -> None:
    rate, needed = source.read_rate(), speed * source.frame_rate_hz
    if rate < READ_AHEAD * needed:
        print(
            f"{source.title} is read at {rate:.0f} frames a second, and {needed:.0f} are needed beside the network: "
            f"frames will be lost; give --speed {rate / READ_AHEAD / source.frame_rate_hz:.1g}, or a .dat file, which "
            "is read several times as fast",
            flush=True,
        )
