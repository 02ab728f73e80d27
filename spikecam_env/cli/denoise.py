"""`spikecam denoise`: a recording through the online denoiser."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import tyro

from spikecam_env.cli.mode_weights import Mode
from spikecam_env.cli.options import Count
from spikecam_env.cli.reading import Reading


@dataclass
class Denoise:
    """Denoise a recording: writes the denoised stream, a picture before and after, a film and the figures.

    example:  spikecam denoise recording.dat --flip --out denoised
    """

    file: tyro.conf.Positional[Path]
    """.h5 (of `spikecam record`, or an array in another), .npz, .npy, .mat (a spike array), .dat (Vidar bits), .raw,
    .bin (a byte a pixel)."""
    out: Path = Path("denoised")
    """Folder for denoised.h5, pictures.png, film.mp4 and summary.json."""
    mode: Mode = "best"
    """Which DnSS: `best`, `fast` (a quarter of its weights), or `paper` (the paper's network; slower)."""
    engine: Literal["torch", "openvino"] = "torch"
    """What computes the network; `openvino` (pip install 'spikecam-env[openvino]') takes no `paper`."""
    window: Count = 41
    """Frames averaged in the pictures (TFP window); odd."""
    overlap: bool = False
    """Not for `paper`: passes that overlap by half: less error, no seams, twice the time."""
    calibration: Path | None = None
    """Not for `paper`: maps.h5 of `spikecam calibrate`, or its folder: the camera's fixed pattern is then taken out."""
    film: bool = True
    """Also write film.mp4, noisy beside denoised."""
    reading: Reading = field(default_factory=Reading)

    def run(self) -> None:
        import numpy as np
        from tqdm import tqdm

        from denoiser.niqe import niqe
        from spikecam_env.cli.files import out_folder, write_json
        from spikecam_env.cli.panels import Panel, compose, display, write_film, write_picture
        from spikecam_env.cli.restore import picture_frames, restore
        from spikecam_env.cli.table import table
        from spikecam_env.errors import InputError
        from spikecam_env.streams import SpikeWriter, middleTFP, read_recording

        if self.window % 2 == 0:
            raise InputError(f"--window {self.window}; it must be odd and at least 1 (41 is usual)")
        recording = read_recording(self.file, **self.reading.options())
        print(f"{self.file}: {recording}")
        noisy = recording.spikes
        frames = picture_frames(len(noisy), self.window)
        with out_folder(self.out) as folder:
            options: dict[str, Any] = {"overlap": self.overlap, "unit": self.calibration, "engine": self.engine}
            clean, rates = restore(noisy, self.mode, self.window, frames, **options)

            attributes = {k: v for k, v in recording.attributes.items() if k in ("model", "seed", "scene")}
            attributes |= {"denoiser": self.mode, "source": self.file.name}
            with SpikeWriter(folder / "denoised.h5", clean.shape[1:], recording.frame_rate_hz, **attributes) as writer:
                writer.append(clean)

            white = float(np.percentile(noisy.mean(axis=0), 99.5)) or 1.0
            streams = {
                "noisy spikes": {t: middleTFP(noisy, t, self.window) for t in frames},
                "denoised spikes": {t: middleTFP(clean, t, self.window) for t in frames},
                "denoised rate": rates,
            }
            judged = frames[:: -(-len(frames) // 12)]
            rows: list[dict[str, Any]] = []
            for name, pictures in tqdm(streams.items(), desc="judge", unit="stream", leave=False):
                rate = float(np.mean([p.mean() for p in pictures.values()]))
                row: dict[str, Any] = {"picture": name, "spikes/frame": rate}
                try:
                    scores = [niqe(display(pictures[t], white) / 255) for t in judged]
                    row |= {"NIQE": float(np.mean(scores)), "+-": float(np.std(scores)), "pictures": len(scores)}
                except InputError as error:
                    why = str(error)
                    row |= {"NIQE": None, "+-": None, "pictures": 0}
                rows.append(row)

            def side_by_side(frame: int) -> np.ndarray:
                shown = [
                    Panel(pictures[frame], row["picture"], "" if row["NIQE"] is None else f"NIQE {row['NIQE']:.2f}")
                    for row, pictures in zip(rows, streams.values(), strict=True)
                ]
                return compose(shown, white, f"{self.mode}, {self.window} frames about frame {frame}")

            write_picture(folder / "pictures.png", side_by_side(frames[len(frames) // 2]))
            if self.film:
                write_film(folder / "film.mp4", (side_by_side(t) for t in frames), total=len(frames))
            summary = {"file": str(self.file), "mode": self.mode, "window": self.window, "rows": rows}
            write_json(folder / "summary.json", summary)
            written = sorted(path.name for path in folder.iterdir())
        print(table(rows))
        if rows[0]["NIQE"] is None:
            print(f"no NIQE: {why}")
        print(f"wrote {', '.join(written)} in {self.out}")
