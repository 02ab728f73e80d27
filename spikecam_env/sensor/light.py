"""Light over time, and how a pixel integrates it: the exact law that every engine shares.

Radiance is relative: 1.0 makes the nominal pixel fire once a frame.  It is given at keys, at any times, and linear
between them; frame n integrates over [n, n+1).  A frame that holds keys inside gets the exact mean of its light
(`between_keys`, float64, rounded to float32); of the frames between two keys the light is a ramp.

Collected light is counted in *grains*, GRAINS = 2^23 to a pixel's own threshold (0.004 electrons: finer than
anything physical), in whole numbers.  Within a key interval of n frames whose light goes from i0 to i1 grains
a frame, the grains collected before frame k are

    F(k) = i0 k + (i1 - i0) k^2 / 2n = i0 k + B k^2 + r k^2 / 2n;        i1 - i0 = 2 n B + r

in 32-bit integer arithmetic, rounded down, so engines that compute it in closed form or frame by frame give the same
bits.  F never falls, down to single grains: 1/2n is taken in 2^-18, rounded up.

Rounding: at most half a grain a frame of light that is steady, or has keys inside the frame; of a ramp a grain more a
segment.  Where every frame is a ramp of its own that is a quarter of a grain less on average: 3e-4 of light that takes
10 000 frames to a spike.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.compiled import njit
from spikecam_env.errors import InputError
from spikecam_env.sensor.between_keys import key_weights
from spikecam_env.sensor.ground.intrinsics import use_widest_vectors
from spikecam_env.types import Floats, Pictures

GRAINS = 1 << 23
"""Grains of charge to one threshold."""

MAX_GRAINS_PER_FRAME = 2 * GRAINS
"""Light is capped at two thresholds a frame: from one on, a pixel fires in every frame anyway."""

MOST_GRAINS = 128 * GRAINS
"""Charge of a frame at most, whatever effects add to light and dark: below twice that, sums on the fast engine's grid
are exact, and a frame's crossings are few."""


def on_grid(charge: Any) -> Any:
    """Charge [grains] to 2^-20 of a grain: sums of such, below 256 thresholds, are exact in whatever order."""
    return (charge + _ROUNDS) - _ROUNDS


_ROUNDS = 1.5 * 2.0**32
"""Added to a number below 2^31 and taken off again, it rounds to 2^-20."""

LEAST_LIMIT = GRAINS // 64
"""Charge at which a comparator trips at least, however far noise moves its reference down: each crossing takes some."""

LAST_FRAME = float(1 << 53)
"""Whole frame numbers beyond it are not exact in double precision."""

MAX_SEGMENT = 64
"""Longest key interval [frames] integrated as one ramp; longer ones are divided."""


