"""A film as it was taken: linear light of every picture, and the time of each.

A film is a video file, a folder of pictures, a CSV file that lists pictures with their times (`name,time_s`), or an
array.  Times are the file's own time stamps, or those that the user gives; a transfer likewise.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from scenes.film.frames import ALONE, StoredPicture, stored
from scenes.film.pictures import check_size, pictures_in, pictures_timed, read_picture
from scenes.film.transfer import BT709, grey, light_of
from spikecam_env.errors import InputError
from spikecam_env.types import Floats, Pictures
from spikecam_env.untrusted import existing_file

UNSTATED_TRANSFER = "gamma2.2"
"""Of a video file of 8 bits that states none, and of arrays: that of screens."""
MOST_BYTES = 1 << 33
"""Of a film's light in memory: 20 000 pictures of 250 x 400."""
NOT_VIDEO = ("tty", "hls", "concat", "dash")
"""Formats of FFmpeg that draw text, or lead to other files."""


@dataclass(frozen=True)
class FilmOptions:
    """How a film is to be read."""

    shape: tuple[int, int] | None = None
    """(rows, columns) to which each picture is cut and averaged; None: as they are."""
    transfer: str | None = None
    """A name of `scenes.film.transfer`; None: that of the file."""
    channel: str = "luminance"
    """"luminance", "red", "green" or "blue"."""
    film_rate_hz: float | None = None
    """Pictures a second when it was taken; None: by time stamps."""
    times_s: Floats | None = None
    """(T,) a time for every picture; None: by time stamps."""
    slow: float = 1.0
    """The file plays so many times slower than life."""
    most: int | None = None
    """Pictures; None: all."""
    seconds: float | None = None
    """Of the film's true time to be read; None: all."""


@dataclass(frozen=True)
class Film:
    """The pictures of a film, linear, with their times."""

    light: list[Pictures]
    """T pictures (h, w), linear."""
    time_s: Floats
    """(T,) of each from the first."""
    rate_hz: float | None
    """Pictures a second where that is constant."""
    last_s: float
    """For how long the last one is seen."""
    transfer: str
    """By which it was decoded."""
    bits: int
    """Of a value."""


@dataclass
class _Source:
    """Pictures as they come, and facts about them that are known beforehand."""

    pictures: Iterator[tuple[StoredPicture, Fraction | float | None]]
    """Of each, its values and its time [s], None where the source has none."""
    rate: Fraction | None = None
    """Pictures a second that the time stamps are multiples of."""
    tick_s: Fraction = Fraction(0)
    """To which time stamps are rounded [s]."""
    count: int | None = None
    """Pictures, as the file states them."""
    duration_s: float | None = None
    """As the file states it [s]."""
    transfer: str | None = None
    """Of pictures that state none; None: there is no custom."""
    trouble: str = ""
    """Why reading ended early."""
    last_s: float | None = None
    """For how long the last picture is seen."""


