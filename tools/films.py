"""Films of the documentation, by the commands that the pages show below them.

    python -m tools.films                    those that are not there yet; seconds each
    python -m tools.films --only fan --anew

A film lies where its line on a page says (`tools/site/films.py`), beside its poster, the picture half-way.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import av
import tyro

from spikecam_env.errors import InputError, unknown_name
from spikecam_env.whole import whole_file
from tools.site.films import Line, lines_of, poster_of

DOCS = Path(__file__).parents[1] / "docs"
QUALITY = 75
"""Of posters, JPEG."""


def documented() -> dict[Path, Line]:
    """Every film that a page shows with its command, by the film's file; a film of several pages by the first."""
    found: dict[Path, Line] = {}
    for page in sorted(DOCS.rglob("*.md")):
        for line in lines_of(page.read_text(encoding="utf-8")):
            if line.command:
                found.setdefault((page.parent / line.path).resolve(), line)
    return found


def make(film: Path, command: str) -> None:
    """Run the command in a folder of its own, and put its film where it belongs; it appears whole."""
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "spikecam_env", *shlex.split(command)[1:]]
        if subprocess.run(words, cwd=folder, check=False).returncode:
            raise InputError(f"{command} failed")
        made = Path(folder, film.name)
        if not made.is_file():
            raise InputError(f"{command} makes no {film.name}; name the film of the page by --film")
        with whole_file(film) as beside:
            beside.write_bytes(made.read_bytes())


def write_poster(film: Path) -> None:
    """The picture half-way through the film."""
    with av.open(film) as container:
        pictures = [frame.to_image() for frame in container.decode(video=0)]
    with whole_file(poster_of(film)) as beside:
        pictures[len(pictures) // 2].save(beside, format="JPEG", quality=QUALITY, optimize=True)


def main(only: tuple[str, ...] = (), anew: bool = False) -> None:
    """Make the films that the pages show, and their posters.

    Args:
        only: names of the films to make, e.g. fan.
        anew: make those too that are there.
    """
    by_name = {film.stem: (film, line) for film, line in documented().items()}
    for name in only:
        if name not in by_name:
            raise unknown_name("film", name, by_name)
    for name in only or by_name:
        film, line = by_name[name]
        if anew or not film.is_file():
            make(film, line.command)
        if anew or not poster_of(film).is_file():
            write_poster(film)
            print(f"{film.relative_to(DOCS)}: {film.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    tyro.cli(main)