@dataclass(frozen=True)
class Keyframes:
    """Radiance at key frames, linear between them, constant outside.

    Light is integrated over each frame exactly, whatever the times of its keys.  Frames between two keys are
    integrated in one go, up to 64 of them; a frame with keys inside it takes a pass of its own.  For light that jumps
    see `steps`.

    Raises:
        InputError: for other shapes, unordered frames, values that are no light (see `light_values`), and radiance
            that is negative or not finite.
    """

    frame: Floats
    """(K,) float64, strictly increasing [frames]."""
    radiance: Pictures
    """(K, H, W) float32, >= 0.  A C-contiguous float32 array is kept, not copied: later changes of it act."""

    def __post_init__(self) -> None:
        frame = real_numbers(self.frame, "Keyframes.frame", "iuf").astype(np.float64)
        radiance = light_values(self.radiance)
        if frame.ndim != 1 or radiance.ndim != 3 or len(radiance) != len(frame) or not (frame.size and radiance.size):
            raise InputError(
                f"Keyframes need frame (K,) and radiance (K, H, W) with K >= 1; got {frame.shape} and {radiance.shape}"
            )
        if not np.all(np.isfinite(frame)) or np.any(np.diff(frame) <= 0):
            raise InputError("Keyframes.frame must be finite and strictly increasing; sort it and drop repeats")
        if np.abs(frame).max() > LAST_FRAME:
            raise InputError(f"Keyframes.frame reaches {np.abs(frame).max():g}; whole frames are exact to 2^53")
        check_radiance(radiance)
        object.__setattr__(self, "frame", frame)
        object.__setattr__(self, "radiance", radiance)

    @classmethod
    def known(cls, frame: Floats, radiance: Pictures) -> Keyframes:
        """Keyframes without checks, for a scene's own light: checks take a sixth of the time of painting."""
        keys = object.__new__(cls)
        object.__setattr__(keys, "frame", frame)
        object.__setattr__(keys, "radiance", radiance)
        return keys

    @property
    def on_device(self) -> bool:
        """Whether the radiance is a torch tensor, as `known` takes it too: light for `SpikeSensorBatch` alone."""
        return not isinstance(self.radiance, np.ndarray)

    @classmethod
    def steps(cls, frame: ArrayLike, radiance: ArrayLike) -> Keyframes:
        """Light that jumps: radiance[i] (H, W) from frame[i] until frame[i + 1], the first one also before.

        Args:
            frame: (K,) as of Keyframes; each jump becomes two keys, at its time and at the number just below.
            radiance: (K, H, W) as of Keyframes.

        Example:
            >>> light = Keyframes.steps([0.0, 100.75], [[[0.0]], [[1.0]]])
            >>> float(light.at(100.7)[0, 0]), float(light.at(100.75)[0, 0])
            (0.0, 1.0)
        """
        given = cls(frame, light_values(radiance))  # type: ignore[arg-type]
        jumps = given.frame[1:]
        times = np.stack([np.nextafter(jumps, -np.inf), jumps], axis=1).reshape(-1)
        keys = np.repeat(np.arange(given.frame.size), 2)[:-1]
        return cls(np.concatenate([given.frame[:1], times]), given.radiance[keys])

    def at(self, frame: float) -> Pictures:
        """Radiance (H, W) at an instant [frames]; a frame collects the mean over it."""
        if frame <= self.frame[0]:
            return self._picture(0)
        if frame >= self.frame[-1]:
            return self._picture(-1)
        i = int(np.searchsorted(self.frame, frame, side="right")) - 1
        w = np.float32((frame - self.frame[i]) / (self.frame[i + 1] - self.frame[i]))
        if w == 0.0:
            return self._picture(i)
        between: Pictures = self.radiance[i] * (np.float32(1.0) - w) + self.radiance[i + 1] * w
        return between

    def _picture(self, key: int) -> Pictures:
        picture: Pictures = self.radiance[key]
        return picture


def light_values(values: ArrayLike) -> Pictures:
    """Light as C-contiguous float32; InputError for whole numbers (pictures, no light) and as `real_numbers`."""
    array = real_numbers(values, "radiance", "f")
    with np.errstate(over="ignore"):  # beyond float32 is infinity, which is refused as such
        return np.ascontiguousarray(array, dtype=np.float32)


def real_numbers(values: ArrayLike, name: str, kinds: str) -> NDArray[Any]:
    """An array of real numbers.

    Args:
        kinds: numpy's letters of allowed types.

    Raises:
        InputError: for others, such as True, text, objects, complex or ragged ones, and where some are masked.
    """
    if _masks_some(values):
        raise InputError(f"{name} is masked in part; fill it first, e.g. with .filled(0.0)")
    try:
        array = np.asarray(values)
    except (ValueError, TypeError, RuntimeError) as error:
        raise InputError(f"{name} is no array of numbers: {error}") from error
    if array.dtype.kind in kinds:
        return array
    if array.dtype.kind in "iu":
        raise InputError(
            f"{name} is {array.dtype}; it must be floating point, 1.0 = one spike a frame: divide a picture by its "
            "white (255), undo its gamma, and scale it"
        )
    raise InputError(f"{name} is {array.dtype}; it must be real numbers in floating point")


