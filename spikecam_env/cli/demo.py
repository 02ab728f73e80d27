"""`spikecam demo`: a fast scene through the noisy camera and the online denoiser, as a film."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Literal

from spikecam_env.cli.camera import Camera
from spikecam_env.cli.options import Count, Rpm, Seed, Size


@dataclass
class Demo:
    """Stream a fast scene through the noisy 40 kHz camera, denoise it online, and film both beside the true light.

    example:  spikecam demo --rpm 3000 --out demo
    """

    out: Path = Path("demo")
    """Folder for demo.mp4, demo.png and demo.json."""
    scene: str = "disk"
    """The rotating disk or another scene of `spikecam scenes`."""
    rpm: Rpm | None = None
    """Speed of the disk; default 2000."""
    frames: Count = 1200
    """Spike frames to stream; 1200 are one turn at 2000 rpm."""
    mode: Literal["best", "paper"] = "best"
    """Which DnSS denoises the film."""
    camera: Camera = field(default_factory=Camera)
    size: Size = (250, 400)
    """Rows and columns."""
    seed: Seed = 0
    """Seed of the camera unit, its noise, and the scene."""

    def run(self) -> None:
        from spikecam_env.cli.files import out_folder, write_json
        from spikecam_env.cli.panels import write_film, write_picture
        from spikecam_env.cli.showcase import comparison, film_frames, stream
        from spikecam_env.cli.table import table

        with out_folder(self.out) as folder:
            run = stream(
                scene=self.scene,
                rpm=self.rpm,
                frames=self.frames,
                mode=self.mode,
                model=self.camera.load(),
                shape=self.size,
                seed=self.seed,
            )
            frames, rows = film_frames(run), comparison(run)
            speed = {
                "frames": len(run.noisy),
                "camera's time, ms": 1e3 * len(run.noisy) / run.frame_rate_hz,
                "scene and camera, s": run.camera_s,
                "denoiser, s": run.denoiser_s,
                "x real time": run.times_real,
                "latency, frames": run.latency,
            }
            write_film(folder / "demo.mp4", frames, fps=15.0)
            write_picture(folder / "demo.png", frames[len(frames) // 2])
            options = {**asdict(self), "out": str(self.out)}
            write_json(folder / "demo.json", {"options": options, "speed": speed, "table": rows})
            print(table(rows))
            print()
            print(table([speed]))
            print(f"wrote demo.mp4, demo.png and demo.json in {folder}")