def read_film(film: str | PathLike[str] | NDArray[Any], how: FilmOptions) -> Film:
    """The film in a file or folder, or an array (T, h, w) or (T, h, w, 3: red, green, blue).

    Warns where a file holds fewer pictures than it states, and where it states no transfer.

    Raises:
        InputError: it is no film, or has fewer than two pictures or pictures of several sizes.  Time stamps are missing
            or do not rise.  The transfer is unknown, or a file does not state it for values of more than 8 bits.
    """
    if not isinstance(film, np.ndarray) and Path(film).suffix.lower() == ".npy":
        film = _from_disk(Path(film))
    where = "the film" if isinstance(film, np.ndarray) else str(film)
    light: list[Pictures] = []
    stamps: list[Any] = []
    transfer, bits = "", 8
    kind: tuple[Any, ...] = ()
    _check_times(how.times_s, where)
    with (
        _opened(film, how) as source,
        tqdm(desc=f"read {Path(where).name}", unit="picture", leave=False, disable=isinstance(film, np.ndarray)) as bar,
    ):
        ended = True
        for picture, stamp in source.pictures:
            if not light:
                transfer, bits, kind = _transfer(picture, how, source, where), picture.bits, _kind(picture)
            if _kind(picture) != kind:
                raise InputError(
                    f"{where}: picture {len(light) + 1} has shape, bits, transfer {_kind(picture)}, the first {kind}; "
                    "a film has pictures of one kind"
                )
            linear = light_of(picture.values, transfer, f"{where}, picture {len(light) + 1}")
            light.append(fitted(grey(linear, how.channel, picture.primaries), how.shape))
            stamps.append(stamp)
            bar.update()
            if len(light) * light[0].nbytes > MOST_BYTES:
                raise InputError(
                    f"{where} has more than {len(light)} pictures of {light[0].shape}, too many to hold in memory; "
                    "read a part of it (seconds, most_pictures), or at a smaller shape"
                )
            if len(light) == how.most or _past(stamps, how):
                ended = False
                break
    if len(light) < 2:
        raise InputError(
            f"{where} holds {len(light)} pictures that FFmpeg can read; a film needs 2 or more{source.trouble}"
        )
    time_s, rate = _times(stamps, source, how, where)
    last_s = (source.last_s or 0) / how.slow if how.film_rate_hz is None and how.times_s is None else 0
    last_s = last_s or float(time_s[-1] - time_s[-2])
    if ended:
        _warn_if_cut(len(light), float(time_s[-1]) + last_s, source, how, where)
    return Film(light, time_s, rate, last_s, transfer, bits)


def fitted(picture: Pictures, shape: tuple[int, int] | None) -> Pictures:
    """The middle of the picture that has the shape's proportions, at its size."""
    if shape is None or picture.shape == tuple(shape):
        return picture
    rows, columns = picture.shape
    zoom = min(rows / shape[0], columns / shape[1])
    high, wide = max(1, round(zoom * shape[0])), max(1, round(zoom * shape[1]))
    top, left = (rows - high) // 2, (columns - wide) // 2
    way = cv2.INTER_AREA if zoom > 1 else cv2.INTER_LINEAR
    middle = np.ascontiguousarray(picture[top : top + high, left : left + wide])
    return np.asarray(cv2.resize(middle, (shape[1], shape[0]), interpolation=way), np.float32)


# -- where pictures come from ----------------------------------------------------------------------------------


@contextmanager
def _opened(film: str | PathLike[str] | NDArray[Any], how: FilmOptions) -> Iterator[_Source]:
    if isinstance(film, np.ndarray):
        yield _array(film, how)
        return
    path = Path(film)
    try:
        is_folder = path.is_dir()
    except (OSError, ValueError) as error:  # a name too long, or with a zero in it
        raise InputError(f"there is no film {str(path)[:200]!r} ({error})") from error
    if is_folder:
        files = pictures_in(path)
        if how.film_rate_hz is None and how.times_s is None:
            raise InputError(
                f"{path} is a folder of {len(files)} pictures, which have no times; say film_rate_hz, or list them "
                "in a CSV file of name,time_s"
            )
        yield _Source(((read_picture(file), None) for file in files), count=len(files), transfer="srgb")
    elif path.suffix.lower() == ".csv":
        files, times = pictures_timed(path)
        shown = ((read_picture(file), float(time)) for file, time in zip(files, times, strict=True))
        yield _Source(shown, count=len(files), transfer="srgb")
    elif not path.is_file():
        raise InputError(f"there is no film {path}")
    else:
        with _video(path) as source:
            yield source


def _from_disk(path: Path) -> NDArray[Any]:
    """The array of an .npy file, read from disk as it is used."""
    try:
        return np.load(existing_file(path), mmap_mode="r", allow_pickle=False)  # type: ignore[no-any-return]
    except InputError:
        raise
    except Exception as error:  # damaged headers fail in many ways
        raise InputError(f"{path} is not an .npy file of plain numbers ({error})") from error


