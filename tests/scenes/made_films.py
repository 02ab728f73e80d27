"""Films for tests, written by PyAV: of any codec, pixel format, time stamps and tags."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np


def write_film(
    path: Path,
    pictures: Sequence[np.ndarray],
    stored_as: str = "gray",
    codec: str = "ffv1",
    *,
    rate: int = 30,
    ticks: Sequence[int] | None = None,
    time_base: Fraction | None = None,
    options: dict[str, str] | None = None,
    container_format: str | None = None,
    **tags: int,
) -> Path:
    """Pictures as arrays of codes in the pixel format `stored_as`.

    Args:
        ticks: time stamp of each, in units of time_base; default 0, 1, 2 ... of 1 / rate.
        tags: color_trc, color_range, ... by their numbers in H.273.
    """
    with av.open(str(path), "w", format=container_format) as container:
        stream: Any = container.add_stream(codec, rate=rate, options=options or {})
        first = frame_of(pictures[0], stored_as)
        stream.width, stream.height, stream.pix_fmt = first.width, first.height, stored_as
        if time_base is not None:
            stream.codec_context.time_base = stream.time_base = time_base
        for name, number in tags.items():
            setattr(stream.codec_context, name, number)
        for i, picture in enumerate(pictures):
            frame = frame_of(picture, stored_as)
            frame.pts = i if ticks is None else ticks[i]
            frame.time_base = time_base or Fraction(1, rate)
            for name, number in tags.items():
                setattr(frame, name, number)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def greys(codes: Sequence[int], dtype: Any = np.uint8, shape: tuple[int, int] = (32, 32)) -> list[np.ndarray]:
    """A picture of one grey for each code."""
    return [np.full(shape, code, dtype) for code in codes]


def yuv420(luma: np.ndarray, neutral: int) -> np.ndarray:
    """A picture (h, w) as planar YUV 4:2:0 without colour, as PyAV lays it out."""
    h, w = luma.shape
    return np.concatenate([luma, np.full((h // 2, w), neutral, luma.dtype)])


def frame_of(picture: np.ndarray | av.VideoFrame, stored_as: str) -> av.VideoFrame:
    """A picture as PyAV's frame; planar YUV 4:2:0 and 4:2:2 as `yuv420` lays it out."""
    if isinstance(picture, av.VideoFrame):
        return picture
    if not stored_as.startswith(("yuv4", "yuvj")):
        return av.VideoFrame.from_ndarray(picture, format=stored_as)
    rows = 2 if stored_as.startswith("yuv422") else 3 / 2  # of luma and chroma together, for one of luma
    height, width = int(picture.shape[0] / rows), picture.shape[1]
    frame = av.VideoFrame(width, height, stored_as)
    chroma = picture[height:].reshape(2, -1, width // 2)
    for plane, codes in zip(frame.planes, (picture[:height], *chroma), strict=True):
        padded = np.zeros((plane.height, plane.line_size // picture.itemsize), picture.dtype)
        padded[:, : codes.shape[1]] = codes
        plane.update(padded.tobytes())
    return frame
