"""Scenes that are cut out of films: the same pixels of every picture, one by one, from the film's first picture on.

    light [spikes/frame] = white x the picture's value, linear, at a place that the scene's seed draws

Source of the defaults: R. Zhao et al., Spike Stream Memory Transfer for Dynamic Scene Reconstruction, AAAI-26: films of
REDS, DAVIS and GoPro, 256 x 256 pixels, 221 spike frames, of which pictures are judged every 20 frames.  Our reading: a
picture of the film is 20 spike frames, and white is the 0.6 spikes a frame of Spike-Zoo's clips.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from scenes import VideoScene
from scenes.film import FilmOptions, read_film
from scenes.film.transfer import curve
from spikecam_env.checked import checked_number
from spikecam_env.datasets.spikezoo import RATE, WHITES
from spikecam_env.errors import InputError
from spikecam_env.names import distinct, file_name

FRAMES_A_PICTURE = 20
"""Spike frames from a picture of the film to the next."""
FRAME_RATE_HZ = 40_000.0


@dataclass(frozen=True)
class FilmFolder:
    """A folder of films, and how light is made of them.

    Example:
        >>> from pathlib import Path
        >>> Path("films").mkdir()
        >>> np.save("films/wave.npy", np.random.default_rng(0).random((4, 20, 30)))
        >>> films = FilmFolder(Path("films"))
        >>> films.names()
        ['wave.npy']
        >>> films.cut("wave.npy", seed=0, shape=(8, 16), frames=60, frame_rate_hz=40_000.0).shape
        (8, 16)
    """

    folder: Path
    """Of films, each as `VideoScene` takes them: a video, a folder of pictures, a .csv list or a .npy array."""
    film_rate_hz: float | None = FRAME_RATE_HZ / FRAMES_A_PICTURE
    """Pictures a second; None: by the films' time stamps."""
    transfer: str | None = "linear"
    """From values to light, as `VideoScene` has it; None: that of the files."""
    interpolation: Literal["motion", "linear", "hold"] = "motion"
    """Light between two pictures, as `VideoScene` has it."""
    white: float = RATE
    """Light of the films' full scale [spikes/frame]."""

    def __post_init__(self) -> None:
        checked_number(self.white, "white", *WHITES, unit="spikes/frame")
        if self.transfer is not None:
            curve(self.transfer)

    def names(self) -> list[str]:
        """The films, by their names in the folder.

        Raises:
            InputError: there is no such folder, or it holds no film, or names that no file of a dataset can have.
        """
        if not self.folder.is_dir():
            raise InputError(f"there is no folder {self.folder}; give one of videos, or of folders of pictures")
        names = sorted(path.name for path in self.folder.iterdir() if not path.name.startswith("."))
        if not names:
            raise InputError(f"{self.folder} holds no film; give a folder of videos, or of folders of pictures")
        distinct((file_name(Path(name).stem, "film") for name in names), "film")
        return names

    def cut(self, name: str, seed: int, shape: tuple[int, int], frames: int, frame_rate_hz: float) -> VideoScene:
        """A scene of some pixels of a film.

        Args:
            name: of `names`.
            seed: draws the place.
            shape: (rows, columns) of the scene.
            frames: spike frames that the film has to last.
            frame_rate_hz: of the camera.

        Raises:
            InputError: as `VideoScene`; and a film that is smaller, or shorter.
        """
        path = self.folder / name
        options = FilmOptions(
            transfer=self.transfer, film_rate_hz=self.film_rate_hz, seconds=(frames + 1) / frame_rate_hz
        )
        film = read_film(path, options)
        (high, wide), (rows, columns) = film.light[0].shape, shape
        if high < rows or wide < columns:
            raise InputError(f"{path} has {high} x {wide} pixels; {rows} x {columns} are asked: give a smaller --size")
        rng = np.random.default_rng(seed)
        top, left = int(rng.integers(high - rows + 1)), int(rng.integers(wide - columns + 1))
        scene = VideoScene(
            np.stack([picture[top : top + rows, left : left + columns] for picture in film.light]),
            light=(0.0, self.white),
            frame_rate_hz=frame_rate_hz,
            transfer="linear",
            interpolation=self.interpolation,
            times_s=film.time_s,
        )
        if math.floor(scene.frames + 1e-6) < frames:
            raise InputError(
                f"{path} lasts {scene.frames:.4g} spike frames; {frames} are asked: give fewer --frames, or a lower "
                "--film-rate"
            )
        return scene

    def settings(self) -> dict[str, Any]:
        """How light is made, as plain values, without the place of the folder."""
        return {
            "film_rate_hz": self.film_rate_hz,
            "transfer": self.transfer,
            "interpolation": self.interpolation,
            "white": self.white,
        }
