"""The law of `pixel.py` between two key frames, where light is a line: every event's time by itself, pixel by pixel.

    c(t) = c_0 + s (t - t_k)                                  light of a key interval, with the dark current
    g(t) = c(t) - level exp(-leak (t - t_0)) = 0              level: r_0 exp(theta_on), or r_0 exp(-theta_off)

g is concave, a line less an exponential.  Newton's iteration therefore comes to a rising crossing from before it and
to a falling one from after it, and never passes it; without a leak g is a line, and one step is the closed form.  A
crossing depends on key frames and the pixel's last reset alone, not on the calls in which light is exposed: no cut of
a stream changes a bit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.sensor.event_camera.pixel import Law
from spikecam_env.sensor.ground.draws import GOLDEN, first_key, scramble, second_key
from spikecam_env.sensor.light import INSTANT
from spikecam_env.types import Floats, Pictures

NEVER = np.inf

MOST_STEPS = 64
"""Of Newton's iteration, which doubles its digits with each: five are usual."""

SAFETY = 1.0 - 1e-12
"""Of the bound by which most pixels are passed over: rounding is far less."""

_U = np.uint32
_PER_WORD = 2.0**-32


class Pixels(NamedTuple):
    """State of the pixels, (P,) each."""

    reference: Floats
    """r_0 [radiance]; below 0 where it is not known yet, as t_0 is to come: -1 times the share of c(t_0) it will be."""
    since: Floats
    """t_0 [frames]."""
    noise: Floats
    """When the next noise event may come [frames]."""
    drawn: NDArray[np.int64]
    """Noise events drawn so far."""


class Thresholds(NamedTuple):
    """Of the pixels, as ratios of light to reference, (P,) each."""

    on: Floats
    """exp(theta_on)."""
    off: Floats
    """exp(-theta_off)."""


class Line(NamedTuple):
    """Light between two key frames, with the dark current."""

    begin: float
    """[frames]; minus infinity before the first key."""
    end: float
    """[frames]; infinity after the last."""
    level: float
    """At its begin [radiance]."""
    slope: float
    """[radiance a frame]; 0 where the line has no begin or no end."""


Found = tuple[Floats, NDArray[np.int64], NDArray[np.bool_]]
"""Times [frames], pixels and polarities of events."""


@njit(inline="always")
def at(line: Line, t: float) -> float:
    """c(t)."""
    return line.level if line.slope == 0.0 else line.level + line.slope * (t - line.begin)


@njit(inline="always")
def leaked(level: float, leak: float, time: float) -> float:
    """A level after so long."""
    return level if leak == 0.0 else level * np.exp(-leak * time)


@njit(cache=True, error_model="numpy")
def rising(line: Line, level: float, leak: float, since: float, jump: float) -> float:
    """The first moment at which light is up to the level; NEVER where that is not before the line's end.

    Args:
        jump: when light that falls may be up to it all the same; NEVER where it cannot.
    """
    if line.slope < 0.0 and jump < NEVER and at(line, jump) >= leaked(level, leak, jump - since):
        return jump
    begin = max(line.begin, since)
    if line.slope >= 0.0 and at(line, begin) >= leaked(level, leak, begin - since):
        return begin
    if line.slope > 0.0:
        if at(line, line.end) < leaked(level, leak, line.end - since):
            return NEVER
    elif leak == 0.0 or -line.slope >= leak * leaked(level, leak, begin - since):
        return NEVER  # g falls from here on
    elif line.slope < 0.0:
        peak = since + np.log(leak * level / -line.slope) / leak
        if at(line, peak) < leaked(level, leak, peak - since):
            return NEVER
    t = begin
    for _ in range(MOST_STEPS):
        now = leaked(level, leak, t - since)
        after = t - (at(line, t) - now) / (line.slope + leak * now)
        if not after > t:
            break
        t = after
        if t >= line.end:
            return NEVER
    return within(t, begin, line.end)


@njit(cache=True, error_model="numpy")
def falling(line: Line, level: float, leak: float, since: float, jump: float) -> float:
    """The first moment at which light is down at the level; NEVER where that is not before the line's end.

    Args:
        jump: when light that rises may be down at it all the same; NEVER where it cannot.
    """
    if line.slope > 0.0:
        return jump if jump < NEVER and at(line, jump) <= leaked(level, leak, jump - since) else NEVER
    begin = max(line.begin, since)
    if at(line, begin) <= leaked(level, leak, begin - since):
        return begin
    t = line.end
    if line.slope == 0.0 or at(line, t) > leaked(level, leak, t - since):
        return NEVER
    for _ in range(MOST_STEPS):
        now = leaked(level, leak, t - since)
        after = t - (at(line, t) - now) / (line.slope + leak * now)
        if not after < t:
            break
        t = after
    return within(t, begin, line.end)


@njit(inline="always")
def jumped_at(line: Line, since: float, start: float, was_opposite: bool) -> float:
    """When light may be beyond a threshold against its slope: where it jumped, at the line's begin or the call's.

    After an event there the other way it is not: the rounding of a time on a steep line would be taken for a jump.
    """
    jump = max(line.begin, start)
    return jump if since < jump or (since == jump and not was_opposite) else NEVER


@njit(inline="always")
def within(t: float, begin: float, end: float) -> float:
    """A crossing inside a line; NEVER where rounding takes it to the end, which is the next line's begin."""
    if t <= begin:
        t = np.nextafter(begin, np.inf)
    return NEVER if t >= end else t


@njit(inline="always")
def word(pixel: int, number: int, low: np.uint32) -> np.uint32:
    """A pixel's random word of this number."""
    return scramble(_U(first_key(pixel, low) + _U(_U(number) * GOLDEN)))  # type: ignore[no-any-return]


