"""A frame at a time at the price of many: under light that stays, frames are computed ahead of their calls.

A call for one frame must touch every pixel's state; a call for sixty-four touches it as often.  Where calls for single
frames follow each other under one light, or one film, the next frames are therefore computed together and kept as
bits.  Each later call first compares its light, every pixel, with the light of these frames.  Where that has changed,
the pixels are restored, and the frames that were delivered are computed again: no bit can depend on it.  The distance
ahead grows with success, so that light that often changes costs little.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor.engines.compiled import fast
from spikecam_env.sensor.light import MAX_SEGMENT, Segment, same_light
from spikecam_env.sensor.unit import Unit
from spikecam_env.types import Floats, Spikes

SHORT_CALL = 4
"""Most frames of a call for which looking ahead can pay."""

_SAMPLED = 61
"""Pixels of which light is compared to predict whether it stays."""


@dataclass
class Ready:
    """Frames computed ahead."""

    segment: Segment
    """Of these frames, with light of its own."""
    packed: NDArray[np.uint8]
    """Their bits."""
    served: int
    """How many were delivered."""
    remaining: NDArray[np.int32]
    """Of the pixels before them."""
    fired: NDArray[np.uint32]
    """Of the pixels before them."""


@dataclass
class AheadState:
    """Pixels of the fast engine, and frames computed ahead."""

    pixels: fast.FastState
    """After the frames that are ready, if any are."""
    ready: Ready | None = None
    reach: int = 0
    """Frames to look ahead next time."""
    sample: bytes = b""
    """Some of the light of the last call."""


def start(unit: Unit, phase: Floats, seed: int) -> AheadState:
    """As `fast.start`."""
    return AheadState(fast.start(unit, phase, seed))


def run(
    state: AheadState, segment: Segment, out: Spikes | None = None, *, threads: int | None = None
) -> NDArray[np.uint8]:
    """As `fast.run`, with the same bits."""
    if state.ready is not None and not _continues(state.ready, segment):
        roll_back(state)
    if state.ready is None and segment.count <= SHORT_CALL:
        look_ahead(state, segment, threads)
    ready = state.ready
    if ready is None:
        return fast.run(state.pixels, segment, out, threads=threads)
    bits = ready.packed[ready.served : ready.served + segment.count]
    ready.served += segment.count
    if ready.served == len(ready.packed):
        state.ready = None
        state.reach = min(2 * state.reach, MAX_SEGMENT)
    return fast.unpack(bits, segment.radiance0.size, out)


def look_ahead(state: AheadState, segment: Segment, threads: int | None) -> None:
    """Compute as many frames as have lately been of use, from this segment's first on."""
    sample = _sample(segment)
    if sample == state.sample:
        state.reach = max(state.reach, 2 * segment.count)
    elif segment.first > 0:
        state.reach = 0
    state.sample = sample
    rest = segment.length - (0 if _is_steady(segment) else segment.first)
    count = min(state.reach, rest)
    if count <= segment.count:
        return
    light0 = segment.radiance0.copy()
    light1 = light0 if _is_steady(segment) else segment.radiance1.copy()
    ours = replace(segment, radiance0=light0, radiance1=light1, count=count)
    if _is_steady(segment):
        ours = replace(ours, first=0)
    before = state.pixels.remaining.copy(), state.pixels.fired.copy()
    state.ready = Ready(ours, fast.run_packed(state.pixels, ours, threads=threads), 0, *before)


def roll_back(state: AheadState) -> None:
    """Restore the pixels to the end of the frames that were delivered, with none ready."""
    ready = state.ready
    if ready is None:
        return
    state.pixels.remaining[:] = ready.remaining
    state.pixels.fired[:] = ready.fired
    if ready.served:
        fast.run_packed(state.pixels, replace(ready.segment, count=ready.served))
    state.ready, state.reach = None, 0


def _continues(ready: Ready, segment: Segment) -> bool:
    """Whether this segment's frames are ready, in the same light of every pixel."""
    ours = ready.segment
    steady = _is_steady(segment)
    if steady != _is_steady(ours) or ready.served + segment.count > ours.count:
        return False
    if not steady and (segment.length, segment.first) != (ours.length, ours.first + ready.served):
        return False
    return same_light(segment.radiance0, ours.radiance0) and (steady or same_light(segment.radiance1, ours.radiance1))


def _is_steady(segment: Segment) -> bool:
    return segment.radiance0 is segment.radiance1


def _sample(segment: Segment) -> bytes:
    every = max(1, segment.radiance0.size // _SAMPLED)
    return segment.radiance0[::every].tobytes() + segment.radiance1[::every].tobytes()
