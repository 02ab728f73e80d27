"""Decoded frames of FFmpeg as numbers: values at full depth, with their meaning as the file states it.

    values = code / full scale;                   RGB, grey, and YUV of full range
    Y = (code - 16 s) / 219 s;                    limited range, s = 2^(bits - 8)
    C = (code - 128 s) / 224 s;                   its colour differences Cb, Cr
    R = Y + 2 (1 - kr) Cr;  B = Y + 2 (1 - kb) Cb;  G = (Y - kr R - kb B) / (1 - kr - kb)

Source: ITU-T H.273 (matrices, ranges, and the numbers by which files name matrix, transfer and primaries).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from spikecam_env.errors import InputError
from spikecam_env.types import Pictures

if TYPE_CHECKING:
    from av import VideoFrame

ALONE = {"protocol_whitelist": "none"}
"""Option of FFmpeg: nothing is opened but the file given, whatever it names."""
STATED_TRANSFERS = {
    **dict.fromkeys((1, 6, 14, 15), "bt709"),
    4: "gamma2.2",
    5: "gamma2.8",
    8: "linear",
    13: "srgb",
    16: "pq",
    18: "hlg",
}
"""Transfer by its number in H.273."""
UNSTATED = (0, 2)
"""Numbers that say nothing; H.273 has 2, and some files 0."""
STATED_PRIMARIES = {5: "bt470bg", 6: "smpte170m", 7: "smpte170m", 9: "bt2020", 12: "smpte432"}
"""Primaries by their number in H.273; others are taken as BT.709's."""
MATRICES = {
    1: (0.2126, 0.0722),
    4: (0.30, 0.11),
    **dict.fromkeys((5, 6), (0.299, 0.114)),
    7: (0.212, 0.087),
    9: (0.2627, 0.0593),
}
"""(kr, kb) by the matrix's number in H.273."""
LIMITED, FULL = 1, 2
HIGH_DEFINITION = 720
"""Rows from which a file that states no matrix has BT.709's, and BT.601's below; as players have it."""


@dataclass(frozen=True)
class StoredPicture:
    """A picture as a file stores it."""

    values: Pictures
    """(h, w) or (h, w, 3: red, green, blue) float32; 0..1 of full scale, or floats as they are."""
    transfer: str | None
    """As `scenes.film.transfer` names it; None where the file does not say."""
    primaries: str
    """Likewise, in `LUMINANCE`."""
    bits: int
    """Of a value; 32 for floats."""


def stored(frame: VideoFrame, where: str, turned: bool = True) -> StoredPicture:
    """A decoded frame as numbers, turned upright as the file says unless `turned` is false.

    Raises:
        InputError: the frame has two fields or transparent pixels, or its format or matrix is not read here.  The
            message begins with `where`.
    """
    if frame.interlaced_frame:
        raise InputError(
            f"{where}: it is interlaced, two instants in one picture; make it progressive first, e.g. with "
            "`ffmpeg -i IN -vf bwdif OUT`"
        )
    planes, alpha, bits = _planes(_planar(frame, where))
    if alpha is not None and alpha.min() < 1:
        raise InputError(f"{where}: it has transparent pixels; lay it over a background first")
    if frame.format.name.startswith(("yuv", "nv", "p0", "p2", "p4", "y2")):
        luma, blue, red = planes
        planes = _rgb(luma, blue, red, *_matrix(frame, where))
    values = planes[0] if len(planes) == 1 else np.stack(planes, -1)
    turns = round(frame.rotation / 90) if turned else 0
    return StoredPicture(
        np.ascontiguousarray(np.rot90(values, turns)),
        stated_transfer(int(frame.color_trc), bits),
        stated_primaries(int(frame.color_primaries)),
        bits,
    )


def stated_transfer(number: int, bits: int) -> str | None:
    """A number of H.273 as `transfer.py` names it, or a name that it refuses; None where the file does not say."""
    if number in UNSTATED:
        return "linear" if bits == 32 else None
    return STATED_TRANSFERS.get(number, f"number {number} of H.273")


