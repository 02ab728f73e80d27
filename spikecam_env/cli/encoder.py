"""Pictures to H.264, by PyAV."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

CRF = 10
"""Constant rate factor of x264, 0 (lossless) to 51: 10 is visually lossless."""


@contextmanager
def encoder(path: Path, shape: tuple[int, int], fps: float) -> Iterator[Callable[[NDArray[np.uint8]], None]]:
    """Encode a film; it is whole at the end of the block.

    H.264 stores one colour for 2 x 2 pixels, so the film has even sides.  A picture with an odd side is repeated at its
    last row or column, and a warning states the film's size.

    Args:
        path: file to write; its name's ending sets the container.
        shape: (rows, columns) of a picture.
        fps: pictures a second.

    Yields:
        A function that adds a picture, (rows, columns, 3) uint8.

    Raises:
        OSError: the film cannot be written, at once or at the end.
    """
    beyond = [n % 2 for n in shape]
    even = [n + more for n, more in zip(shape, beyond, strict=True)]
    with av.open(path, "w") as container:
        film = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(), options={"crf": str(CRF)})
        film.height, film.width, film.pix_fmt = *even, "yuv420p"

        def add(picture: NDArray[np.uint8]) -> None:
            padded = np.pad(picture, ((0, beyond[0]), (0, beyond[1]), (0, 0)), mode="edge")
            frame = av.VideoFrame.from_ndarray(padded, format="rgb24")
            container.mux(film.encode(frame.reformat(format="yuv420p", interpolation="BICUBIC")))

        yield add
        container.mux(film.encode(None))
    if any(beyond):
        added = " and ".join(name for name, more in zip(("row", "column"), beyond, strict=True) if more)
        warnings.warn(
            f"the film has {even[0]} x {even[1]} pixels, not {shape[0]} x {shape[1]}, as H.264 needs even sides; "
            f"it repeats the last {added}",
            stacklevel=1,
        )