def _array(film: NDArray[Any], how: FilmOptions) -> _Source:
    if isinstance(film, np.ma.MaskedArray):
        raise InputError("the film is a masked array; fill it first, every pixel has light")
    if film.ndim not in (3, 4) or len(film) < 2 or film.size == 0 or (film.ndim == 4 and film.shape[3] != 3):
        raise InputError(f"the film has shape {film.shape}; it must be (T, h, w) or (T, h, w, 3) with T of 2 or more")
    if film.dtype.kind not in "uf":
        raise InputError(f"the film's values are {film.dtype}; they must be uint8, uint16, or floats in [0, 1]")
    if how.film_rate_hz is None and how.times_s is None:
        raise InputError("film_rate_hz is None; say how many pictures a second were taken, or give times_s")
    bits, full = (32, 1) if film.dtype.kind == "f" else (8 * film.dtype.itemsize, 256**film.dtype.itemsize - 1)
    values = (picture.astype(np.float32) / np.float32(full) for picture in film)
    return _Source((StoredPicture(picture, UNSTATED_TRANSFER, BT709, bits), None) for picture in values)


@contextmanager
def _video(path: Path) -> Iterator[_Source]:
    """A video file by FFmpeg, which opens nothing else that the file may name."""
    import av  # half a second, for those alone who have films

    try:
        with (
            path.open("rb") as file,
            av.open(file, options=ALONE, metadata_errors="replace") as container,
        ):
            streams = [
                s
                for s in container.streams.video
                if s.codec_context is not None and not s.disposition & av.stream.Disposition.attached_pic
            ]
            if not streams or set(container.format.name.split(",")) & set(NOT_VIDEO):
                raise InputError(f"{path} is not a film, or is damaged: it holds 0 pictures that FFmpeg can read")
            stream = streams[0]
            check_size(stream.codec_context.width, stream.codec_context.height, path)
            if (stream.sample_aspect_ratio or 1) != 1:
                warnings.warn(
                    f"{path}: its pixels are not square ({stream.sample_aspect_ratio}); they are taken as if they were",
                    stacklevel=4,
                )
            source = _Source(
                iter(()),
                rate=stream.base_rate,
                tick_s=stream.time_base or Fraction(0),
                count=stream.frames or None,
                duration_s=_duration(container, stream),
                transfer=UNSTATED_TRANSFER,
            )
            source.pictures = _decoded(container, stream, source, path)
            yield source
    except (av.FFmpegError, OSError) as error:
        raise InputError(
            f"{path} is not a film, or is damaged: it holds 0 pictures that FFmpeg can read ({error})"
        ) from error


def _decoded(
    container: Any, stream: Any, source: _Source, path: Path
) -> Iterator[tuple[StoredPicture, Fraction | None]]:
    """Pictures in the order of their times, as far as the file is whole."""
    import av

    try:
        for number, frame in enumerate(container.decode(stream), 1):
            if frame.is_corrupt:
                source.trouble = f"; picture {number} is damaged"
                return
            source.last_s = float(frame.duration * frame.time_base) if frame.duration else None
            stamp = None if frame.pts is None else frame.pts * frame.time_base
            yield stored(frame, f"{path}, picture {number}"), stamp
    except av.FFmpegError as error:
        source.trouble = f"; then the file is damaged ({error.strerror})"


def _duration(container: Any, stream: Any) -> float | None:
    """That the file states [s], of this stream."""
    if stream.duration:
        return float(stream.duration * stream.time_base)
    import av

    return container.duration / av.time_base if container.duration and len(container.streams) == 1 else None


# -- times and transfer --------------------------------------------------------------------------------------------


def _transfer(picture: StoredPicture, how: FilmOptions, source: _Source, where: str) -> str:
    """By which the film is decoded: the user's word, else the file's."""
    stated = how.transfer or picture.transfer
    if stated is not None:
        return stated
    if picture.bits > 8 or source.transfer is None:
        raise InputError(
            f"{where}: its values have {picture.bits} bits and it does not state their transfer; say which it is: "
            "transfer srgb, bt709, gamma2.2 or linear"
        )
    if source.transfer == UNSTATED_TRANSFER:
        warnings.warn(
            f"{where} does not state its transfer; {source.transfer} is taken, as of screens (transfer says another)",
            stacklevel=4,
        )
    return source.transfer