def _masks_some(values: Any) -> bool:
    """Whether an array, or one in a list of them, hides some of its values, which numpy would then show."""
    if isinstance(values, (list, tuple)):
        return any(_masks_some(part) for part in values)
    return isinstance(values, np.ma.MaskedArray) and bool(np.ma.is_masked(values))


def warn_outside(light: Keyframes | Pictures, start: int, frames: int) -> None:
    """Warn of a film new to the stream whose keys all lie before or after frames start .. start + frames."""
    if not isinstance(light, Keyframes) or light.frame.size < 2 or start == 0:
        return
    first, last = float(light.frame[0]), float(light.frame[-1])
    if last <= start or first >= start + frames:
        warnings.warn(
            f"keys of frames {first:g} .. {last:g} lie beside the frames to expose, whose light is held; keys are on "
            "the stream's absolute frames, not on those of a call",
            stacklevel=3,
        )


def check_radiance(radiance: Pictures) -> None:
    """Raise InputError unless every value is finite and not negative."""
    low, high = radiance.min(), radiance.max()
    if not (low >= 0.0 and high < np.inf):
        what = "NaN" if np.isnan(low) else ("infinity" if high == np.inf else f"negative values (lowest {low:g})")
        raise InputError(f"radiance holds {what}; it must be finite and >= 0 (1.0 = one spike a frame)")


class LightWithinFrame(NamedTuple):
    """Light within a frame that holds keys, linear between its times."""

    times: Floats
    """(n,) in the frame, 0 .. 1."""
    pictures: tuple[Pictures, ...]
    """(H*W,) at each time."""


class Piece(NamedTuple):
    """A stretch of a frame in which light is linear."""

    start: float
    """[frames]."""
    length: float
    """[frames]."""
    mean: Floats
    """Of the light in it (P,) [per frame]."""
    rise: Floats
    """From its start to its end (P,) [per frame]."""


INSTANT = 1e-9
"""Time [frames] that a jump of light takes at most: it has no light of its own."""


@dataclass(frozen=True)
class Segment:
    """Frames first .. first + count of a key interval of `length` frames, light linear over the interval.

    A frame with keys inside it is a segment of its own: the mean of its light at both ends, and its rise.
    """

    radiance0: Pictures
    """(H*W,), light at the start of the whole interval."""
    radiance1: Pictures
    """(H*W,), light at its end."""
    length: int
    first: int
    count: int
    rise: Pictures | None = None
    """(H*W,), of a frame with keys: from its start to its end, of the line with the first moment of its light."""
    course: LightWithinFrame | None = None
    """Of a frame with keys, where requested."""


def segments(light: Keyframes | Pictures, start: int, frames: int, courses: bool = False) -> Iterator[Segment]:
    """Cut frames start .. start + frames into segments.

    Ramps depend on the keys alone: no cut of the stream into calls changes a bit.

    Args:
        light: keyframes, or one (H, W) picture held throughout.
        courses: give frames with keys inside their courses.
    """
    if not isinstance(light, Keyframes):
        yield from _held(light, start, start + frames)
        return
    at = start
    for key0, key1, begin, length, first, count in cuts(light.frame, start, start + frames).tolist():
        if length:
            r0 = light.radiance[key0] if key0 >= 0 else light.at(begin)
            r1 = light.radiance[key1] if key1 >= 0 else light.at(begin + length)
            low = r0.reshape(-1)
            yield Segment(low, low if key0 == key1 >= 0 else r1.reshape(-1), length, first, count)
        elif courses:
            yield replace(_frame_with_keys(light, at), course=course(light, at))
        else:
            yield _frame_with_keys(light, at)
        at += count


KEY0, KEY1, BEGIN, LENGTH, FIRST, COUNT = range(6)
"""Columns of `cuts`."""


