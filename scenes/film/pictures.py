"""Picture files: one as it is stored, and a folder or a list of them as the pictures of a film.

Pillow decodes files of 8 bits a value, FFmpeg those of more (PNG and TIFF of 16 bits, EXR, HDR).  The orientation that
EXIF states holds.  Colour profiles (ICC) are not read.
"""

from __future__ import annotations

import re
import warnings
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError

from scenes.film.frames import ALONE, StoredPicture, stated_transfer, stored
from spikecam_env.errors import InputError
from spikecam_env.types import Floats, Pictures
from spikecam_env.untrusted import existing_file, read_table

MOST_PICTURE_PIXELS = 1 << 27
"""Pixels of the largest picture that is decoded: 16 384 x 8192, some 1.6 GB as linear colour."""
SUFFIXES = (
    *(".bmp", ".dpx", ".exr", ".hdr", ".jp2", ".jpeg", ".jpg", ".pbm", ".pfm", ".pgm", ".png", ".pnm", ".ppm", ".tga"),
    *(".tif", ".tiff", ".webp"),
)
"""Of the files in a folder of pictures."""
NO_PICTURES = ("Thumbs.db", "desktop.ini")
"""That Windows leaves in folders."""
LISTED = ("name", "time_s")
"""Columns of a list of pictures."""
BY_FFMPEG = (".dpx", ".exr", ".hdr", ".pfm", ".tif", ".tiff")
"""Files that Pillow may not know."""
SRGB_GAMMA = 2.2
"""A PNG that states this power, within 2 %, is an sRGB one.  Source: the PNG specification, table of sRGB's gAMA."""


def read_picture(path: str | PathLike[str]) -> StoredPicture:
    """A picture file, upright.

    Raises:
        InputError: the file is missing, damaged, no picture or larger than MOST_PICTURE_PIXELS, or it holds several
            pictures or transparent pixels.
    """
    source = existing_file(Path(path))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(source) as image:
                return _by_pillow(image, source)
    except UnidentifiedImageError as error:
        if source.suffix.lower() not in BY_FFMPEG:
            raise InputError(f"{source} is not a picture; give the path of a png, jpg or tif file") from error
        return _by_ffmpeg(source)
    except InputError:
        raise
    except (MemoryError, Image.DecompressionBombError) as error:
        raise InputError(f"{source} is too large a picture ({error}); make it smaller first") from error
    except Exception as error:  # the many ways in which a damaged picture fails: OSError, SyntaxError, ...
        raise InputError(f"{source} is damaged or not a picture ({error})") from error


def pictures_in(folder: Path) -> list[Path]:
    """The pictures of a folder by the numbers in their names: img2 before img10.

    Raises:
        InputError: a file is no picture, there are fewer than two, or their numbers have a gap.
    """
    try:
        files = [p for p in folder.iterdir() if not p.name.startswith(".") and p.name not in NO_PICTURES]
    except OSError as error:
        raise InputError(f"cannot read the folder {folder}: {error.strerror}") from error
    odd = sorted(p.name for p in files if not p.is_file() or p.suffix.lower() not in SUFFIXES)
    if odd:
        raise InputError(
            f"{folder} holds {odd[0]}{f' and {len(odd) - 1} more' if odd[1:] else ''}, which is no picture; "
            "give a folder of pictures alone, or a CSV file of name,time_s"
        )
    files.sort(key=lambda p: _natural(p.name))
    if len(files) < 2:
        raise InputError(f"{folder} holds {len(files)} pictures; a film needs 2 or more")
    _no_gap(folder, files)
    return files


def pictures_timed(listing: Path) -> tuple[list[Path], Floats]:
    """The pictures that a CSV file with the columns name and time_s lists, in its folder, and the time of each [s].

    Raises:
        InputError: columns differ, a time is no number or not after the one before, or a name leads out of the folder
            or to no file.  The message has the line.
    """
    folder = listing.parent.resolve()
    files: list[Path] = []
    times: list[float] = []
    for line, row in read_table(listing, LISTED, needed=LISTED):
        where = f"{listing}, line {line}"
        if len(row) != len(LISTED):
            raise InputError(f"{where} has {len(row)} entries; it must have a name and a time in seconds")
        name = row["name"]
        if not name.isprintable():
            raise InputError(f"{where}: the name is {name!r}; it must be printable")
        file = (folder / name).resolve()
        if not file.is_relative_to(folder):
            raise InputError(f"{where}: {name!r} leads out of the list's folder; put the pictures beside the list")
        files.append(existing_file(file))
        times.append(_time(row["time_s"], times, where))
    if len(files) < 2:
        raise InputError(f"{listing} lists {len(files)} pictures; a film needs 2 or more")
    return files, np.array(times)


def _by_pillow(image: Any, source: Path) -> StoredPicture:
    check_size(image.width, image.height, source)
    if getattr(image, "n_frames", 1) > 1 and image.format != "MPO":
        raise InputError(f"{source} holds {getattr(image, 'n_frames', 0)} pictures; give a file of one")
    deep = _deep(image)
    transfer, primaries = _stated(image, source)
    turn = int(image.getexif().get(0x0112, 1))
    image.load()
    if deep:
        whole = _by_ffmpeg(source)
        values, bits, transfer = whole.values, whole.bits, whole.transfer or transfer
    else:
        values, bits = _values(image, source)
    return StoredPicture(_upright(values, turn), "linear" if bits == 32 else transfer, primaries, bits)