def _kind(picture: StoredPicture) -> tuple[Any, ...]:
    return (picture.values.shape, picture.bits, picture.transfer)


def _past(stamps: list[Any], how: FilmOptions) -> bool:
    """Whether the last picture read lies at or beyond the time that is wanted."""
    if how.seconds is None:
        return False
    last = len(stamps) - 1
    if how.film_rate_hz is not None:
        return last / how.film_rate_hz >= how.seconds
    if how.times_s is not None:
        return last < len(how.times_s) and bool(how.times_s[last] - how.times_s[0] >= how.seconds)
    if stamps[-1] is None or stamps[0] is None:
        return False
    return float(stamps[-1] - stamps[0]) / how.slow >= how.seconds


def _times(stamps: list[Any], source: _Source, how: FilmOptions, where: str) -> tuple[Floats, float | None]:
    """Of the pictures, from the first [s]; and pictures a second where that is constant."""
    if how.film_rate_hz is not None:
        return np.arange(len(stamps)) / how.film_rate_hz, how.film_rate_hz
    if how.times_s is not None:
        cut = how.most is not None or how.seconds is not None
        if len(how.times_s) < len(stamps) or (len(how.times_s) > len(stamps) and not cut):
            raise InputError(
                f"{where}: times_s has shape {how.times_s.shape} for {len(stamps)} pictures; give one for each"
            )
        return how.times_s[: len(stamps)] - how.times_s[0], None
    remedy = "; say film_rate_hz, or give the time of each picture"
    if any(stamp is None for stamp in stamps):
        raise InputError(f"{where}: picture {stamps.index(None) + 1} has no time stamp{remedy}")
    steps = [b - a for a, b in pairwise(stamps)]
    if min(steps) <= 0:
        at = next(i for i, step in enumerate(steps) if step <= 0)
        raise InputError(
            f"{where}: its time stamps do not rise: picture {at + 1} is at {float(stamps[at]):g} s, "
            f"picture {at + 2} at {float(stamps[at + 1]):g} s{remedy}"
        )
    rate = 1 / steps[0] if len(set(steps)) == 1 else source.rate
    if rate and all(_is_tick(stamp - stamps[0], i / rate, source.tick_s) for i, stamp in enumerate(stamps)):
        true_rate = float(rate * Fraction(how.slow))
        return np.arange(len(stamps)) / true_rate, true_rate
    return np.array([float(stamp - stamps[0]) for stamp in stamps]) / how.slow, None


def _is_tick(stamp: Any, time: Any, tick_s: Fraction) -> bool:
    """Whether a time stamp is this time [s], but for both it and the first picture's being rounded to ticks."""
    return bool(stamp == time or abs(stamp - time) < tick_s)


def _check_times(times_s: Floats | None, where: str) -> None:
    """Refuse the user's times where they are not (T,), finite and rising."""
    if times_s is not None and (times_s.ndim != 1 or not np.isfinite(times_s).all() or (np.diff(times_s) <= 0).any()):
        raise InputError(f"{where}: times_s must be finite, and each after the one before; one for each picture")


def _warn_if_cut(pictures: int, end_s: float, source: _Source, how: FilmOptions, where: str) -> None:
    """Warn where the file has fewer pictures, or ends earlier, than it states."""
    stated = source.count or pictures
    if stated <= pictures and source.duration_s is not None and how.film_rate_hz is None and how.times_s is None:
        read_s = end_s * how.slow
        if read_s < source.duration_s - 2 * read_s / pictures:
            stated = round(pictures * source.duration_s / read_s)
    if pictures < stated:
        warnings.warn(
            f"{where} is cut off or damaged: it holds {pictures} of the {stated} pictures that it states"
            f"{source.trouble}; the rest is missing from the light",
            stacklevel=4,
        )
    elif source.trouble:
        warnings.warn(f"{where} is damaged: it holds {pictures} pictures{source.trouble}", stacklevel=4)
