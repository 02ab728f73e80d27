"""A film of yours as a scene: light that was really there, without a truth about motion."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from scenes.keys import interval_for, painted
from scenes.protocol import Gaze, Truth
from spikecam_env.errors import InputError
from spikecam_env.sensor import Keyframes

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Of linear red, green and blue.  Source: ITU-R BT.709."""


class VideoScene:
    """Scene: a film, played forth and back without end, its light linear in time between two pictures.

    film           path of a video file that OpenCV reads, or an array (T, h, w) or (T, h, w, 3: red, green, blue):
                   whole numbers of full scale (uint8, uint16), or floats in [0, 1]
    film_rate_hz   pictures a second when it was taken (a slow-motion film plays slower than that); default: what the
                   file says.  An array needs it.
    shape          (rows, columns) of the sensor, filled by the middle of the film, averaged over area; default: its own
    light          radiance of black and of full scale: (dark, bright)
    gamma          of the film: linear light = (value / full scale) ^ gamma; 1 where it is linear already
    most_pictures  leave out what comes later
    frame_rate_hz  of the sensor

    Truth: radiance alone.  Flow is NaN, for a film does not tell it; all is object 0.  A gaze beyond the edge sees the
    film mirrored.
    Errors: InputError for a film that cannot be read or has fewer than two pictures, and a value out of range.
    """

    def __init__(
        self,
        film: str | PathLike[str] | NDArray[np.generic],
        film_rate_hz: float | None = None,
        shape: tuple[int, int] | None = None,
        light: tuple[float, float] = (0.0, 0.6),
        gamma: float = 2.2,
        most_pictures: int | None = None,
        frame_rate_hz: float = 40_000.0,
    ) -> None:
        if not 0 <= light[0] < light[1] < np.inf:
            raise InputError(f"light is {light}; it must be (dark, bright) with 0 <= dark < bright")
        for name, value in {"gamma": gamma, "frame_rate_hz": frame_rate_hz}.items():
            if not 0 < value < np.inf:
                raise InputError(f"{name} is {value}; it must be positive and finite")
        if most_pictures is not None and most_pictures < 2:
            raise InputError(f"most_pictures is {most_pictures}; a film has 2 or more")
        if isinstance(film, (str, PathLike)):
            pictures, rate = _read(Path(film), gamma, shape, most_pictures)
            film_rate_hz = film_rate_hz or rate
        else:
            pictures = _from_array(np.asarray(film), gamma, shape, most_pictures)
        if film_rate_hz is None or not 0 < film_rate_hz < np.inf:
            raise InputError(f"film_rate_hz is {film_rate_hz}; say how many pictures a second were taken")
        self._light = (light[0] + (light[1] - light[0]) * pictures).astype(np.float16)
        self.shape = (int(pictures.shape[1]), int(pictures.shape[2]))
        self.frame_rate_hz = float(frame_rate_hz)
        self.frames_per_picture = self.frame_rate_hz / film_rate_hz

    def __repr__(self) -> str:
        return f"VideoScene(pictures={len(self._light)}, shape={self.shape}, {self.frames_per_picture:g} frames each)"

    def radiance(self, start: int, stop: int, gaze: Gaze | None = None) -> Keyframes:
        """Keys that cover frames [start, stop], one a picture of the film where that is a whole number up to 64."""
        interval = interval_for(1.0, self.frames_per_picture)
        if gaze is not None:
            interval = min(interval, interval_for(float(np.hypot(*gaze.rate)), 0.6))
        return painted(self.shape, start, stop, interval, gaze, lambda t, picture: self._paint(t, gaze, picture))

    def truth(self, frame: float, gaze: Gaze | None = None) -> Truth:
        """Radiance and gaze; flow is NaN."""
        radiance = np.empty(self.shape, np.float32)
        self._paint(frame, gaze, radiance)
        flow = np.full((*self.shape, 2), np.nan, np.float32)
        camera = gaze.at(frame) if gaze else (0.0, 0.0)
        return Truth(radiance, flow, np.zeros(self.shape, np.int32), poses={"camera": camera})

    def _paint(self, frame: float, gaze: Gaze | None, picture: NDArray[np.float32]) -> None:
        last = len(self._light) - 1
        place = last - abs(frame / self.frames_per_picture % (2 * last) - last)
        before = min(int(place), last - 1)
        share = np.float32(place - before)
        seen = self._light[before] * (1 - share) + self._light[before + 1] * share
        pan, tilt = gaze.at(frame) if gaze else (0.0, 0.0)
        if (pan, tilt) != (0.0, 0.0):
            shift = np.array([[1.0, 0.0, pan], [0.0, 1.0, tilt]])
            flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
            seen = cv2.warpAffine(seen, shift, self.shape[::-1], flags=flags, borderMode=cv2.BORDER_REFLECT)
        picture[:] = seen


def _read(
    path: Path, gamma: float, shape: tuple[int, int] | None, most: int | None
) -> tuple[NDArray[np.float32], float | None]:
    """(T, H, W) linear in [0, 1], and the rate that the file says [Hz]."""
    if not path.is_file():
        raise InputError(f"there is no film {path}")
    capture = cv2.VideoCapture(str(path))
    rate = capture.get(cv2.CAP_PROP_FPS) or None
    pictures: list[NDArray[np.float32]] = []
    with tqdm(desc=f"read {path.name}", unit="picture", leave=False) as bar:
        while len(pictures) != most:
            there, bgr = capture.read()
            if not there:
                break
            pictures.append(_fitted(_linear(bgr[..., ::-1], gamma), shape))
            bar.update()
    capture.release()
    if len(pictures) < 2:
        raise InputError(f"{path} holds {len(pictures)} pictures that OpenCV can read; a film needs 2 or more")
    return np.stack(pictures), rate


def _from_array(
    film: NDArray[np.generic], gamma: float, shape: tuple[int, int] | None, most: int | None
) -> NDArray[np.float32]:
    if film.ndim not in (3, 4) or len(film) < 2 or (film.ndim == 4 and film.shape[3] != 3):
        raise InputError(f"the film has shape {film.shape}; it must be (T, h, w) or (T, h, w, 3) with T of 2 or more")
    return np.stack([_fitted(_linear(picture, gamma), shape) for picture in film[:most]])


def _linear(picture: NDArray[np.generic], gamma: float) -> NDArray[np.float32]:
    """(h, w[, 3]) as encoded to (h, w) linear light in [0, 1]."""
    if picture.dtype.kind == "u":
        full = 256**picture.dtype.itemsize - 1
        values = picture.astype(np.float32) / np.float32(full)
    elif picture.dtype.kind == "f":
        values = picture.astype(np.float32)
    else:
        raise InputError(f"the film's values are {picture.dtype}; they must be uint8, uint16, or floats in [0, 1]")
    if not (values.min() >= 0 and values.max() <= 1):
        raise InputError(f"the film's values run from {values.min()} to {values.max()}; floats must lie in [0, 1]")
    light = values ** np.float32(gamma)
    return light if light.ndim == 2 else light @ np.asarray(LUMINANCE, np.float32)


def _fitted(picture: NDArray[np.float32], shape: tuple[int, int] | None) -> NDArray[np.float32]:
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
