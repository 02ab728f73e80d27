"""Light that bends within a frame: the errors of effects in it, and a refusal where they are large.

A frame with keys inside it gets its light L(t) exactly.  Crossings, however, are timed as if charge came evenly, and
effects know the mean of L and the straight line with its first moment.  Of a frame's charge x they are off by at most

    x TV min(moved / x, 1), x range at most      a reference that moves by `sway`: its variation and range in the frame
    tau x uneven + c sqrt(x) uneven              light that is lost while a node is held (`Feedback`)
    f x min(2 moved / (x tau), 1)                charge that a reset leaves, by the interval that has ended
    4 k moved                                    kicks that come at another time, in another order
    `Effect.off_the_line`                        error of `collect`, declared by the effect

in thresholds; moved: charge that comes at another time than if evenly; uneven: the largest |L - x|.  More than ALLOWED
of the frame's charge is refused.  Films with keys at whole frames are never checked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from spikecam_env.errors import InputError
from spikecam_env.sensor import drive
from spikecam_env.sensor.effects.base import Bend, Effect, ExposureBlock, Feedback
from spikecam_env.sensor.light import GRAINS, INSTANT, Keyframes, course
from spikecam_env.types import Floats, Pictures

ALLOWED = 0.01
"""Share of a frame's charge by which an effect may be off: a rate is off by no more."""

FAINT = 0.01
"""Charge [thresholds] that counts as the whole of a fainter frame: its error is then a ten-thousandth of a threshold
at most, less than an electron."""


def concerned(effects: Sequence[Effect], first: ExposureBlock) -> bool:
    """Whether any of these effects may be off in light that bends within a frame."""
    return any(_sways(e, first) or _acts(e.feedback(first)) or e.overrides("off_the_line") for e in effects)


def check_bent(
    light: Keyframes,
    start: int,
    frames: int,
    first: ExposureBlock,
    effects: Sequence[Effect],
    image: Callable[..., Pictures],
) -> None:
    """Refuse light in which an effect is off by too much.

    Args:
        first: as given to an engine's `start`.
        image: the optics, a function of a picture (H*W,).

    Raises:
        InputError: for the first such frame; it names effect, pixel and error.
    """
    for frame in frames_with_keys(light, start, start + frames):
        now = replace(first, number=frame)
        bend = bend_of(light, frame, now, image)
        for effect in effects:
            off = error(effect, bend, now) / np.maximum(bend.mean, FAINT)
            worst = int(off.argmax())
            if off.flat[worst] > ALLOWED:
                row, column = divmod(worst, now.shape[1])
                raise InputError(
                    f"{effect.name} takes light to be linear within a frame, but it bends in frame {frame}: up to "
                    f"{off.flat[worst]:.1%} of the charge of pixel ({row}, {column}) would be wrong, {ALLOWED:.0%} is "
                    "allowed; give keys at whole frames, make the effect weaker, or allow it with "
                    "SpikeSensor(..., bent_light='allow')"
                )


def frames_with_keys(light: Keyframes, start: int, stop: int) -> Iterator[int]:
    """Frames of start .. stop that hold keys between their start and their end, ascending."""
    first, last = np.searchsorted(light.frame, [start, stop])
    times = light.frame[first:last]
    return iter(np.unique(np.floor(times[times != np.floor(times)])).astype(np.int64).tolist())


def bend_of(light: Keyframes, frame: int, now: ExposureBlock, image: Callable[..., Pictures]) -> Bend:
    """How unevenly the charge of every pixel comes in that frame."""
    times, pictures = course(light, frame)
    gain, dark = (a.astype(np.float64) / GRAINS for a in now.unit.grains_per_frame)
    levels = np.stack([image(p) * gain + dark for p in pictures])
    lasts = np.diff(times) > INSTANT
    length = np.diff(times)[lasts, None]
    low, high = levels[:-1][lasts], levels[1:][lasts]
    arm = (times[:-1] + 0.5 * np.diff(times) - 0.5)[lasts, None]
    mean = (length * (low + high)).sum(axis=0) / 2.0
    rise = 12.0 * (length * (arm * (low + high) / 2.0 + length * (high - low) / 12.0)).sum(axis=0)
    uneven = np.maximum(abs(low - mean), abs(high - mean)).max(axis=0)
    begin, end = (rise * (arm - 0.5 * length) + mean, rise * (arm + 0.5 * length) + mean)
    bent = np.maximum(abs(low - begin), abs(high - end)).max(axis=0)
    moved = 0.5 * (length * _mean_size(low - mean, high - mean)).sum(axis=0)
    off_line = (length * _mean_size(low - begin, high - end)).sum(axis=0)
    return Bend(*(a.reshape(now.shape) for a in (mean, uneven, moved, bent, off_line)))


def error(effect: Effect, bend: Bend, now: ExposureBlock) -> Floats:
    """By how much an effect may take a frame's charge off (H, W) [thresholds]; see the module's equations."""
    x, moved_share = bend.mean, np.minimum(bend.moved / np.maximum(bend.mean, 1e-12), 1.0)
    feedback = effect.feedback(now)
    off = (feedback.lost_per_rate * x + feedback.lost_per_root_rate * np.sqrt(x)) * bend.uneven
    off = off + 4.0 * abs(feedback.kick_at_once) * bend.moved
    off = off + feedback.left * x * np.minimum(2.0 * moved_share / feedback.left_tau, 1.0)
    if _sways(effect, now):
        variation, span = drive.movement(now, effect)
        off = off + x * np.minimum(variation * moved_share, span)
    return off + effect.off_the_line(bend, now)


def _sways(effect: Effect, first: ExposureBlock) -> bool:
    return effect.overrides("sway") and effect.parts(first.frame_rate_hz) > 0


def _acts(feedback: Feedback) -> bool:
    return (
        feedback.lost_per_rate > 0.0
        or feedback.lost_per_root_rate > 0.0
        or feedback.left > 0.0
        or bool(feedback.kick_at_once)
    )


def _mean_size(begin: Floats, end: Floats) -> Floats:
    """Mean of |a| over a stretch on which a goes straight from `begin` to `end`."""
    both = abs(begin) + abs(end)
    crosses = begin * end < 0.0
    return np.where(crosses, (begin**2 + end**2) / np.maximum(2.0 * both, 1e-300), both / 2.0)
