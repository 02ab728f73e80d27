"""A stream as entries on a timeline: pictures, rates of pixels, figures, statistics; each at its own frame.

- noisy picture: share of the block's frames with a spike (TFP), at the block's middle frame;
- denoised picture: the plane of that frame, which the online denoiser finishes 17 to 32 frames later;
- rate of a pixel [spikes/frame]: both pictures at that pixel;
- spikes a frame: mean over the block's frames and all pixels;
- mean interval [frames]: its inverse.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.cli.live.streams import Block, Stream
from spikecam_env.cli.screen.screen import BRIGHT_PERCENT, display
from spikecam_env.errors import InputError, shown

NOISY, DENOISED = "picture/noisy", "picture/denoised"
TARGET = f"{NOISY}/target"
RATES = "rate [spikes a frame]"

Pixel = tuple[int, int]
"""(row, column)."""


@dataclass(frozen=True)
class TimelineEntry:
    """path: room/name.  frame: of the camera.  value: a picture (H, W) uint8, a number, or a place (x, y) [pixels]."""

    path: str
    frame: int
    value: NDArray[np.uint8] | float | tuple[float, float]


def entries(stream: Stream, pixels: Sequence[Pixel], denoise: bool = True) -> Iterator[TimelineEntry]:
    """Of a stream, block by block; denoised ones follow as they are finished."""
    planes = _Planes() if denoise else None
    white = 0.0
    for block in stream.blocks:
        middle, noisy = block.first + len(block.spikes) // 2, block.spikes.mean(axis=0, dtype=np.float32)
        white = white or float(np.percentile(noisy, BRIGHT_PERCENT)) or float(noisy.max())
        yield from _of_picture(NOISY, "noisy", middle, noisy, pixels, white or 1.0)
        yield from _of_block(block)
        for at, plane in planes.push(middle, block.spikes) if planes else ():
            yield from _of_picture(DENOISED, "denoised", at, plane, pixels, white or 1.0)
    for at, plane in planes.flush() if planes else ():
        yield from _of_picture(DENOISED, "denoised", at, plane, pixels, white or 1.0)


def pixel(text: str, shape: tuple[int, int]) -> Pixel:
    """`row,column`; raises InputError for other text and for a pixel outside of the picture."""
    try:
        row, column = (int(word) for word in text.split(","))
    except ValueError as error:
        raise InputError(f"pixel {shown(text)}; give row,column, e.g. {shape[0] // 2},{shape[1] // 2}") from error
    if not (0 <= row < shape[0] and 0 <= column < shape[1]):
        raise InputError(f"pixel {shown(text)} is outside: rows are 0 to {shape[0] - 1}, columns 0 to {shape[1] - 1}")
    return row, column


def _of_picture(
    path: str, what: str, frame: int, rate: NDArray[np.float32], pixels: Sequence[Pixel], white: float
) -> Iterator[TimelineEntry]:
    yield TimelineEntry(path, frame, display(rate, white))
    for row, column in pixels:
        yield TimelineEntry(f"{RATES}/{row},{column} {what}", frame, float(rate[row, column]))


def _of_block(block: Block) -> Iterator[TimelineEntry]:
    last = block.first + len(block.spikes)
    mean = float(block.spikes.mean())
    yield TimelineEntry("spikes a frame/mean of all pixels", last, mean)
    if mean:
        yield TimelineEntry("mean interval [frames]/mean interval", last, 1 / mean)
    for name, value in block.figures.items():
        yield TimelineEntry(name, last, value)
    if block.target is not None:
        yield TimelineEntry(TARGET, last, block.target)


class _Planes:
    """The online denoiser (`best`), of which the planes of blocks' middle frames are kept."""

    def __init__(self) -> None:
        from denoiser import OnlineDnSS

        self._online: Any = OnlineDnSS.pretrained("best", output="rate")
        self._middles: deque[int] = deque()
        self._ready: int | None = None

    def push(self, middle: int, spikes: NDArray[np.uint8]) -> Iterator[tuple[int, NDArray[np.float32]]]:
        """A block with this middle frame -> (middle, plane) of those that are finished."""
        if self._ready is None:
            self._ready = middle - len(spikes) // 2
        self._middles.append(middle)
        return self._finished(self._online.push(spikes))

    def flush(self) -> Iterator[tuple[int, NDArray[np.float32]]]:
        """The others."""
        return self._finished(self._online.flush()) if self._middles else iter(())

    def _finished(self, planes: NDArray[np.float32]) -> Iterator[tuple[int, NDArray[np.float32]]]:
        first = self._ready or 0
        self._ready = first + len(planes)
        while self._middles and self._middles[0] < self._ready:
            middle = self._middles.popleft()
            yield middle, planes[middle - first]
