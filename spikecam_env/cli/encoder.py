"""Pictures to H.264 by an ffmpeg process; it may run out of disk long after it took a picture, and that is an error."""

from __future__ import annotations

import errno
import os
import subprocess
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path

import numpy as np
from imageio_ffmpeg import get_ffmpeg_exe
from numpy.typing import NDArray

from spikecam_env.stopping import without_interrupts

CRF = 10
"""Constant rate factor of x264, 0 (lossless) to 51: 10 is visually lossless."""


@contextmanager
def encoder(path: Path, shape: tuple[int, int], fps: float) -> Iterator[Callable[[NDArray[np.uint8]], None]]:
    """Encode a film; it is whole at the end of the block.

    The colours of H.264 that every player shows are stored for 2 x 2 pixels, so the film has even sides.  A picture
    with an odd side is repeated at its last row or column, and a warning states the film's size.

    Args:
        path: file to write; its name's ending sets the container.
        shape: (rows, columns) of a picture.
        fps: pictures a second.

    Returns:
        A function that adds a picture, (rows, columns, 3) uint8.

    Raises:
        OSError: ffmpeg fails, at once or at the end.
    """
    beyond = [n % 2 for n in shape]
    even = [n + more for n, more in zip(shape, beyond, strict=True)]
    source = ("-f", "rawvideo", "-vcodec", "rawvideo", "-s", f"{even[1]}x{even[0]}", "-pix_fmt", "rgb24")
    rate = ("-r", str(Fraction(fps).limit_denominator()))
    coded = ("-an", "-vcodec", "libx264", "-pix_fmt", "yuv420p", "-crf", str(CRF), "-v", "error")
    command = [get_ffmpeg_exe(), "-y", *source, *rate, "-i", "-", *coded, os.fspath(path)]
    with without_interrupts():
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            restore_signals=False,  # else the system kills it where it would get an error to report
        )
    pipe = process.stdin
    if pipe is None:
        raise RuntimeError("a process started with a pipe has one")

    def add(picture: NDArray[np.uint8]) -> None:
        try:
            pipe.write(np.pad(picture, ((0, beyond[0]), (0, beyond[1]), (0, 0)), mode="edge").data)
        except BrokenPipeError:
            _end(process)
            raise OSError("ffmpeg ended before the film did") from None

    try:
        yield add
        _end(process)
    finally:
        process.kill()
        process.communicate()
    if any(beyond):
        added = " and ".join(name for name, more in zip(("row", "column"), beyond, strict=True) if more)
        warnings.warn(
            f"the film has {even[0]} x {even[1]} pixels, not {shape[0]} x {shape[1]}, as H.264 needs even sides; "
            f"it repeats the last {added}",
            stacklevel=1,
        )


def _end(process: subprocess.Popen[bytes]) -> None:
    """Wait until it has written everything; raises OSError where it could not."""
    _, said = process.communicate()
    if process.returncode == 0:
        return
    number = 256 - process.returncode  # ffmpeg ends with -errno
    if number in errno.errorcode:
        raise OSError(number, os.strerror(number))
    lines = said.decode(errors="replace").strip().splitlines()
    raise OSError(f"ffmpeg: {lines[-1] if lines else f'ended with code {process.returncode}'}")
