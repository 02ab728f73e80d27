"""Commands as a user starts them, their errors, and the films and pictures that they write."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
from PIL import Image

from spikecam_env.cli.first_words import commands_of
from spikecam_env.cli.main import COMMANDS, run


def spikecam(*words: object) -> int:
    """Run a command line; returns its exit code."""
    return run([str(word) for word in words])


def every_command() -> dict[str, type]:
    """Classes of all commands, those of groups among them, by their words."""
    found = {}
    for name, options in COMMANDS.items():
        below = commands_of(options)
        found |= {f"{name} {word}": kind for word, kind in below.items()} or {name: options}
    return found


def said(error: str) -> list[str]:
    """Lines on standard error that are no progress bars."""
    lines = [part for line in error.splitlines() for part in line.split("\r")]
    return [
        line for line in lines if line.strip() and "%|" not in line and "it/s" not in line and "frame/s" not in line
    ]


def film_in(path: Path) -> list[np.ndarray]:
    """Pictures (rows, columns, 3) uint8 of a film."""
    with av.open(path) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def picture_in(path: Path) -> np.ndarray:
    """A picture, (rows, columns) or (rows, columns, 3) uint8."""
    return np.asarray(Image.open(path))
