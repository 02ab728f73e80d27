"""`spikecam scenes`: the catalogue of scenes, pictures of them and films."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import tyro

from spikecam_env.cli.options import Size
from spikecam_env.cli.without_effect import WithoutEffect
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.numbers import Count, Seed

SHOWN_AT = 500
"""Frame of which the sheet has pictures."""
COLUMNS = 4
FILM_FPS = 25
MOST_PICTURES = 90_000
"""Of a film: an hour."""


@dataclass
class Scenes:
    """List the scenes, put pictures of them on a sheet, or film one in slow motion.

    example:  spikecam scenes disk --film disk.mp4
              spikecam scenes --out sheet.png
    """

    name: tyro.conf.Positional[str | None] = None
    """A scene; default all."""
    out: Path | None = None
    """Write a picture (PNG) of the scene, or of all on one sheet."""
    film: Path | None = None
    """Write a film (.mp4 or .gif) of the scene's light."""
    size: Size = (250, 400)
    """Rows and columns."""
    seed: Seed = 0
    """Seed of textures and starting poses; `random` is another world for each seed."""
    frames: Count = 4000
    """Length of the film in frames of the camera; 40 000 are a second."""
    every: Count = 32
    """Camera frames from picture to picture: 32 is 50 times slower than life at 25 pictures a second."""

    without_effect: ClassVar = (
        WithoutEffect(("frames", "every"), lambda c: c.film is None, "it is of a film, and there is no --film"),
        WithoutEffect(
            ("size", "seed"), lambda c: c.film is None and c.out is None, "there is no picture without --film or --out"
        ),
    )

    def run(self) -> None:
        from scenes.catalogue import SCENES
        from spikecam_env.cli.files import check_place

        if self.name not in (None, *SCENES):
            raise unknown_name("scene", self.name, SCENES)
        if min(self.size) < 8:
            raise InputError(f"--size {self.size[0]} {self.size[1]}; at least 8 rows and 8 columns")
        check_place("film", self.film, ".mp4", ".gif")
        check_place("out", self.out, ".png")
        if self.film is not None:
            self._write_film(self.film)
        if self.out is not None:
            self._write_sheet(self.out)
        if self.film is None and self.out is None:
            for name in (self.name,) if self.name else SCENES:
                print(f"{name:10} {about(name)}")

    def _write_film(self, path: Path) -> None:
        from spikecam_env.cli.screen.film import write_film, write_gif

        if self.name is None:
            raise InputError(f"which scene? spikecam scenes NAME --film {path}; `spikecam scenes` lists the names")
        at = range(0, self.frames, self.every)
        if len(at) > MOST_PICTURES:
            raise InputError(
                f"{len(at)} pictures (--frames {self.frames}, --every {self.every}); at most {MOST_PICTURES}"
            )
        write = write_gif if path.suffix.lower() == ".gif" else write_film
        write(path, self._pictures(at), FILM_FPS, len(at))
        slower = 40_000 / (FILM_FPS * self.every)
        print(f"wrote {path}: {1e3 * self.frames / 40_000:g} ms of {self.name}, {slower:g} times slower than life")

    def _pictures(self, at: range) -> Any:
        """The light that the sensor gets at these frames, white the brightest hundredth of the first picture's."""
        import numpy as np

        from spikecam_env.cli.screen.screen import display, white_of

        scene, white = self._scene(self.name), None
        for frame in at:
            light = scene.radiance(frame, frame + 1).at(frame)
            white = white or white_of(light)
            yield np.repeat(display(light, white)[..., None], 3, axis=2)

    def _write_sheet(self, path: Path) -> None:
        from tqdm import tqdm

        from scenes.catalogue import SCENES
        from spikecam_env.cli.screen.film import write_picture
        from spikecam_env.cli.screen.screen import PicturePanel, compose, white_of

        names = (self.name,) if self.name else SCENES
        panels = []
        for name in tqdm(names, desc="scenes", unit="scene", leave=False):
            light = self._scene(name).truth(SHOWN_AT).radiance
            panels.append(PicturePanel(light / white_of(light), name, about(name).partition(": ")[2]))
        write_picture(path, compose(panels, columns=COLUMNS))
        print(f"wrote {path}: {len(names)} scene{'s' if len(names) > 1 else ''}")

    def _scene(self, name: str | None) -> Any:
        from scenes.catalogue import make_scene

        return make_scene(str(name), self.size, self.seed)


def about(name: str) -> str:
    """A scene's line: the first sentence of its file."""
    from scenes.catalogue import SCENES

    described = sys.modules[SCENES[name].__module__].__doc__ or ""
    return described.splitlines()[0].partition(".  ")[0].rstrip(".")