@njit(inline="always")
def wait(pixel: int, number: int, low: np.uint32, rate: float) -> float:
    """Until the next of a Poisson process of that rate: exponential."""
    return -np.log((float(word(pixel, number, low)) + 0.5) * _PER_WORD) / rate  # type: ignore[no-any-return]


@njit(inline="always")
def share(pixel: int, number: int, low: np.uint32, high: np.uint32) -> float:
    """Uniform in 0 .. 1, apart from the wait of this number."""
    own = second_key(first_key(pixel, low), high)
    return (float(scramble(_U(word(pixel, number, low) ^ own))) + 0.5) * _PER_WORD


@njit(inline="always")
def noise_polarity(pixel: int, number: int, low: np.uint32, high: np.uint32, light: float, law: Law) -> int:
    """Of a noise event of that number: 1 or -1, half of each; 0 where light keeps it from being one."""
    kept = 1.0 - (1.0 - law.noise_in_light) * min(light, 1.0)
    which = share(pixel, number, low, high)
    return 0 if which >= kept else 1 if which < 0.5 * kept else -1


@njit(inline="always")
def line_of(keys: Floats, radiance: Pictures, key: int, p: int, dark: float) -> tuple[Line, float]:
    """A pixel's light between a key and the next, -1 for before the first; and its light at the end."""
    last = keys.size - 1
    begin, end = keys[key] if key >= 0 else -np.inf, keys[key + 1] if key < last else np.inf
    low = np.float64(radiance[max(key, 0), p]) + dark
    high = np.float64(radiance[min(key + 1, last), p]) + dark
    return Line(begin, end, low, 0.0 if key < 0 or key == last else (high - low) / (end - begin)), high


@njit(inline="always")
def crossing(
    line: Line,
    high: float,
    start: float,
    before: float,
    reference: float,
    since: float,
    on: float,
    off: float,
    leak: float,
    last: int,
) -> tuple[float, int]:
    """When light next crosses a threshold, and its polarity, 1 or -1; (NEVER, 0) where it does not before a moment.

    Most pixels are passed over by a bound: exp(-x) >= 1 - x.

    Args:
        high: light at the line's end.
        start: of the call; light may have jumped there.
        last: polarity of the event before on this line and in this call, or 0.
    """
    lowest = reference * on * (1.0 - leak * (before - since)) * SAFETY
    if max(line.level, high) < lowest and min(line.level, high) * SAFETY > reference * off:
        return NEVER, 0
    rise = rising(line, reference * on, leak, since, jumped_at(line, since, start, last < 0))
    fall = falling(line, reference * off, leak, since, jumped_at(line, since, start, last > 0))
    return (fall, -1) if fall < rise else (rise, 1)


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def expose(
    law: Law,
    words: tuple[np.uint32, np.uint32],
    keys: Floats,
    radiance: Pictures,
    start: float,
    stop: float,
    thresholds: Thresholds,
    pixels: Pixels,
) -> Found:
    """The events of [start, stop), line by line, pixel by pixel; `pixels` are then at `stop`.

    Args:
        law: parameters.
        words: of the random numbers.
        keys: (K,) times [frames].
        radiance: (K, P), linear between them and constant outside.
        start: [frames].
        stop: [frames].
        thresholds: of the pixels.
        pixels: changed in place.
    """
    times, places, rose, used = np.empty(256), np.empty(256, np.int64), np.empty(256, np.bool_), 0
    first, until = np.searchsorted(keys, start, side="right") - 1, np.searchsorted(keys, stop, side="left")
    low, high = words
    for key in range(first, until):
        if 0 <= key < keys.size - 1 and keys[key + 1] - keys[key] < INSTANT:
            continue  # a jump, which the next line begins after
        for p in range(radiance.shape[1]):
            on, off = thresholds.on[p], thresholds.off[p]
            reference, since, noise, drawn = pixels.reference[p], pixels.since[p], pixels.noise[p], pixels.drawn[p]
            line, at_end = line_of(keys, radiance, key, p, law.dark)
            before, last = min(line.end, stop), 0
            while True:
                t, polarity = NEVER, 0
                if since < before:
                    if reference < 0.0:
                        reference = -reference * at(line, max(since, line.begin))
                    t, polarity = crossing(line, at_end, start, before, reference, since, on, off, law.leak, last)
                    t = max(t, start)  # where light is not the same as in the call before
                is_noise = noise < min(t, before)
                if is_noise:
                    t, polarity = noise, noise_polarity(p, drawn, low, high, at(line, noise) - law.dark, law)
                    drawn += 1
                    noise += wait(p, drawn, low, law.noise)
                    if polarity == 0 or t < since:
                        continue
                if t >= before:
                    break
                if used == times.size:
                    times = np.concatenate((times, np.empty_like(times)))
                    places = np.concatenate((places, np.empty_like(places)))
                    rose = np.concatenate((rose, np.empty_like(rose)))
                times[used], places[used], rose[used] = t, p, polarity > 0
                used, last = used + 1, polarity
                held = t + law.refractory
                if held > t:
                    reference = -1.0
                elif is_noise:
                    reference = at(line, t)
                else:
                    reference = leaked(reference, law.leak, t - since) * (on if polarity > 0 else off)
                since = held
            pixels.reference[p], pixels.since[p], pixels.noise[p], pixels.drawn[p] = reference, since, noise, drawn
    return times[:used], places[:used], rose[:used]


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def first_waits(low: np.uint32, rate: float, out: Floats) -> None:
    """When the first noise event of each pixel may come [frames]: out (P,)."""
    for p in range(out.size):
        out[p] = wait(p, 0, low, rate) if rate > 0.0 else NEVER
