"""`spikecam demo`: a fast scene through the noisy camera and the online denoiser, as a film or a picture."""

from __future__ import annotations

import os
import sys
import webbrowser
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from spikecam_env.cli.camera import CameraOptions
from spikecam_env.cli.mode_weights import Mode
from spikecam_env.cli.options import Size
from spikecam_env.cli.without_effect import WithoutEffect
from spikecam_env.numbers import Count, Rpm, Seed

if TYPE_CHECKING:
    from spikecam_env.cli.showcase import Streamed

FRAMES = 1200
"""Of the film: one turn of the disk at 2000 rpm."""
QUICK_FRAMES = 250
"""Of the picture: it is of frame 187, which the denoiser shows after 31 more, and two cores take some seconds."""


@dataclass
class Demo:
    """Stream a fast scene through the noisy 40 kHz camera, denoise it online, and film both beside the true light.

    example:  spikecam demo --rpm 3000 --out demo
              spikecam demo --quick
    """

    out: Path = Path("demo")
    """Folder for demo.mp4, demo.png and demo.json."""
    quick: bool = False
    """One picture (demo.png) in place of the film and its table."""
    scene: str = "disk"
    """The rotating disk or another scene of `spikecam scenes`."""
    rpm: Rpm | None = None
    """Speed of the disk; default 2000."""
    frames: Count | None = None
    """Spike frames to stream; default 1200, one turn at 2000 rpm; with --quick 250."""
    mode: Mode = "best"
    """Which DnSS denoises the film."""
    camera: CameraOptions = field(default_factory=CameraOptions)
    size: Size = (250, 400)
    """Rows and columns."""
    seed: Seed = 0
    """Seed of the camera unit, its noise, and the scene."""
    open: bool = True
    """Show the result in the desktop's viewer, if the command runs in a terminal of a desktop."""

    without_effect: ClassVar = (WithoutEffect(("rpm",), lambda c: c.scene != "disk", "{scene} has a speed of its own"),)

    def run(self) -> None:
        from spikecam_env.cli.files import out_folder

        with out_folder(self.out) as folder:
            lines = self._picture(folder) if self.quick else self._film(folder)
        print("\n".join(lines))
        shown = self.out / ("demo.png" if self.quick else "demo.mp4")
        if self.open and _opened(shown):
            print(f"opened {shown}")

    def _streamed(self, frames: int, least: int) -> Streamed:
        from spikecam_env.cli.showcase import stream

        return stream(
            scene=self.scene,
            rpm=self.rpm,
            frames=frames if self.frames is None else self.frames,
            mode=self.mode,
            model=self.camera.load(),
            shape=self.size,
            seed=self.seed,
            least=least,
        )

    def _picture(self, folder: Path) -> list[str]:
        """Lines to print."""
        from spikecam_env.cli.screen.film import write_picture
        from spikecam_env.cli.showcase import PICTURE_FRAMES, picture

        run = self._streamed(QUICK_FRAMES, PICTURE_FRAMES)
        write_picture(folder / "demo.png", picture(run, run.shown[-1]))
        what = "noisy spikes, denoised, true light; `spikecam demo` makes a film of them"
        return [f"wrote {self.out / 'demo.png'}: {what}"]

    def _film(self, folder: Path) -> list[str]:
        """Lines to print."""
        from spikecam_env.cli.files import write_json
        from spikecam_env.cli.screen.film import write_film, write_picture
        from spikecam_env.cli.showcase import FILM_FRAMES, comparison, picture
        from spikecam_env.cli.table import table

        run = self._streamed(FRAMES, FILM_FRAMES)
        frames, rows = [picture(run, frame) for frame in run.shown], comparison(run)
        speed: dict[str, Any] = {
            "frames": len(run.noisy),
            "camera's time, ms": 1e3 * len(run.noisy) / run.frame_rate_hz,
            "scene and camera, s": run.camera_s,
            "denoiser, s": run.seconds,
            "x real time": run.times_real,
            "latency, frames": run.latency,
        }
        write_film(folder / "demo.mp4", frames, fps=15.0)
        write_picture(folder / "demo.png", frames[len(frames) // 2])
        options = {**asdict(self), "out": str(self.out)}
        write_json(folder / "demo.json", {"options": options, "speed": speed, "table": rows})
        wrote = f"wrote {self.out / 'demo.mp4'}, and demo.png and demo.json beside it"
        return [table(rows), "", table([speed]), wrote]


def _opened(path: Path) -> bool:
    """Open a file as the desktop does; False where nobody would see it: without a terminal, or without a display."""
    remote = sys.platform == "darwin" and "SSH_CONNECTION" in os.environ
    bare = sys.platform == "linux" and not any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    return sys.stdout.isatty() and not (remote or bare) and webbrowser.open(path.absolute().as_uri())