def _values(image: Image.Image, source: Path) -> tuple[Pictures, int]:
    """0..1, or floats as they are; and the bits of a value."""
    if image.mode.startswith("I;16") or (image.mode == "I" and image.format in ("PNG", "PPM")):
        return np.asarray(image, np.float32) / np.float32(65535), 16
    if image.mode == "F":
        return np.asarray(image, np.float32), 32
    if image.mode == "I":
        raise InputError(f"{source} has whole numbers of 32 bits; save it with 16 bits, or as floats")
    if "transparency" in image.info or image.mode in ("LA", "La", "PA", "RGBA", "RGBa"):
        image = image.convert("RGBA")
        if int(np.asarray(image)[..., 3].min()) < 255:
            raise InputError(f"{source} has transparent pixels; lay it over a background first")
    if image.mode not in ("L", "RGB"):
        image = image.convert("L" if image.mode == "1" else "RGB")
    return np.asarray(image, np.float32) / np.float32(255), 8


def _by_ffmpeg(source: Path) -> StoredPicture:
    """A picture as it lies in the file; its orientation is not looked at."""
    import av  # half a second, for those alone who have such pictures

    try:
        with source.open("rb") as file, av.open(file, "r", options=ALONE, metadata_errors="replace") as container:
            context = container.streams.video[0].codec_context
            context.options = {"max_pixels": str(MOST_PICTURE_PIXELS)}
            check_size(context.width, context.height, source)
            for frame in container.decode(video=0):
                return stored(frame, str(source), turned=False)
    except (av.FFmpegError, IndexError, ValueError, MemoryError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{source} is damaged or not a picture ({error})") from error
    raise InputError(f"{source} holds no picture")


def check_size(width: int, height: int, source: Path | str) -> None:
    """Refuse more than MOST_PICTURE_PIXELS."""
    if width * height > MOST_PICTURE_PIXELS:
        raise InputError(
            f"{source} has {height} x {width} pixels; at most {MOST_PICTURE_PIXELS} are read, make it smaller first"
        )


def _deep(image: Any) -> bool:
    """Whether its colours have more than 8 bits, of which Pillow would keep 8.

    Pillow's plan of decoding says so: `RGB;16B` in PNG and TIFF, the highest value in PPM.
    """
    if not image.mode.startswith("RGB") or not image.tile:
        return False
    plan = image.tile[0].args
    raw, *more = (plan,) if isinstance(plan, str) else plan
    return "16" in str(raw) or (image.format == "PPM" and int(more[0]) > 255)


def _stated(image: Image.Image, source: Path) -> tuple[str | None, int]:
    """Transfer and primaries that a PNG states (cICP, sRGB, gAMA); (None, 1) where it does not."""
    if image.format != "PNG":
        return None, 1
    with source.open("rb") as file:
        head = file.read(1 << 16)
    place = head.find(b"cICP")
    if 0 < place < head.find(b"IDAT"):
        return stated_transfer(head[place + 5], 8), head[place + 4]
    gamma = image.info.get("gamma")
    if "srgb" in image.info or not gamma or abs(1 / gamma / SRGB_GAMMA - 1) < 0.02:
        return ("srgb" if "srgb" in image.info or gamma else None), 1
    return f"gamma{1 / gamma:.4f}", 1


def _upright(values: Pictures, orientation: int) -> Pictures:
    """A picture (h, w[, 3]) turned as EXIF's orientation 1..8 says (2, 4, 5, 7 are mirrored)."""
    if orientation in (2, 4, 5, 7):
        values = values[:, ::-1]
    turns = {3: 2, 4: 2, 5: 1, 6: 3, 7: 3, 8: 1}.get(orientation, 0)
    return np.ascontiguousarray(np.rot90(values, turns))


def _natural(name: str) -> list[tuple[int, int, str]]:
    """A key that sorts numbers in names by their value."""
    return [(1, int(part), "") if part.isdigit() else (0, 0, part) for part in re.split(r"(\d+)", name.lower())]


def _no_gap(folder: Path, files: list[Path]) -> None:
    """Refuse names whose last numbers rise by one step but for some: a picture is missing."""
    numbers = [re.findall(r"\d+", p.stem) for p in files]
    if not all(numbers):
        return
    last = [int(found[-1]) for found in numbers]
    steps = [b - a for a, b in pairwise(last)]
    usual = min(steps)
    for (a, b), step in zip(pairwise(files), steps, strict=True):
        if usual > 0 and step != usual:
            raise InputError(
                f"{folder}: between {a.name} and {b.name} the numbers rise by {step}, elsewhere by {usual}; a picture "
                "seems missing.  Give the time of each in a CSV file of name,time_s"
            )


def _time(text: str, before: list[float], where: str) -> float:
    try:
        time = float(text)
    except ValueError as error:
        raise InputError(f"{where}: the time is {text!r}; it must be a number of seconds") from error
    if not np.isfinite(time) or (before and time <= before[-1]):
        raise InputError(f"{where}: the time is {text} s; it must be finite and after the one before")
    return time
