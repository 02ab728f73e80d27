"""`spikecam demo`: a 2000-rpm disk through the noisy camera and the online denoiser, as a film."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass
class Demo:
    """Stream a fast disk through the noisy 40 kHz camera, denoise it online, and film both beside the true light.

    example:  spikecam demo --rpm 3000 --out demo
    """

    out: Path = Path("demo")
    """Folder for demo.mp4, demo.png and demo.json."""
    rpm: float = 2000.0
    """Speed of the disk."""
    frames: int = 2400
    """Spike frames to stream; 2400 are two turns at 2000 rpm."""
    mode: Literal["best", "paper"] = "best"
    """Which DnSS denoises."""
    model: str = "scsim"
    """Sensor model: a preset (ideal, scsim, physical) or a model TOML."""
    height: int = 250
    width: int = 400
    seed: int = 0

    def run(self) -> None:
        from spikecam_env.cli.files import out_folder, write_json
        from spikecam_env.cli.film import write_film, write_picture
        from spikecam_env.cli.showcase import stream_disk
        from spikecam_env.cli.table import table

        folder = out_folder(self.out)
        show = stream_disk(
            rpm=self.rpm,
            frames=self.frames,
            mode=self.mode,
            model=self.model,
            shape=(self.height, self.width),
            seed=self.seed,
        )
        pictures = show.pictures()
        write_film(folder / "demo.mp4", pictures, fps=20.0)
        write_picture(folder / "demo.png", pictures[len(pictures) // 2])
        write_json(folder / "demo.json", show.summary)
        print(table(show.rows))
        print(show.line)
        print(f"wrote demo.mp4, demo.png and demo.json in {folder}")
