"""`spikecam denoise`: a recording through the online denoiser."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import tyro

from spikecam_env.cli.mode_weights import Brightness, Mode, brightness_for
from spikecam_env.cli.reading import ReadingOptions
from spikecam_env.cli.without_effect import WithoutEffect
from spikecam_env.numbers import Count, Whole

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from spikecam_env.cli.restore import DenoisedRecording
    from spikecam_env.streams.recording import Recording


@dataclass
class Denoise:
    """Denoise a recording: writes the denoised stream, a picture before and after, a film and the figures.

    Where a recording has the true light of a frame (as those of `spikecam record` do), it is shown beside them.

    example:  spikecam denoise recording.dat --flip --out denoised
    """

    file: tyro.conf.Positional[Path]
    """.h5 (of `spikecam record`, or an array in another), .npz, .npy, .mat (a spike array), .dat (Vidar bits), .raw,
    .bin (a byte a pixel)."""
    out: Path = Path("denoised")
    """Folder for denoised.h5, pictures.png, film.mp4 and summary.json."""
    mode: Mode = "best"
    """Which DnSS: `best`, `fast` (a quarter of its weights), or `paper` (the paper's network; slower)."""
    weights: Path | None = None
    """Weights of your own (`spikecam train`), in place of the mode's."""
    engine: Literal["torch"] = "torch"
    """The library that computes the network; there is one."""
    window: Count | None = None
    """Frames averaged in the pictures of spikes (TFP window); odd.  Default: 41, or all of a shorter recording.
    Pictures of the rate are of one frame."""
    overlap: bool = False
    """Not for `paper`: passes that overlap by half: less error, no seams, twice the time."""
    ease: bool = False
    """Not for `paper`: ease each pass into the next: half the flicker at their seams, in the same time."""
    calibration: Path | None = None
    """Not for `paper`: maps.h5 of `spikecam calibrate`, or its folder: the camera's fixed pattern is then taken out."""
    first: Whole = 0
    """First frame of the recording to denoise."""
    count: Count | None = None
    """Frames to denoise; default: all from there on."""
    brightness: Brightness = 1.0
    """Spikes are made of rates times this, 0.01 to 100, for networks that read spikes in dim light.  auto: the factor
    that brings the mean to 0.1 spikes a frame, or a smaller one at which less than 1 % of the pixels saturate."""
    film: bool = True
    """Also write film.mp4, noisy beside denoised: at most 240 pictures, evenly over the recording."""
    reading: ReadingOptions = field(default_factory=ReadingOptions)

    without_effect: ClassVar = (
        WithoutEffect(("mode",), lambda c: c.weights is not None, "--weights says which network"),
        WithoutEffect(("ease",), lambda c: c.overlap, "passes that overlap have no seams"),
    )

    def run(self) -> None:
        from spikecam_env.cli.files import out_folder, write_json
        from spikecam_env.cli.table import table
        from spikecam_env.streams import read_recording

        part: dict[str, Any] = {"first": self.first, "count": self.count}
        recording = read_recording(self.file, **part, **self.reading.options())
        print(f"{self.file}: {recording}")
        with out_folder(self.out) as folder:
            found = self._restored(recording)
            self._write_stream(folder, recording, found)
            self._write_pictures(folder, found)
            rows, speed = found.rows(), found.speed()
            summary = {"file": str(self.file), "first": self.first, "mode": self._name, "window": found.window}
            summary |= {"brightness": found.brightness, "saturated": found.saturated, "speed": speed, "rows": rows}
            write_json(folder / "summary.json", summary)
            written = sorted(path.name for path in folder.iterdir())
        print(table(rows))
        if found.brightness != 1.0:
            cut = f"{100 * found.saturated:.2g} % of them saturate"
            print(f"denoised.h5: spikes {found.brightness:g} times brighter than the light; {cut}")
        print()
        print(table([speed]))
        print(f"wrote {', '.join(written)} in {self.out}")

    @property
    def _name(self) -> str:
        """Of the denoiser."""
        return self.mode if self.weights is None else self.weights.name

    def _restored(self, recording: Recording) -> DenoisedRecording:
        from denoiser import OnlineDnSS
        from spikecam_env.cli.restore import (
            DenoisedRecording,
            checked_window,
            light_at,
            picture_frames,
            restore,
            whole_windows,
        )

        noisy = recording.spikes
        window = checked_window(self.window, len(noisy))
        light = light_at(self.file, whole_windows(len(noisy), window), noisy.shape[1:], self.first)
        options: dict[str, Any] = {"overlap": self.overlap, "ease": self.ease}
        options |= {"unit": self.calibration, "engine": self.engine}
        options["brightness"] = brightness_for(self.brightness, noisy)
        if self.weights is None:
            online = OnlineDnSS.pretrained(self.mode, output="both", **options)
        else:
            online = OnlineDnSS.from_file(self.weights, output="both", **options)
        denoised, planes, seconds = restore(noisy, online, [*picture_frames(len(noisy), window), *light])
        return DenoisedRecording(
            noisy,
            denoised,
            planes,
            light,
            window,
            recording.frame_rate_hz,
            seconds,
            online.latency,
            first=self.first,
            recorded=recording.brightness,
            brightness=online.brightness,
            saturated=online.saturated,
        )

    def _write_stream(self, folder: Path, recording: Recording, found: DenoisedRecording) -> None:
        from spikecam_env.streams import SpikeWriter
        from spikecam_env.streams.hdf5 import BRIGHTNESS

        attributes = {k: v for k, v in recording.attributes.items() if k in ("model", "seed", "scene")}
        attributes |= {"denoiser": self._name, "source": self.file.name, "first": self.first}
        if (brightness := recording.brightness * found.brightness) != 1.0:
            attributes |= {BRIGHTNESS: brightness, "saturated": found.saturated}
        shape = found.denoised.shape[1:]
        with SpikeWriter(folder / "denoised.h5", shape, recording.frame_rate_hz, **attributes) as writer:
            writer.append(found.denoised)

    def _write_pictures(self, folder: Path, found: DenoisedRecording) -> None:
        from spikecam_env.cli.restore import instant
        from spikecam_env.cli.screen.film import write_film, write_picture
        from spikecam_env.cli.screen.screen import compose

        white, rate_hz = found.white, found.frame_rate_hz

        def picture(frame: int, *, light: bool) -> NDArray[np.uint8]:
            when = instant(self.first + frame, rate_hz)
            return compose(found.panels(frame, light=light), white, corner=f"{self._name}: {when}")

        write_picture(folder / "pictures.png", picture(found.middle, light=True))
        if self.film:
            frames = found.film_frames
            write_film(folder / "film.mp4", (picture(t, light=False) for t in frames), total=len(frames))
