"""Light over time, and how a pixel integrates it: the exact law that every engine shares.

Radiance is relative: 1.0 makes the nominal pixel fire once a frame.  It is given at key frames and linear
between them; frame n integrates over [n, n+1).

Collected light is counted in *grains*, GRAINS = 2^23 to a pixel's own threshold (0.004 electrons: finer than
anything physical), in whole numbers.  Within a key interval of n frames whose light goes from i0 to i1 grains
a frame, the grains collected before frame k are

    F(k) = i0 k + (i1 - i0) k^2 / 2n = i0 k + B k^2 + r k^2 / 2n        i1 - i0 = 2 n B + r

in 32-bit integer arithmetic, rounded down, so engines that compute it in closed form or frame by frame give the same
bits.  F never falls, down to single grains: 1/2n is taken in 2^-18, rounded up.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.errors import InputError

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

    frame: (K,) float64, strictly increasing [frames].  radiance: (K, H, W) float32, >= 0.
    Keys at whole frames not more than 64 apart are integrated in one go; other keys cost one pass a frame.
    An array that is float32 and C-contiguous already is kept, not copied: what is written to it later is what later
    steps see.  Raises InputError for other shapes, unordered frames, numbers that are no light (see `light_values`),
    and radiance that is negative or not finite.
    """

    frame: NDArray[np.float64]
    radiance: NDArray[np.float32]

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
    def known(cls, frame: NDArray[np.float64], radiance: NDArray[np.float32]) -> Keyframes:
        """Of light that is known to be right, as a scene's own is: its values are not looked at, which would take a
        sixth of the time that it takes to paint them."""
        keys = object.__new__(cls)
        object.__setattr__(keys, "frame", frame)
        object.__setattr__(keys, "radiance", radiance)
        return keys

    def at(self, frame: float) -> NDArray[np.float32]:
        """Radiance (H, W) at a time [frames]."""
        if frame <= self.frame[0]:
            return self.radiance[0]
        if frame >= self.frame[-1]:
            return self.radiance[-1]
        i = int(np.searchsorted(self.frame, frame, side="right")) - 1
        w = np.float32((frame - self.frame[i]) / (self.frame[i + 1] - self.frame[i]))
        if w == 0.0:
            return self.radiance[i]
        return self.radiance[i] * (np.float32(1.0) - w) + self.radiance[i + 1] * w


def light_values(values: ArrayLike) -> NDArray[np.float32]:
    """Light as C-contiguous float32.

    Raises InputError for whole numbers, which are pictures and no light, and as `real_numbers` does.
    """
    array = real_numbers(values, "radiance", "f")
    with np.errstate(over="ignore"):  # beyond float32 is infinity, which is refused as such
        return np.ascontiguousarray(array, dtype=np.float32)