@njit(cache=True, nogil=True)
def cuts(times: Floats, start: int, stop: int) -> NDArray[np.int64]:
    """Cut frames start .. stop into segments at keys.

    Args:
        times: of the keys (K,) [frames].

    Returns:
        (S, 6) int64, a row a segment.  KEY0, KEY1: keys whose pictures are its light at start and end, -1 where no key
            is at that frame.  BEGIN, LENGTH: of its key interval [frames]; LENGTH 0 is a frame with keys inside it.
            FIRST, COUNT: its frames of the interval.
    """
    rows = np.empty((16, 6), np.int64)
    used, at = 0, start
    after = int(np.searchsorted(times, at, side="right"))
    while at < stop:
        while after < times.size and times[after] <= at:
            after += 1
        if used == len(rows):
            rows = np.concatenate((rows, np.empty_like(rows)))
        if after < times.size and times[after] < at + 1:
            key0, key1, begin, length, first, count = -1, -1, at, 0, 0, 1
        elif after == 0 or after == times.size:
            key, until = (0, min(stop, int(np.floor(times[0])))) if after == 0 else (after - 1, stop)
            key0, key1, begin, length, first, count = key, key, at, MAX_SEGMENT, 0, min(MAX_SEGMENT, until - at)
        else:
            begin, end = int(np.ceil(times[after - 1])), int(np.floor(times[after]))
            begin += (at - begin) // MAX_SEGMENT * MAX_SEGMENT
            end = min(end, begin + MAX_SEGMENT)
            key0 = after - 1 if times[after - 1] == begin else -1
            key1 = after if times[after] == end else -1
            length, first, count = end - begin, at - begin, min(stop, end) - at
        row = rows[used]  # number by number: numba compiles a tuple for a row 4 s longer, for its message of shapes
        row[KEY0], row[KEY1], row[BEGIN], row[LENGTH], row[FIRST], row[COUNT] = key0, key1, begin, length, first, count
        at += count
        used += 1
    return rows[:used]


def _frame_with_keys(light: Keyframes, at: int) -> Segment:
    """The frame from `at` on: the exact mean of its light, and its rise, limited so that the line stays above zero."""
    first, of_mean, of_rise = key_weights(light.frame, at, at + 1)
    if light.on_device:  # for an engine that goes by the mean alone
        exact: Any = zip(light.radiance[first:], of_mean.tolist(), strict=False)
        held = sum(picture.reshape(-1).double() * weight for picture, weight in exact).float()
        return Segment(held, held, 1, 0, 1)
    mean, rise, product = np.zeros((3, light.radiance[0].size))
    for picture, m, r in zip(light.radiance[first:], of_mean, of_rise, strict=False):
        mean += np.multiply(picture.reshape(-1), m, dtype=np.float64, out=product)
        rise += np.multiply(picture.reshape(-1), r, dtype=np.float64, out=product)
    held = mean.astype(np.float32)
    return Segment(held, held, 1, 0, 1, np.clip(rise, -2.0 * mean, 2.0 * mean).astype(np.float32))


def course(light: Keyframes, frame: int) -> LightWithinFrame:
    """Light within a frame."""
    after, until = np.searchsorted(light.frame, frame, side="right"), np.searchsorted(light.frame, frame + 1)
    times = np.concatenate([[0.0], light.frame[after:until] - frame, [1.0]])
    pictures = (light.at(frame), *light.radiance[after:until], light.at(frame + 1))
    return LightWithinFrame(times, tuple(picture.reshape(-1) for picture in pictures))


def _held(picture: Pictures, at: int, stop: int) -> Iterator[Segment]:
    flat = picture.reshape(-1)
    while at < stop:
        count = min(MAX_SEGMENT, stop - at)
        yield Segment(flat, flat, MAX_SEGMENT, 0, count)
        at += count


