"""A film as a scene: real light, without a truth about motion."""

from __future__ import annotations

from copy import copy
from itertools import pairwise
from os import PathLike
from typing import Literal

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenes.exposure import checked_interval
from scenes.film.between_pictures import Interval
from scenes.film.film_files import FilmOptions, read_film
from scenes.film.transfer import CHANNELS, curve
from scenes.keys import LONGEST_INTERVAL, check_frames, interval_for, paint_keys
from scenes.protocol import Gaze, Truth
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.sensor import Keyframes
from spikecam_env.types import Pictures

INTERPOLATIONS = ("motion", "linear", "hold")
SHORTEST, LONGEST = 0.01, 1e12
"""Of a film [frames].  Shorter ones would turn round many times a frame; the longest takes nine months at 40 kHz."""
MOTION_A_KEY = 1.0
"""Motion between two keys, where it was found [pixels], as far as whole frames allow."""
MOST_INTERVALS = 24
"""Between pictures whose motion is kept for the next call: 130 MB at 250 x 400."""


class VideoScene:
    """Scene: a film, played forth and back without end.

    Truth: radiance alone.  Flow is NaN, for a film does not tell it; all is object 0.  A gaze beyond the edge sees the
    film mirrored.
    Warns where a file holds fewer pictures, or lasts shorter, than it states, and where a video states no transfer.

    Args:
        film: path of a video file, of a folder of pictures, or of a CSV file of name,time_s; or an array, or its .npy
            file, (T, h, w) or (T, h, w, 3: red, green, blue): whole numbers of full scale (uint8, uint16), or floats.
        film_rate_hz: pictures a second when it was taken (a slow-motion film plays slower than that); default: the
            file's time stamps.  An array or a folder needs it, or times_s.
        shape: (rows, columns) of the sensor, filled by the middle of the film, averaged over area; default: its own.
        light: radiance of black and of full scale: (dark, bright); linear light above 1 goes beyond bright.
        gamma: linear light = (value / full scale) ^ gamma; the same as transfer=f"gamma{gamma}", and 1 as "linear".
        most_pictures: that are read, from the first.
        frame_rate_hz: of the sensor.
        transfer: from values to linear light, as `transfer.py` names it: "srgb", "bt709", "gamma2.2", "linear",
            default: that of the file, "gamma2.2" for arrays.
        channel: "luminance", "red", "green" or "blue".
        interpolation: of light in time between two pictures: "motion": carried along the motion that is found between
            them (`found_motion.py`), linear where none is; "linear"; or "hold": the former until the next, within a
            frame.
        times_s: (T,) the time of every picture [s].
        slow: the file plays so many times slower than life: its time stamps are divided by it.
        seconds: of the film's true time to be read; default: all.
        mean_interval: scale the light so that pixels fire every so many frames on average over the film, or over the
            `seconds` of it; default: not.

    Raises:
        InputError: the film cannot be read or has fewer than two pictures, or its time stamps do not rise.  The
            transfer is not read, or not stated with more than 8 bits a value.  A value is out of range.

    Example:
        >>> film = np.stack([np.full((8, 12), value, np.uint8) for value in (0, 255)])
        >>> scene = VideoScene(film, film_rate_hz=1000.0, light=(0.0, 0.6), transfer="linear")
        >>> [round(float(scene.radiance(0, 40).at(frame)[0, 0]), 2) for frame in (0, 20, 40)]
        [0.0, 0.3, 0.6]
    """

    def __init__(
        self,
        film: str | PathLike[str] | NDArray[np.generic],
        film_rate_hz: float | None = None,
        shape: tuple[int, int] | None = None,
        light: tuple[float, float] = (0.0, 0.6),
        gamma: float | None = None,
        most_pictures: int | None = None,
        frame_rate_hz: float = 40_000.0,
        *,
        transfer: str | None = None,
        channel: str = "luminance",
        interpolation: Literal["motion", "linear", "hold"] = "motion",
        times_s: ArrayLike | None = None,
        slow: float = 1.0,
        seconds: float | None = None,
        mean_interval: float | None = None,
    ) -> None:
        _check_numbers(gamma=gamma, frame_rate_hz=frame_rate_hz, film_rate_hz=film_rate_hz, slow=slow, seconds=seconds)
        _check_choices(light, shape, most_pictures, mean_interval, interpolation, channel)
        if sum((film_rate_hz is not None, times_s is not None, slow != 1)) > 1:
            raise InputError("give one of film_rate_hz, times_s and slow; each says by itself when pictures were taken")
        times = None if times_s is None else np.asarray(times_s, np.float64)
        code = _transfer(transfer, gamma)
        how = FilmOptions(shape, code, channel, film_rate_hz, times, slow, most_pictures, seconds)
        with np.errstate(all="ignore"):  # a film too long or too short for any number is refused below
            taken = read_film(film if isinstance(film, (str, PathLike)) else np.asanyarray(film), how)
            end_s = [taken.time_s[-1] + taken.last_s] if interpolation == "hold" else []
            self._knots = np.append(taken.time_s, end_s) * float(frame_rate_hz)
        if not SHORTEST <= self.frames <= LONGEST:
            raise InputError(
                f"the film lasts {self.frames:g} frames of the camera; it must be {SHORTEST:g} to {LONGEST:g}"
            )
        kept = np.float16 if taken.bits <= 8 else np.float32
        span = light[1] - light[0]
        self._light = np.stack([(light[0] + span * picture).astype(kept) for picture in taken.light])
        self._gain = np.float32(1)
        self._hold = interpolation == "hold"
        self._intervals: dict[int, Interval] = {}
        self._rate_hz = taken.rate_hz
        self.shape = (int(self._light.shape[1]), int(self._light.shape[2]))
        self.frame_rate_hz = float(frame_rate_hz)
        self.transfer, self.interpolation = taken.transfer, interpolation
        if mean_interval is not None:
            until = self.frames if seconds is None else min(self.frames, seconds * self.frame_rate_hz)
            self._gain = np.float32(1 / (mean_interval * self._mean(until)))

    def __repr__(self) -> str:
        return f"VideoScene(pictures={self.pictures}, shape={self.shape}, {self.frames_per_picture:g} frames each)"

    def __getstate__(self) -> dict[str, object]:
        """Without the motion that was found, which follows from the pictures."""
        return self.__dict__ | {"_intervals": {}}

    @property
    def pictures(self) -> int:
        """That were read."""
        return len(self._light)

    @property
    def frames_per_picture(self) -> float:
        """Sensor frames from picture to picture; their mean where times are not even."""
        if self._rate_hz is not None:
            return self.frame_rate_hz / self._rate_hz
        return float(self._knots[-1]) / (len(self._knots) - 1)

    @property
    def gain(self) -> float:
        """By which radiance was multiplied, for the mean interval and by `lit`."""
        return float(self._gain)

    @property
    def times_from(self) -> str:
        """How pictures follow each other, in words."""
        if self._rate_hz is not None:
            return f"{self._rate_hz:.6g} pictures a second"
        steps = np.diff(self._knots) / self.frame_rate_hz
        return f"{1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms apart"

    @property
    def frames(self) -> float:
        """Sensor frames of the film played once."""
        return float(self._knots[-1])

    def lit(self, gain: float) -> VideoScene:
        """The same with `gain` times its light."""
        other = copy(self)
        other._gain = self._gain * np.float32(gain)
        return other

    def radiance(self, start: int, stop: int, gaze: Gaze | None = None) -> Keyframes:
        """Keys that cover frames [start, stop], at most 64 apart: the whole frames next to every picture's time, and
        those that keep the motion from key to key small."""
        check_frames(start, stop)
        frame = self._key_frames(start, stop)
        if gaze is not None:
            interval = interval_for(float(np.hypot(*gaze.rate)), 0.6)
            turns = np.arange(start // interval + 1, -(-stop // interval)) * interval
            frame = np.unique(np.concatenate([[start, stop], turns, frame[(frame > start) & (frame < stop)]]))
        return paint_keys(self.shape, frame, lambda t, picture: self._paint(t, gaze, picture))

    def truth(self, frame: float, gaze: Gaze | None = None) -> Truth:
        """Radiance and gaze; flow is NaN."""
        radiance = np.empty(self.shape, np.float32)
        self._paint(frame, gaze, radiance)
        flow = np.full((*self.shape, 2), np.nan, np.float32)
        camera = gaze.at(frame) if gaze else (0.0, 0.0)
        return Truth(radiance, flow, np.zeros(self.shape, np.int32), poses={"camera": camera})

    def _paint(self, frame: float, gaze: Gaze | None, picture: Pictures) -> None:
        place = self._place(frame)
        if self._hold:
            seen = self._picture(min(int(place), self.pictures - 1))
        else:
            before = min(int(place), self.pictures - 2)
            seen = self._interval(before).at(place - before)
        pan, tilt = gaze.at(frame) if gaze else (0.0, 0.0)
        if (pan, tilt) != (0.0, 0.0):
            shift = np.array([[1.0, 0.0, pan], [0.0, 1.0, tilt]])
            flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
            turned = cv2.warpAffine(seen, shift, self.shape[::-1], flags=flags, borderMode=cv2.BORDER_REFLECT)
            seen = np.asarray(turned, np.float32)
        np.multiply(seen, self._gain, out=picture)

    def _picture(self, number: int) -> Pictures:
        """A picture's light; films are kept in half precision, in which nothing is to be computed."""
        return np.asarray(self._light[number].astype(np.float32, copy=False))

    def _interval(self, number: int) -> Interval:
        """From a picture to the next; its motion, if that is wanted and frames of the camera lie between them."""
        found = self._intervals.get(number)
        if found is None:
            pair = self._picture(number), self._picture(number + 1)
            found = Interval.of_film(*pair, moving=self._moves(number))
            self._intervals[number] = found
            for oldest in list(self._intervals)[:-MOST_INTERVALS]:
                self._intervals.pop(oldest, None)
        return found

    def _moves(self, number: int) -> bool:
        return self.interpolation == "motion" and bool(self._knots[number + 1] - self._knots[number] > 1)

    def _place(self, frame: float) -> float:
        """Where in the film a frame is, in pictures and shares of one; it turns round at either end."""
        last = len(self._knots) - 1
        if self._rate_hz is not None:
            return last - abs(frame / self.frames_per_picture % (2 * last) - last)
        end = self.frames
        return float(np.interp(end - abs(frame % (2 * end) - end), self._knots, np.arange(last + 1)))

    def _key_frames(self, start: int, stop: int) -> NDArray[np.int64]:
        """Whole frames that do not depend on where a stream is cut: on both sides of every change, and multiples of 64
        where changes are further apart than that."""
        low, high = start - 2 * LONGEST_INTERVAL, stop + 2 * LONGEST_INTERVAL
        changes = self._changes(low, high)
        inner = np.concatenate([[low - LONGEST_INTERVAL], changes, [high + LONGEST_INTERVAL]])
        grid = np.arange(low // LONGEST_INTERVAL, high // LONGEST_INTERVAL + 1) * LONGEST_INTERVAL
        after = np.searchsorted(inner, grid, "right").clip(1, len(inner) - 1)
        wide = inner[after] - inner[after - 1] > LONGEST_INTERVAL
        frame = np.union1d(changes, grid[wide])
        if self.interpolation == "motion":
            frame = self._with_moving(frame, start, stop)
        first = np.searchsorted(frame, start, "right") - 1
        return np.asarray(frame[first : np.searchsorted(frame, stop) + 1], np.int64)

    def _with_moving(self, frame: NDArray[np.int64], start: int, stop: int) -> NDArray[np.int64]:
        """With keys between, at multiples of a step that the interval's fastest point sets."""
        kept = [frame]
        for begin, end in pairwise(frame):
            if begin < stop and start < end:
                number = min(int(self._place((begin + end) / 2)), self.pictures - 2)
                speed = self._interval(number).fastest / (self._knots[number + 1] - self._knots[number])
                step = interval_for(speed, MOTION_A_KEY)
                if step < LONGEST_INTERVAL:
                    kept.append(np.arange(begin // step + 1, -(-end // step)) * step)
        return np.unique(np.concatenate(kept))

    def _changes(self, low: int, high: int) -> NDArray[np.int64]:
        """The whole frames in [low, high] next to times at which the light takes another course."""
        period = 2 * self.frames
        rounds = np.arange(np.floor(low / period) - 1, np.ceil(high / period) + 1)[:, None] * period
        times = np.concatenate([rounds + self._knots, rounds - self._knots]).ravel()
        times = times[(times > low - 2) & (times < high + 2)]
        near = np.round(times, 6)  # a whole number of frames, but for how it was computed
        sides = [np.ceil(near) - 1, np.floor(near) + 1] if self._hold else []
        frame = np.unique(np.concatenate([np.floor(near), np.ceil(near), *sides])).astype(np.int64)
        return frame[(frame >= low) & (frame <= high)]

    def _mean(self, until: float) -> float:
        """Radiance over the picture and the film's frames 0 to `until`, by the time that each picture has.

        Raises:
            InputError: the film has no light.
        """
        means = np.array([picture.mean(dtype=np.float64) for picture in self._light])
        spans = np.diff(self._knots)
        seen = np.clip(until - self._knots[:-1], 0, spans)
        if self._hold:
            light = seen * means
        else:
            share = seen / spans
            light = seen * (means[:-1] * (1 - share / 2) + means[1:] * share / 2)
        if not light.sum() > 0:
            raise InputError("the film has no light to expose; all its pictures are black")
        return float(light.sum() / seen.sum())


def _check_numbers(**numbers: float | None) -> None:
    for name, value in numbers.items():
        if value is not None and not 0 < value < np.inf:
            raise InputError(f"{name} is {value}; it must be positive and finite")


def _check_choices(
    light: tuple[float, float],
    shape: tuple[int, int] | None,
    most_pictures: int | None,
    mean_interval: float | None,
    interpolation: str,
    channel: str,
) -> None:
    if not 0 <= light[0] < light[1] < np.inf:
        raise InputError(f"light is {light}; it must be (dark, bright) with 0 <= dark < bright")
    if shape is not None and (len(shape) != 2 or min(shape) < 1):
        raise InputError(f"shape is {shape}; it must be (rows, columns), both at least 1")
    if most_pictures is not None and most_pictures < 2:
        raise InputError(f"most_pictures is {most_pictures}; a film has 2 or more")
    if mean_interval is not None:
        checked_interval(mean_interval)
    if interpolation not in INTERPOLATIONS:
        raise unknown_name("interpolation", interpolation, INTERPOLATIONS)
    if channel not in CHANNELS:
        raise unknown_name("channel", channel, CHANNELS)


def _transfer(transfer: str | None, gamma: float | None) -> str | None:
    """The name of the transfer, known, from one of the two options at most."""
    if gamma is not None:
        if transfer is not None:
            raise InputError(f"transfer is {transfer!r} and gamma {gamma}; give one of the two")
        transfer = "linear" if gamma == 1 else f"gamma{float(gamma)!r}"
    if transfer is not None:
        curve(transfer)
    return transfer
