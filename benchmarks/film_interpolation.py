"""Error of a film's light half-way between its pictures: linear in time, and carried along the motion that is found.

python -m benchmarks.film_interpolation                   scenes of the catalogue, at several rates
python -m benchmarks.film_interpolation --film clip.mp4   a film of yours: every second picture is left out

The light between two pictures that are kept is compared with the picture that lies there.  PSNR is of the mean squared
error over picture and film, to the brightest light.  Pictures of scenes show an instant: a film camera blurs them.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from tqdm import tqdm

from scenes import VideoScene
from scenes.catalogue import make_scene
from scenes.film import FilmOptions, read_film
from spikecam_env.bench.machine import FRAME_RATE_HZ, SHAPE
from spikecam_env.cli.bench import print_figures
from spikecam_env.datasets import PHM
from spikecam_env.types import Pictures

RATES_HZ = (60, 240, 1000)
"""Pictures a second that are kept: of films as most are, of a phone's slow motion, of a high-speed camera."""
PICTURES = 9
"""Of a scene, with those that are left out."""
START = 1000
"""Frame of a scene's first picture."""
ANY_RATE_HZ = 1000.0

Rows = list[dict[str, Any]]


def film_interpolation(names: Iterable[str] = PHM, shape: tuple[int, int] = SHAPE) -> dict[str, Rows]:
    """Rows of scenes and rates, and their means by rate."""
    tables: dict[str, Rows] = {}
    cases = [(rate, name) for rate in RATES_HZ for name in names]
    for rate, name in tqdm(cases, desc="film", unit="scene", leave=False):
        scene = make_scene(name, shape)
        step = FRAME_RATE_HZ / rate / 2
        light = np.stack([scene.truth(START + step * number).radiance for number in range(PICTURES)])
        rows = tables.setdefault(f"{rate} pictures a second, PSNR [dB]", [])
        rows.append({"scene": name} | left_out(light, rate))
    for rows in tables.values():
        rows.append({"scene": "mean"} | {key: _mean(rows, key) for key in rows[0] if key != "scene"})
    return tables


def of_film(path: Path, shape: tuple[int, int] = SHAPE) -> Rows:
    """The row of a film, whose rate does not matter."""
    film = read_film(path, FilmOptions(shape=shape, film_rate_hz=ANY_RATE_HZ))
    return [{"film": path.name} | left_out(np.stack(film.light), ANY_RATE_HZ)]


def left_out(light: Pictures, rate_hz: float) -> dict[str, float]:
    """Errors half-way between every second picture.

    Args:
        light: (T, H, W) of all pictures, T odd or even.
        rate_hz: of the pictures that are kept.

    Returns:
        PSNR [dB] by way of interpolation, their difference, and the processor time of a picture along motion, with
        the search for it [ms].
    """
    kept, between = light[::2], light[1::2][: len(light[::2]) - 1]
    full = float(light.max())
    found: dict[str, float] = {}
    for way in ("linear", "motion"):
        scene = VideoScene(kept, rate_hz, light=(0.0, 1.0), transfer="linear", interpolation=way)
        begin = time.process_time()
        shown = [scene.truth((number + 0.5) * scene.frames_per_picture).radiance for number in range(len(between))]
        spent_ms = 1e3 * (time.process_time() - begin) / len(between)
        found[way] = -10 * float(np.log10(max(np.mean(np.square(np.stack(shown) - between)), 1e-12) / full**2))
    return found | {"gain": found["motion"] - found["linear"], "ms a picture": spent_ms}


def _mean(rows: Rows, key: str) -> float:
    return float(np.mean([row[key] for row in rows]))


@dataclass
class Interpolation:
    """Measure both ways of interpolation."""

    film: Path | None = None
    """A film of yours, instead of scenes."""

    def run(self) -> None:
        print_figures(film_interpolation if self.film is None else partial(of_film, self.film))


if __name__ == "__main__":
    tyro.cli(Interpolation, description=__doc__).run()
