"""Pictures to H.264 by an ffmpeg process; it may run out of disk long after it took a picture, and that is an error."""

from __future__ import annotations

import errno
import os
import subprocess
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
    """A function that adds a picture, (rows, columns, 3) uint8, even sizes; the film is whole at the end of the block.

    shape: (rows, columns).  Raises OSError where ffmpeg fails, at once or at the end.
    """
    source = ("-f", "rawvideo", "-vcodec", "rawvideo", "-s", f"{shape[1]}x{shape[0]}", "-pix_fmt", "rgb24")
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
            pipe.write(np.ascontiguousarray(picture).data)
        except BrokenPipeError:
            _end(process)
            raise OSError("ffmpeg ended before the film did") from None

    try:
        yield add
        _end(process)
    finally:
        process.kill()
        process.communicate()


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