def real_numbers(values: ArrayLike, name: str, kinds: str) -> NDArray[Any]:
    """An array of real numbers of these kinds (numpy's letters).

    Raises InputError for others, such as True, text, objects, complex or ragged ones, and where some are masked.
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


def warn_beside(light: Keyframes | NDArray[np.float32], start: int, frames: int) -> None:
    """Warn of a film new to the stream whose keys all lie before or after frames start .. start + frames.

    Keys are on absolute frames: to give every call keys that begin at 0 is a likely mistake.
    """
    if not isinstance(light, Keyframes) or light.frame.size < 2 or start == 0:
        return
    first, last = float(light.frame[0]), float(light.frame[-1])
    if last <= start or first >= start + frames:
        warnings.warn(
            f"keys of frames {first:g} .. {last:g} lie beside the frames to expose, whose light is held; keys are on "
            "the stream's absolute frames, not on those of a call",
            stacklevel=3,
        )


def check_radiance(radiance: NDArray[np.float32]) -> None:
    """Raise InputError unless every value is finite and not negative."""
    low, high = radiance.min(), radiance.max()
    if not (low >= 0.0 and high < np.inf):
        what = "NaN" if np.isnan(low) else ("infinity" if high == np.inf else f"negative values (lowest {low:g})")
        raise InputError(f"radiance holds {what}; it must be finite and >= 0 (1.0 = one spike a frame)")


@dataclass(frozen=True)
class Segment:
    """Frames first .. first + count of a key interval of `length` frames, light linear over the interval.

    radiance0, radiance1: (H*W,) float32, light at the start and at the end of the whole interval.
    """

    radiance0: NDArray[np.float32]
    radiance1: NDArray[np.float32]
    length: int
    first: int
    count: int


def segments(light: Keyframes | NDArray[np.float32], start: int, frames: int) -> Iterator[Segment]:
    """Cut frames start .. start + frames into segments.

    light: keyframes, or one (H, W) picture held throughout.  How the stream is cut into calls changes no bit:
    the ramps depend on the keys alone.
    """
    stop = start + frames
    if not isinstance(light, Keyframes):
        yield from _held(light, start, stop)
        return
    first, last = light.frame[0], light.frame[-1]
    whole = bool(np.all(light.frame == np.floor(light.frame)))
    at = start
    while at < stop:
        if whole and at >= last:
            yield from _held(light.radiance[-1], at, stop)
            at = stop
        elif whole and at < first:
            until = min(stop, int(first))
            yield from _held(light.radiance[0], at, until)
            at = until
        elif whole:
            i = int(np.searchsorted(light.frame, at, side="right")) - 1
            begin, end = int(light.frame[i]), int(light.frame[i + 1])
            begin += (at - begin) // MAX_SEGMENT * MAX_SEGMENT
            end = min(end, begin + MAX_SEGMENT)
            until = min(stop, end)
            r0, r1 = light.at(begin).reshape(-1), light.at(end).reshape(-1)
            yield Segment(r0, r1, end - begin, at - begin, until - at)
            at = until
        else:
            centre = light.at(at + 0.5).reshape(-1)
            yield Segment(centre, centre, 1, 0, 1)
            at += 1


def _held(picture: NDArray[np.float32], at: int, stop: int) -> Iterator[Segment]:
    flat = picture.reshape(-1)
    while at < stop:
        count = min(MAX_SEGMENT, stop - at)
        yield Segment(flat, flat, MAX_SEGMENT, 0, count)
        at += count


@dataclass(frozen=True)
class Ramp:
    """The integers of F(k) for every pixel of a segment: i0, B, and r / 2n in 2^-18 (see the module's equation)."""

    level: NDArray[np.int32]
    curve: NDArray[np.int32]
    rest: NDArray[np.int32]

    @cached_property
    def steady(self) -> bool:
        """Whether the light stays, for every pixel."""
        return not (self.curve.any() or self.rest.any())

    @property
    def rise(self) -> NDArray[np.float64]:
        """(P,) by how much more light there is at a frame's end than at its start [grains/frame]."""
        return 2.0 * self.curve + self.rest * (1.0 / (1 << 17))

    def collected(self, frame: int) -> NDArray[np.int32]:
        """Grains (P,) collected from the start of the key interval to the start of its frame."""
        k = np.int32(frame)
        return self.level * k + self.curve * (k * k) + ((self.rest * (k * k)) >> np.int32(18))


def ramp(segment: Segment, gain: NDArray[np.float32], dark: NDArray[np.float32]) -> Ramp:
    """Integrate one segment: gain [grains/frame at radiance 1] and dark [grains/frame] are (P,) float32."""
    i0 = _grains_per_frame(segment.radiance0, gain, dark)
    d = _grains_per_frame(segment.radiance1, gain, dark) - i0
    twice = 2 * segment.length
    curve = np.floor(d.astype(np.float32) * np.float32(1.0 / twice)).astype(np.int32)
    per = -(-(1 << 18) // twice)
    return Ramp(i0, curve, (d - curve * np.int32(twice)) * np.int32(per))


def _grains_per_frame(
    radiance: NDArray[np.float32], gain: NDArray[np.float32], dark: NDArray[np.float32]
) -> NDArray[np.int32]:
    with np.errstate(over="ignore"):  # infinity is capped too
        capped = np.minimum(radiance * gain + dark, np.float32(MAX_GRAINS_PER_FRAME))
    return (capped + np.float32(0.5)).astype(np.int32)


def as_light(radiance: Keyframes | ArrayLike, shape: tuple[int, int]) -> Keyframes | NDArray[np.float32]:
    """Check what a user gave as light against the sensor's shape; raises InputError."""
    if isinstance(radiance, Keyframes):
        if radiance.radiance.shape[1:] != shape:
            raise InputError(f"radiance is {radiance.radiance.shape[1:]} pixels, the sensor is {shape}")
        return radiance
    picture = light_values(radiance)
    if picture.shape != shape:
        raise InputError(
            f"radiance has shape {picture.shape}, the sensor is {shape}; give one (H, W) picture to hold, or Keyframes"
        )
    check_radiance(picture)
    return picture