def stated_primaries(number: int) -> str:
    """A number of H.273 as `scenes.film.transfer.LUMINANCE` names it."""
    return STATED_PRIMARIES.get(number, "bt709")


def _planar(frame: VideoFrame, where: str) -> VideoFrame:
    """The frame in a format with a plane for every component; codes stay as they are."""
    form = frame.format
    if form.is_bayer or form.name.startswith("xyz"):
        raise InputError(f"{where}: its pixels are {form.name}; convert it to RGB or YUV first")
    if form.name.startswith(("gbr", "gray")) or (form.name.startswith("yuv") and form.is_planar):
        if "f16" in form.name:
            return frame.reformat(format=form.name.replace("f16", "f32"))
        if any(plane.line_size < 0 for plane in frame.planes):  # rows from the bottom up; another format is a copy
            return frame.reformat(format=f"{form.name[:-2]}be" if form.name.endswith("le") else f"{form.name}16le")
        return frame
    bits = max(part.bits for part in form.components)
    alpha = "a" if form.has_palette or any(part.is_alpha for part in form.components) else ""
    if form.name.startswith("mono"):
        return frame.reformat(format="gray")
    if form.is_rgb or form.has_palette or form.name.startswith("ya"):
        return frame.reformat(format=f"gbr{alpha}p{'' if bits <= 8 else '16le' if bits <= 16 else 'f32le'}")
    return frame.reformat(format=f"yuv{alpha}444p" if bits <= 8 else f"yuv{alpha}444p{bits}le")


def _planes(frame: VideoFrame) -> tuple[list[Pictures], Pictures | None, int]:
    """Planes of colour or grey, alpha where there is some, all float32 of (h, w); and the bits of a value.

    Grey, red, green, blue and Y are in 0..1, colour differences in -0.5..0.5.
    """
    form = frame.format
    arrays = [_plane(frame, part) for part in form.components]
    bits = max(part.bits for part in form.components)
    if bits == 32:
        return arrays[:3], arrays[3] if len(arrays) == 4 else None, bits
    full = np.float32(2**bits - 1)
    alpha = arrays.pop() / full if form.components[-1].is_alpha else None
    if form.name.startswith("gbr"):
        return [array / full for array in arrays], alpha, bits
    limited = frame.color_range == LIMITED or (
        frame.color_range != FULL and len(arrays) == 3 and not form.name.startswith("yuvj")
    )
    step = np.float32(2 ** (bits - 8))
    luma = (arrays[0] - 16 * step) / (219 * step) if limited else arrays[0] / full
    size, span = (frame.width, frame.height), 224 * step if limited else full
    colour = [cv2.resize((c - 128 * step) / span, size, interpolation=cv2.INTER_LINEAR) for c in arrays[1:]]
    return [luma.clip(0, 1), *colour], alpha, bits


def _plane(frame: VideoFrame, part: Any) -> Pictures:
    """Codes of a component that has a plane of its own."""
    plane = frame.planes[part.plane]
    order = ">" if frame.format.is_big_endian else "<"
    kind = np.dtype("u1" if part.bits <= 8 else f"{order}f4" if part.bits == 32 else f"{order}u2")
    rows = np.frombuffer(plane, kind).reshape(-1, plane.line_size // kind.itemsize)
    return rows[: part.height, : part.width].astype(np.float32)


def _rgb(luma: Pictures, blue: Pictures, red: Pictures, kr: float, kb: float) -> list[Pictures]:
    r = luma + np.float32(2 * (1 - kr)) * red
    b = luma + np.float32(2 * (1 - kb)) * blue
    g = (luma - np.float32(kr) * r - np.float32(kb) * b) / np.float32(1 - kr - kb)
    return [plane.clip(0, 1) for plane in (r, g, b)]


def _matrix(frame: VideoFrame, where: str) -> tuple[float, float]:
    """(kr, kb)."""
    number = int(frame.colorspace)
    if number in UNSTATED:
        number = 1 if frame.height >= HIGH_DEFINITION else 6
    if number not in MATRICES:
        raise InputError(f"{where}: its colours are coded by matrix {number} of H.273; convert it to BT.709 first")
    return MATRICES[number]
