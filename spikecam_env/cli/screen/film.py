"""Files of pictures, which appear when they are complete: films by PyAV (H.264), GIFs and PNGs."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sized
from contextlib import contextmanager
from fractions import Fraction
from math import ceil
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from tqdm import tqdm

from spikecam_env.whole import check_file, whole_file

CRF = 10
"""Constant rate factor of x264, 0 (lossless) to 51: 10 is visually lossless."""
ROUNDING = 1e-6
"""Of a picture: times that add up to one picture's give one picture."""


class FilmEnd:
    """The end of a screen (`screen.window.End`) that keeps its pictures, each repeated for its time.

    H.264 stores one colour for 2 x 2 pixels, so the film has even sides: a picture with an odd side is repeated at its
    last row or column.

    Args:
        stream: of an open container of PyAV.
        fps: pictures a second.
        bar: of progress.
    """

    closed = False

    def __init__(self, stream: Any, fps: float, bar: Any) -> None:
        self.stream, self.shape = stream, (0, 0)
        self._fps, self._bar = fps, bar
        self._picture: NDArray[np.uint8] | None = None
        self._due, self._count = 0.0, 0

    def show(self, picture: NDArray[np.uint8], seconds: float) -> None:
        """Add a picture (rows, columns, 3) uint8 for so long."""
        if self._picture is None:
            self.shape = picture.shape[0], picture.shape[1]
            self.stream.height, self.stream.width = (n + n % 2 for n in self.shape)
        self._picture = np.pad(picture, (*((0, n % 2) for n in self.shape), (0, 0)), mode="edge")
        self.wait(seconds)

    def wait(self, seconds: float) -> None:
        """Add the last picture for longer; nothing before the first."""
        if self._picture is None:
            return
        self._due += seconds * self._fps
        while self._count < ceil(self._due - ROUNDING):
            frame = av.VideoFrame.from_ndarray(self._picture, format="rgb24")
            self.stream.container.mux(self.stream.encode(frame.reformat(format="yuv420p", interpolation="BICUBIC")))
            self._count += 1
            self._bar.update()

    def taken(self) -> list[str]:
        """Keys that were pressed: none."""
        return []


@contextmanager
def film(path: str | Path, fps: float, *, total: int | None = None, bar: bool = True) -> Iterator[FilmEnd]:
    """A film to show pictures in, an H.264 MP4; it appears whole at the end of the block.

    A warning states the film's size where that is not the pictures'.

    Args:
        path: of the film.
        fps: pictures a second.
        total: number of pictures, for the bar of progress.
        bar: whether there is one.

    Raises:
        OSError: the film cannot be written, at once or at the end.
    """
    rate, options = Fraction(fps).limit_denominator(), {"crf": str(CRF)}
    with (
        whole_file(path) as beside,
        tqdm(desc="film", unit="frame", total=total, leave=False, disable=not bar) as shown,
        av.open(beside, "w") as container,
    ):
        made = FilmEnd(container.add_stream("libx264", rate=rate, options=options, pix_fmt="yuv420p"), fps, shown)
        yield made
        container.mux(made.stream.encode(None))
    _warn_if_padded(made.shape)


def write_film(
    path: str | Path, pictures: Iterable[NDArray[np.uint8]], fps: float = 30.0, total: int | None = None
) -> None:
    """Write pictures, (rows, columns, 3) uint8, as a `film` of so many a second.  total: where they have no length."""
    with film(path, fps, total=len(pictures) if isinstance(pictures, Sized) else total) as made:
        for picture in pictures:
            made.show(picture, 1 / fps)


def write_gif(
    path: str | Path, pictures: Iterable[NDArray[np.uint8]], fps: float = 25.0, total: int | None = None
) -> None:
    """Write (rows, columns, 3) uint8 pictures as an animated GIF of 64 greys; the file appears when it is complete."""
    check_file(path)
    first, *rest = (
        Image.fromarray(picture).convert("L").quantize(64)
        for picture in tqdm(pictures, desc="film", unit="frame", total=total, leave=False)
    )
    with whole_file(path) as beside:
        first.save(beside, save_all=True, append_images=rest, duration=round(1000 / fps), loop=0)


def write_picture(path: str | Path, picture: NDArray[np.uint8]) -> None:
    """Write a grey or RGB uint8 picture as PNG; the file appears whole."""
    with whole_file(path) as beside:
        Image.fromarray(picture).save(beside)


def _warn_if_padded(shape: tuple[int, int]) -> None:
    even = [n + n % 2 for n in shape]
    added = " and ".join(name for name, n in zip(("row", "column"), shape, strict=True) if n % 2)
    if added:
        warnings.warn(
            f"the film has {even[0]} x {even[1]} pixels, not {shape[0]} x {shape[1]}, as H.264 needs even sides; "
            f"it repeats the last {added}",
            stacklevel=1,
        )
