"""How large what the pages show is when it is tested, and what stands for files that a reader brings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from spikecam_env.cli.main import run

SIZE = "--size 24 40"
SMALL = {
    "demo": "--size 48 80 --frames 250 --no-open",
    "record": f"{SIZE} --frames 400",
    "film": SIZE,
    "scenes": f"{SIZE} --frames 320",
    "play": "--film played.mp4 --episodes 1",
    "view": f"{SIZE} --frames 80 --save viewed.rrd",
    "dataset spift-n": f"{SIZE} --train 1 --test 1 --frames 320",
    "dataset phm-n": f"{SIZE} --scenes disk --frames 320",
    "campaign simulate": "--shape 16 16 --frames 400",
    "train-agent": "--steps 2 --environments 2",
    "evaluate tasks": "--tasks Catch-v1 --episodes 1",
    "evaluate agents": "--tasks Catch-v1 --observations tracker --seeds 1 --episodes 1 --steps 2",
    "evaluate table1": f"{SIZE} --rows noisy --scenes disk --seeds 1 --frames 200",
}
"""Options that are added to a command, where the line does not give them."""

ONLY_READ = {
    "bench": "measures a machine for minutes",
    "train": "trains for minutes or hours",
    "evaluate quick": "evaluates for minutes",
    "evaluate table2": "evaluates for minutes",
    "evaluate table3": "evaluates for minutes",
    "evaluate table4": "evaluates for minutes",
    "evaluate still": "evaluates for minutes",
    "evaluate truth": "evaluates for minutes",
    "evaluate spikezoo": "evaluates for minutes",
    "diagnose": "diagnoses for minutes",
    "ladder": "diagnoses for minutes",
}
"""Commands that take long at any size: their lines are read by their parser."""


def _film(path: Path) -> None:
    import imageio.v3 as imageio

    pictures = np.random.default_rng(0).integers(0, 255, (9, 48, 80, 3), dtype=np.uint8)
    imageio.imwrite(path, pictures, fps=30)


def _pictures(folder: Path) -> None:
    import imageio.v3 as imageio

    folder.mkdir()
    names = [f"img{i}.png" for i in range(4)]
    for i, name in enumerate(names):
        imageio.imwrite(folder / name, np.full((24, 40), 40 * i, np.uint8))
    rows = (f"{name},{i / 1000}" for i, name in enumerate(names))
    (folder / "times.csv").write_text("\n".join(["name,time_s", *rows]), encoding="utf-8")


def _light(path: Path) -> None:
    np.save(path, np.random.default_rng(0).random((9, 24, 40), np.float32))


def _recording(path: Path) -> None:
    spikes = np.random.default_rng(0).random((128, 250, 400)) < 0.2
    path.write_bytes(np.packbits(spikes.reshape(128, -1), axis=1, bitorder="little").tobytes())


def _campaign(folder: Path) -> None:
    levels = [word for level in ("0.1", "0.2", "0.4") for word in ("--recording", f"flat:radiance={level}")]
    simulate = ["campaign", "simulate", str(folder), "--shape", "16", "16", "--frames", "800"]
    assert run([*simulate, "--recording", "dark", *levels]) == 0


BROUGHT: dict[str, Callable[[Path], None]] = {
    "clip.mp4": _film,
    "street.mp4": _film,
    "pictures": _pictures,
    "light.npy": _light,
    "recording.dat": _recording,
    "CAMPAIGN": _campaign,
    "camera-17": _campaign,
}
"""What a reader brings, by the names that pages give it; made where a block names it."""