@dataclass(frozen=True)
class Ramp:
    """The integers of F(k) for every pixel of a segment: see the module's equation."""

    level: NDArray[np.int32]
    """i0."""
    curve: NDArray[np.int32]
    """B."""
    rest: NDArray[np.int32]
    """r / 2n in 2^-18."""
    own_rise: Pictures | None = None
    """(P,) of a frame with keys inside it [grains/frame]."""
    pieces: tuple[Piece, ...] = ()
    """Of such a frame with a known course, without dark current [thresholds]."""

    @cached_property
    def steady(self) -> bool:
        """Whether the light stays, for every pixel."""
        return self.own_rise is None and not (self.curve.any() or self.rest.any())

    @property
    def rise(self) -> Floats:
        """Light at a frame's end minus light at its start (P,) [grains/frame]."""
        if self.own_rise is not None:
            return self.own_rise.astype(np.float64)
        return 2.0 * self.curve + self.rest * (1.0 / (1 << 17))

    def collected(self, frame: int) -> NDArray[np.int32]:
        """Grains (P,) collected from the start of the key interval to the start of its frame."""
        k = np.int32(frame)
        grains: NDArray[np.int32] = self.level * k + self.curve * (k * k) + ((self.rest * (k * k)) >> np.int32(18))
        return grains


def ramp(segment: Segment, gain: Pictures, dark: Pictures) -> Ramp:
    """Integrate one segment: gain [grains/frame at radiance 1] and dark [grains/frame] are (P,) float32."""
    i0 = _grains_per_frame(segment.radiance0, gain, dark)
    d = _grains_per_frame(segment.radiance1, gain, dark) - i0
    twice = 2 * segment.length
    curve = np.floor(d.astype(np.float32) * np.float32(1.0 / twice)).astype(np.int32)
    per = -(-(1 << 18) // twice)
    rest = (d - curve * np.int32(twice)) * np.int32(per)
    return Ramp(i0, curve, rest, rise_of(segment, gain), pieces_of(segment, gain))


def rise_of(segment: Segment, gain: Pictures) -> Pictures | None:
    """`Ramp.own_rise` of a segment."""
    return None if segment.rise is None else segment.rise * gain


def pieces_of(segment: Segment, gain: Pictures) -> tuple[Piece, ...]:
    """`Ramp.pieces` of a segment."""
    if segment.course is None:
        return ()
    times, pictures = segment.course
    levels = [picture * (gain.astype(np.float64) / GRAINS) for picture in pictures]
    return tuple(
        Piece(float(begin), float(end - begin), 0.5 * (low + high), high - low)
        for begin, end, low, high in zip(times, times[1:], levels, levels[1:], strict=False)
        if end - begin > INSTANT
    )


def _grains_per_frame(radiance: Pictures, gain: Pictures, dark: Pictures) -> NDArray[np.int32]:
    with np.errstate(over="ignore"):  # infinity is capped too
        capped: Pictures = np.minimum(radiance * gain + dark, np.float32(MAX_GRAINS_PER_FRAME))
    grains: NDArray[np.int32] = (capped + np.float32(0.5)).astype(np.int32)
    return grains


def as_light(radiance: Keyframes | ArrayLike, shape: tuple[int, int]) -> Keyframes | Pictures:
    """A user's light, checked against the sensor's shape; raises InputError."""
    if isinstance(radiance, Keyframes):
        if tuple(radiance.radiance.shape[1:]) != shape:
            raise InputError(f"radiance is {tuple(radiance.radiance.shape[1:])} pixels, the sensor is {shape}")
        return radiance
    picture = light_values(radiance)
    if picture.shape != shape:
        raise InputError(
            f"radiance has shape {picture.shape}, the sensor is {shape}; give one (H, W) picture to hold, or Keyframes"
        )
    check_radiance(picture)
    return picture


def same_light(a: Pictures, b: Pictures) -> bool:
    """Whether two pictures have the same values, every pixel."""
    if a.flags.c_contiguous and a.flags.writeable:
        return bool(_same_words(a.view(np.uint32), b.view(np.uint32)))
    return np.array_equal(a, b)


@njit(cache=True, nogil=True, boundscheck=False)
def _same_words(a: NDArray[np.uint32], b: NDArray[np.uint32]) -> bool:
    use_widest_vectors()
    different = np.uint32(0)
    for i in range(a.size):
        different |= np.uint32(a[i] ^ b[i])
    return different == 0  # type: ignore[no-any-return]
