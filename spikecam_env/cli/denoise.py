"""`spikecam denoise`: a recording through the online denoiser."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro


@dataclass
class Denoise:
    """Denoise a recording: writes the denoised stream, a picture before and after, a film and the figures.

    example:  spikecam denoise recording.dat --flip --out denoised
    """

    file: tyro.conf.Positional[Path]
    """.h5 (from `spikecam record`), .npz (a spike array) or .dat (raw Vidar bits)."""
    out: Path = Path("denoised")
    """Folder for denoised.h5, pictures.png, film.mp4 and summary.json."""
    mode: Literal["best", "paper"] = "best"
    """Which DnSS: `best`, or `paper` (the paper's network and decoder; slower)."""
    window: int = 41
    """Frames averaged in the pictures (TFP window); odd."""
    film: bool = True
    """Also write film.mp4, noisy beside denoised."""
    height: int | None = None
    """Rows of a .dat file (250 if not given)."""
    width: int | None = None
    """Columns of a .dat file (400 if not given)."""
    crop_width: int | None = None
    """Columns of a .dat file to keep, where it holds wider rows (416 for 400)."""
    flip: bool = False
    """The file is stored bottom row first (public Vidar files are)."""
    bit_order: Literal["little", "big"] | None = None
    """Which bit of a .dat byte comes first (little if not given)."""
    key: str | None = None
    """Array of an .npz file to read; found by itself where there is only one candidate."""
    time_axis: Literal[0, 1, 2] | None = None
    """Which axis of an .npz array is time; found by itself where that is clear."""

    def run(self) -> None:
        import numpy as np
        from tqdm import tqdm

        from denoiser import OnlineDnSS
        from denoiser.niqe import niqe
        from spikecam_env.cli.files import out_folder, write_json
        from spikecam_env.cli.film import Panel, compose, display, write_film, write_picture
        from spikecam_env.cli.table import table
        from spikecam_env.errors import InputError
        from spikecam_env.streams import SpikeWriter, middleTFP, read_recording

        if self.window < 1 or self.window % 2 == 0:
            raise InputError(f"--window {self.window}; it must be odd and at least 1 (41 is usual)")
        names = ("height", "width", "crop_width", "bit_order", "key", "time_axis")
        options = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        recording = read_recording(self.file, **options, **({"flip": True} if self.flip else {}))
        noisy = recording.spikes
        online = OnlineDnSS.pretrained(self.mode)
        folder = out_folder(self.out)
        parts = []
        with tqdm(total=len(noisy), desc=f"denoise ({self.mode})", unit="frame", leave=False) as bar:
            for start in range(0, len(noisy), 16):
                block = noisy[start : start + 16]
                parts.append(online.push(block))
                bar.update(len(block))
        parts.append(online.flush())
        clean = np.concatenate(parts)

        attributes = {k: v for k, v in recording.attributes.items() if k in ("model", "seed", "scene")}
        attributes |= {"denoiser": self.mode, "source": self.file.name}
        with SpikeWriter(folder / "denoised.h5", clean.shape[1:], recording.frame_rate_hz, **attributes) as writer:
            writer.append(clean)

        middle = len(noisy) // 2
        before, after = middleTFP(noisy, middle, self.window), middleTFP(clean, middle, self.window)
        white = float(np.percentile(before, 99.5)) or 1.0
        try:
            scores: list[float | None] = [niqe(display(picture, white) / 255) for picture in (before, after)]
        except InputError as error:
            scores = [None, None]
            print(f"no NIQE: {error}")
        lines = ["" if score is None else f"NIQE {score:.2f}" for score in scores]

        def panels(frame: int, lines: list[str]) -> list[Panel]:
            return [
                Panel(middleTFP(noisy, frame, self.window), f"noisy, TFP {self.window}", lines[0]),
                Panel(middleTFP(clean, frame, self.window), f"denoised ({self.mode}), TFP {self.window}", lines[1]),
            ]

        write_picture(folder / "pictures.png", compose(panels(middle, lines), white, f"frame {middle}"))
        if self.film:
            at = range(self.window // 2, len(noisy) - self.window // 2, 8)
            write_film(
                folder / "film.mp4",
                (compose(panels(t, ["", ""]), white, f"frame {t}") for t in tqdm(at, desc="film", leave=False)),
            )
        rows = [
            {"stream": name, "spikes/frame": float(s.mean()), f"NIQE (TFP {self.window})": score}
            for name, s, score in (("noisy", noisy, scores[0]), (f"denoised, {self.mode}", clean, scores[1]))
        ]
        write_json(folder / "summary.json", {"file": str(self.file), "latency": online.latency, "streams": rows})
        print(table(rows))
        print(f"wrote {', '.join(sorted(p.name for p in folder.iterdir()))} in {folder}")
