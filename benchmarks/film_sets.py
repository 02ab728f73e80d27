"""Whether a set cut out of films is the same work as its scenes: PSNR of TFP and TFI on both, on light [dB].

python -m benchmarks.film_sets                  scenes of the catalogue, and films of them: a picture every 20 frames
python -m benchmarks.film_sets --clips reds     clips of Spike-Zoo, and films of them, by `spikecam dataset films`

The camera is `ideal`.  Pictures of the films of clips are rates of `best` (overlapped), but for the true one in the
middle: they are smoother than the clip's own film, which nobody has.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np
import tyro
from numpy.typing import NDArray
from tqdm import tqdm

from denoiser.evaluate.spikezoo import CLASSICAL, evaluate_spikezoo
from denoiser.online import denoise
from scenes.catalogue import make_scene
from spikecam_env.cli.bench import print_figures
from spikecam_env.datasets import PHM, FilmFolder, build, film_cuts
from spikecam_env.datasets.export import export_spikezoo
from spikecam_env.datasets.films import FRAMES_A_PICTURE
from spikecam_env.datasets.spikezoo import RATE, find_clips, read_clip, write_clip
from spikecam_env.sensor import SensorModel, SpikeSensor

SHAPE, FRAMES, WINDOW, CUTS = (256, 256), 221, 41, 10
"""Of the published sets."""
MEAN_INTERVAL = 6.0
"""Of the scenes [frames]."""
IDEAL = SensorModel.preset("ideal")

Interpolation = Literal["motion", "linear"]
Rows = list[dict[str, Any]]


def of_scenes(names: Iterable[str] = PHM, seed: int = 1) -> Rows:
    """PSNR of scenes before the camera, and of their films, faded and by motion."""
    with TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "films").mkdir()
        for name in tqdm(names, desc="scene", unit="scene", leave=False):
            scene = make_scene(name, SHAPE, seed, mean_interval=MEAN_INTERVAL)
            times = range(0, FRAMES + FRAMES_A_PICTURE, FRAMES_A_PICTURE)
            np.save(place / "films" / f"{name}.npy", np.stack([scene.truth(float(t)).radiance / RATE for t in times]))
            spikes = SpikeSensor(IDEAL, SHAPE, seed).step(scene.radiance(0, FRAMES), FRAMES)
            for frame in list(times)[1 : CUTS + 1]:
                window = spikes[frame - WINDOW // 2 : frame + WINDOW // 2 + 1]
                write_clip(place / "scene", f"{name}-0-{frame}", window, scene.truth(frame + 0.5).radiance)
        cuts = {way: _cut(place, way, SHAPE, FRAMES, WINDOW, CUTS) for way in ("linear", "motion")}
        return _rows({"scene": place / "scene"} | cuts)


def of_clips(clips: Path) -> Rows:
    """PSNR of clips in Spike-Zoo's layout, and of films of them, faded and by motion."""
    with TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "films").mkdir()
        for clip in tqdm(find_clips(clips), desc="clip", unit="clip", leave=False):
            spikes, picture = read_clip(clip)
            film, reach = _film(spikes, picture)
            np.save(place / "films" / f"{clip.name}.npy", film)
        frames = 2 * reach * FRAMES_A_PICTURE
        window = frames - 2 * FRAMES_A_PICTURE + 1
        cuts = {way: _cut(place, way, picture.shape, frames, window, 1) for way in ("linear", "motion")}
        return _rows({"clip": clips} | cuts)


def _film(spikes: NDArray[np.uint8], picture: NDArray[np.float32]) -> tuple[NDArray[np.float32], int]:
    """A picture every 20 frames, the true one in the middle; and how many lie on either side of it."""
    light = np.asarray(denoise(spikes, "best", output="rate", overlap=True)) / RATE
    middle = len(spikes) // 2
    reach = (middle - FRAMES_A_PICTURE) // FRAMES_A_PICTURE
    frames = middle + FRAMES_A_PICTURE * np.arange(-reach, reach + 1)
    return np.stack([picture if frame == middle else light[frame] for frame in frames]).astype(np.float32), reach


def _cut(place: Path, way: Interpolation, shape: tuple[int, ...], frames: int, window: int, clips: int) -> Path:
    """The films' cuts as clips."""
    films, out = FilmFolder(place / "films", interpolation=way), place / f"{way}-cuts"
    rows, columns = shape
    build(film_cuts(films, shape=(rows, columns), frames=frames, truth_every=FRAMES_A_PICTURE, model=IDEAL), out)
    export_spikezoo([out], place / way, frames=window, clips=clips)
    return place / way


def _rows(folders: dict[str, Path]) -> Rows:
    """A row a picture, a column a folder: the mean, and the largest difference of a scene from the first."""
    found = {name: list(_psnr(folder)) for name, folder in folders.items()}
    first, *others = found
    rows: Rows = []
    for row in dict.fromkeys(row for row, _, _ in found[first]):
        by = {name: _by_scene(scores, row) for name, scores in found.items()}
        means = {name: float(np.mean(list(scores.values()))) for name, scores in by.items()}
        off = {f"{n}, most off": max((by[n][s] - by[first][s] for s in by[first]), key=abs) for n in others}
        rows.append({"PSNR [dB]": row, **means, **off})
    return rows


def _psnr(folder: Path) -> Iterator[tuple[str, str, float]]:
    """(row, scene, PSNR) of every clip."""
    for clip in evaluate_spikezoo(folder, (), pictures=CLASSICAL)["clips"]:
        yield clip["row"].removeprefix("noisy "), clip["clip"].partition("-")[0], clip["PSNR"]


def _by_scene(scores: list[tuple[str, str, float]], row: str) -> dict[str, float]:
    scenes = dict.fromkeys(scene for _, scene, _ in scores)
    return {s: float(np.mean([db for found, scene, db in scores if (found, scene) == (row, s)])) for s in scenes}


@dataclass
class FilmSets:
    """Compare sets cut out of films with their scenes."""

    clips: Path | None = None
    """A folder in Spike-Zoo's layout, instead of scenes."""

    def run(self) -> None:
        print_figures(of_scenes if self.clips is None else partial(of_clips, self.clips))


if __name__ == "__main__":
    tyro.cli(FilmSets, description=__doc__).run()
