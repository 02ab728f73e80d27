"""Decoded frames of FFmpeg as numbers: values at full depth, with their meaning as the file states it.

    value = code / full;                                      RGB, grey, and Y of full range; full = 2^bits - 1
    Y = (code - 16 s) / 219 s;  C = (code - 128 s) / 224 s;   limited range, s = 2^(bits - 8)
    R = Y + 2 (1 - kr) Cr;  B = Y + 2 (1 - kb) Cb;  G = (Y - kr R - kb B) / (1 - kr - kb)

FFmpeg lays out every format as one of few, codes unchanged.  Its own step from YUV to RGB is off by up to a code.
Source: ITU-T H.273 (matrices, ranges, and the numbers by which files name matrix, transfer and primaries).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

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
    16: "PQ",
    18: "HLG",
}
"""Transfer by its number in H.273; PQ and HLG are refused."""
UNSTATED = (0, 2)
"""Numbers that say nothing; H.273 has 2, and some files 0."""
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
FLOATS = r"(gray|gbra?p)f(16|32)[bl]e|rgba?f32[bl]e"
"""Pixel formats of FFmpeg that hold floats."""
LAYOUTS = (
    (r"gray((9|1\d)[bl]e)?", "gray16be", ""),
    (r"(yuv|yuyv|uyvy|yvyu|nv|[py][024]1).*(?<!msb[bl]e)", "yuv444p16be", "yuva444p16be"),
    (r"pal8|ya8|0?(rgb|bgr)0?|(rgb|bgr)24|(rgb|bgr)a|a(rgb|bgr)|gbra?p", "rgb24", "rgba"),
    (r"ya16[bl]e|(rgb|bgr)48[bl]e|rgba64[bl]e|gbra?p(9|1\d)[bl]e", "rgb48be", "rgba64be"),
)
"""Formats of whole numbers, and those, without and with alpha, as which PyAV gives the same codes in an array: in the
upper bits of 16, of which FFmpeg fills the lower ones or not."""


@dataclass(frozen=True)
class StoredPicture:
    """A picture as a file stores it."""

    values: Pictures
    """(h, w) or (h, w, 3: red, green, blue) float32; 0..1 of full scale, or floats as they are."""
    transfer: str | None
    """As `scenes.film.transfer` names it; None where the file does not say."""
    primaries: int
    """Their number in H.273."""
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
    is_float = re.fullmatch(FLOATS, frame.format.name) is not None
    bits = 32 if is_float else max(part.bits for part in frame.format.components)
    transfer, primaries = stated_transfer(int(frame.color_trc), bits), int(frame.color_primaries)
    values = _floats(frame) if is_float else _fractions(frame, bits, where)
    if values.shape[2:] == (4,):
        if values[..., 3].min() < 1:
            raise InputError(f"{where}: it has transparent pixels; lay it over a background first")
        values = values[..., :3]
    turns = round(frame.rotation / 90) if turned else 0
    return StoredPicture(np.ascontiguousarray(np.rot90(values, turns)), transfer, primaries, bits)


def stated_transfer(number: int, bits: int) -> str | None:
    """A number of H.273 as `transfer.py` names it, or a name that it refuses; None where the file does not say."""
    if number in UNSTATED:
        return "linear" if bits == 32 else None
    return STATED_TRANSFERS.get(number, f"number {number} of H.273")


def _floats(frame: VideoFrame) -> Pictures:
    """(h, w) or (h, w, 3 or 4) as they are.  Planes of half floats are read here: FFmpeg would cut them off at 1."""
    name, planes = frame.format.name, frame.planes
    order, other = ("be", "le") if frame.format.is_big_endian else ("le", "be")
    if re.match("(gray|gbra?p)f16", name):
        kind = ">f2" if order == "be" else "<f2"
        halves = [np.frombuffer(bytes(p), kind).reshape(p.height, -1)[:, : p.width] for p in planes]
        shown = halves[0] if len(halves) == 1 else np.stack([halves[2], *halves[:2], *halves[3:]], -1)
        return shown.astype(np.float32)
    if any(plane.line_size < 0 for plane in planes):  # PyAV 17 misreads rows from the bottom up; a copy has them down
        name = name.removesuffix(order) + other
    return frame.to_ndarray(format=name).astype(np.float32)


def _fractions(frame: VideoFrame, bits: int, where: str) -> Pictures:
    """Whole numbers over full scale: (h, w) grey, or (h, w, 3 or 4) of red, green, blue and alpha."""
    form = frame.format
    has_alpha = form.has_palette or any(part.is_alpha for part in form.components)
    layout = next((layouts[has_alpha] for known, *layouts in LAYOUTS if re.fullmatch(known, form.name)), None)
    if layout is None:
        raise InputError(f"{where}: its pixels are {form.name}; convert it to RGB or YUV first")
    matrix = _matrix(frame, where) if layout.startswith("yuv") else None
    limited = _is_limited(frame, layout)
    same = LIMITED if limited else FULL
    frame.color_trc = frame.color_primaries = 2  # PyAV 17 lays out no frame with tags that FFmpeg does not know
    codes: NDArray[Any] = frame.to_ndarray(format=layout, src_color_range=same, dst_color_range=same)
    spare = 8 * codes.itemsize - bits
    full, s = 2**bits - 1, 2 ** (bits - 8)
    dark, span = (16 * s, 219 * s) if limited else (0, full)
    levels = np.float32(codes >> spare)
    if matrix is None:
        return np.asarray(((levels - dark) / span).clip(0, 1))
    luma = ((levels[..., :1] - dark) / span).clip(0, 1)
    colour = (np.float32(codes[..., 1:3]) / 2**spare - 128 * s) / (224 * s if limited else full)
    rgb = (luma + colour @ matrix).clip(0, 1)
    return np.concatenate([rgb, levels[..., 3:] / full], -1)


def _is_limited(frame: VideoFrame, layout: str) -> bool:
    """Whether black and white are 16 and 235 of 255."""
    if layout.startswith("yuv"):
        return frame.color_range != FULL and not frame.format.name.startswith("yuvj")
    return frame.color_range == LIMITED and layout.startswith("gray")


def _matrix(frame: VideoFrame, where: str) -> Pictures:
    """(2, 3): red, green and blue of Cb and of Cr."""
    number = int(frame.colorspace)
    if number in UNSTATED:
        number = 1 if frame.height >= HIGH_DEFINITION else 6
    if number not in MATRICES:
        raise InputError(f"{where}: its colours are coded by matrix {number} of H.273; convert it to BT.709 first")
    kr, kb = MATRICES[number]
    red, blue, kg = 2 * (1 - kr), 2 * (1 - kb), 1 - kr - kb
    return np.array([[0, -kb * blue / kg, blue], [red, -kr * red / kg, 0]], np.float32)
