"""The fast engine: random numbers only per spike.

Poisson arrivals of rate lambda(t) are a unit-rate process in Lambda(t) = integral of lambda.  A pixel that needs N
electrons therefore fires when Lambda has advanced by Gamma(N, 1), with the reset's draw mixed in (`quantile`).
Between spikes nothing is drawn: the crossing time follows from the light ramp (`spike_to_spike`).  Without noise the
bits are the reference's.

The number of threads (`threads`) changes no bit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.sensor.effects import Effect
from spikecam_env.sensor.engines.compiled import tile_driver
from spikecam_env.sensor.engines.compiled.every_frame import AT_ONCE
from spikecam_env.sensor.engines.compiled.queue import run_in_threads
from spikecam_env.sensor.engines.compiled.tile import COUNT as PIECE_COUNT
from spikecam_env.sensor.engines.compiled.tile import FIRST as PIECE_FIRST
from spikecam_env.sensor.engines.compiled.tile import LENGTH as PIECE_LENGTH
from spikecam_env.sensor.engines.compiled.tile import LIGHT0, LIGHT1, PIECE_COLUMNS, TILE
from spikecam_env.sensor.ground.intrinsics import address_of
from spikecam_env.sensor.ground.quantile import MIN_ELECTRONS, fitted_polynomial
from spikecam_env.sensor.imaging import Imaging
from spikecam_env.sensor.light import (
    COUNT,
    FIRST,
    GRAINS,
    KEY0,
    KEY1,
    LENGTH,
    MAX_SEGMENT,
    Keyframes,
    Segment,
    cuts,
    segments,
)
from spikecam_env.sensor.model import generator
from spikecam_env.sensor.unit import Unit
from spikecam_env.types import Floats, Pictures, Spikes

DENSE = 0.7
"""Spikes a pixel and frame above which streaming frame by frame is faster than jumping."""

OFTEN = 4.0
"""Mean frames a key interval of a stretch, below which `every_frame` is faster than going from spike to spike: 1.6
times at 2 frames, 1.0 to 1.2 at 4, 0.8 to 1.1 at 8, at mean intervals of 3 to 100 frames."""

FEWEST = MIN_ELECTRONS / 2
"""Fewest electrons to a threshold for a spike's noise.  The law's shape is that of the median pixel: with the noise of
fewer electrons, in the tail of a spread, it would reach below zero charge."""


def missing(effects: Sequence[Effect]) -> list[str]:
    """Names of effects, or options of them, that this engine does not carry: all that act from frame to frame."""
    names = [e.name for e in effects if not e.is_fixed()]
    names += ["shot_noise.dark_is_noisy=false" for e in effects if getattr(e, "dark_is_noisy", True) is False]
    quanta = [getattr(e, "quanta", MIN_ELECTRONS) for e in effects]
    return names + [f"shot_noise.quanta={n:g} (below {MIN_ELECTRONS:g})" for n in quanta if n < MIN_ELECTRONS]


@dataclass(frozen=True)
class PixelLaw:
    """A unit in the loop's numbers, padded to whole tiles."""

    gain: Pictures
    """[grains/frame]."""
    dark: Pictures
    """[grains/frame]."""
    spread: Pictures
    """Standard deviation of a spike's charge [grains]."""
    polynomial: tuple[np.float32, ...]
    """Shape of its law."""

    @classmethod
    def of(cls, unit: Unit) -> PixelLaw:
        """The shape is fitted at the median pixel; the spread is each pixel's own."""
        gain, dark = unit.grains_per_frame
        spread = GRAINS * np.sqrt(per_electron(unit) + unit.kappa**2)
        return cls(_padded(gain), _padded(dark), _padded(spread.astype(np.float32)), _shape_of_law(unit))

    def __deepcopy__(self, memo: dict[int, Any]) -> PixelLaw:
        return self  # never written to


def per_electron(unit: Unit) -> Floats:
    """1/N of every pixel (P,), 0 without shot noise; N no less than FEWEST."""
    return 1.0 / np.maximum(unit.electrons, FEWEST) if unit.shot else np.zeros(unit.electrons.size)


@dataclass
class FastState:
    """Pixels mid-stream, padded to whole tiles; its arrays are changed in place, never replaced."""

    law: PixelLaw
    remaining: NDArray[np.int32]
    """Grains to the next spike."""
    fired: NDArray[np.uint32]
    """Spikes so far."""
    seeds: tuple[np.uint32, np.uint32]
    """With the numbers of a pixel and of its spike they fix every draw."""

    @cached_property
    def addresses(self) -> Addresses:
        """Addresses of the arrays in memory; a copy has others."""
        polynomial = np.array(self.law.polynomial, np.float32)
        arrays = self.law.gain, self.law.dark, self.law.spread, polynomial, self.remaining, self.fired
        return Addresses(tuple(map(address_of, arrays)), (int(self.seeds[0]), int(self.seeds[1])), polynomial)

    def __getstate__(self) -> dict[str, Any]:
        return {f.name: getattr(self, f.name) for f in fields(self)}


class Addresses(NamedTuple):
    """A camera in the table of `tile_driver.advance`."""

    arrays: tuple[int, ...]
    """In its order."""
    words: tuple[int, int]
    """Of the seed."""
    polynomial: Pictures
    """One of the arrays, kept alive here."""


def start(unit: Unit, phase: Floats, seed: int) -> FastState:
    """Pixels part-way through a cycle.

    The first spike's charge is drawn literally: threshold, whole electrons still missing, their Gamma waiting charge.

    Args:
        phase: (P,) in [0, 1), share of the nominal threshold collected.
    """
    rng = generator(seed, "fast engine: first spike")
    missing_grains = GRAINS * (1.0 + unit.kappa * rng.standard_normal(phase.size)) - np.floor(phase * GRAINS)
    if unit.shot:
        grains_per_electron = GRAINS / unit.electrons
        electrons = np.maximum(np.ceil(missing_grains / grains_per_electron), 0.0)
        missing_grains = rng.standard_gamma(electrons) * grains_per_electron
    remaining = np.maximum(np.ceil(missing_grains), 1.0).astype(np.int32)
    words = generator(seed, "fast engine: spikes").integers(0, 1 << 32, 2, dtype=np.uint32)
    fired = np.zeros(phase.size, dtype=np.uint32)
    return FastState(PixelLaw.of(unit), _padded(remaining, GRAINS), _padded(fired), (words[0], words[1]))


def run(state: FastState, segment: Segment, out: Spikes | None = None, *, threads: int | None = None) -> Spikes:
    """Advance `state` over a segment.

    Args:
        out: (count, P) uint8, C-contiguous, for the spikes.
        threads: default NUMBA_NUM_THREADS.

    Returns:
        Spikes (count, P) uint8, 0 or 1, in `out` where that is given.
    """
    if out is None:
        out = np.empty((segment.count, segment.radiance0.size), dtype=np.uint8)
    run_together([Stretch.of(state, [segment], out)], threads=threads)
    return out


def run_packed(state: FastState, segment: Segment, *, threads: int | None = None) -> NDArray[np.uint8]:
    """Advance `state` over a segment; returns spikes (count, ceil(P/8)) uint8: pixel p is bit p % 8 of byte p // 8."""
    packed = np.empty((segment.count, (segment.radiance0.size + 7) // 8), dtype=np.uint8)
    _advance([Stretch.of(state, [segment], packed)], [packed], True, threads)
    return packed


class Stretch(NamedTuple):
    """Frames of one camera for a call of a kernel, MAX_SEGMENT at most."""

    state: FastState
    pieces: NDArray[np.int64]
    """(S, PIECE_COLUMNS), addresses of light and frames of key intervals, see `tile_driver.advance`."""
    light: Sequence[Pictures]
    """The arrays at those addresses."""
    out: Spikes
    """(frames, P), C-contiguous, overwritten."""
    pixels: int
    """P."""

    @property
    def changes_often(self) -> bool:
        """Whether its light changes often, so that `every_frame` is faster."""
        frames = len(self.out)
        return frames >= AT_ONCE and frames < OFTEN * len(self.pieces)

    @classmethod
    def of(cls, state: FastState, segments: Sequence[Segment], out: Spikes) -> Stretch:
        """The stretch of segments that follow one another."""
        light = [np.ascontiguousarray(end) for one in segments for end in (one.radiance0, one.radiance1)]
        pieces = [
            (address_of(low), address_of(high), one.length, one.first, one.count)
            for one, low, high in zip(segments, light[::2], light[1::2], strict=True)
        ]
        return cls(state, np.array(pieces, np.int64), light, out, segments[0].radiance0.size)


def run_together(stretches: Sequence[Stretch], *, threads: int | None = None) -> None:
    """Advance cameras, each over its stretch, in one compiled call a thread (default NUMBA_NUM_THREADS)."""
    whole = [  # whole words of pixels
        one.out if one.pixels % 8 == 0 else np.empty((len(one.out), one.pixels + -one.pixels % 8), dtype=np.uint8)
        for one in stretches
    ]
    _advance(stretches, whole, False, threads)
    for one, spikes in zip(stretches, whole, strict=True):
        if spikes is not one.out:
            one.out[:] = spikes[:, : one.pixels]


def _advance(
    stretches: Sequence[Stretch], outs: Sequence[NDArray[np.uint8]], packed: bool, threads: int | None
) -> None:
    """Advance cameras; outs: spikes of each as bits or as bytes (`tile_driver.advance`)."""
    jobs = list(zip(stretches, outs, strict=True))
    for often, advance in ((False, tile_driver.advance), (True, tile_driver.advance_often)):
        if of_kind := [job for job in jobs if job[0].changes_often is often]:
            work, steps = _table(of_kind, packed)
            run_in_threads(advance, work, len(work[1]), steps, threads)


def _table(jobs: Sequence[tuple[Stretch, NDArray[np.uint8]]], packed: bool) -> tuple[tuple[Any, ...], int]:
    """The arguments of a loop for cameras and the arrays of their spikes, and the number of pixel-steps."""
    cameras, bands, done = [], [], 0
    for number, (one, out) in enumerate(jobs):
        pieces = done, done + len(one.pieces)
        table = one.state.addresses
        cameras.append((*table.arrays, address_of(out), *table.words, one.pixels, len(out), *pieces))
        bands += [(number, band) for band in range(-(-one.state.remaining.size // tile_driver.WIDTH))]
        done = pieces[1]
    work = (
        np.array(cameras, np.int64),
        np.array(bands, np.int32),
        np.concatenate([one.pieces for one, _ in jobs]) if len(jobs) > 1 else jobs[0][0].pieces,
        np.float32(DENSE),
        packed,
    )
    return work, sum(one.pixels * len(out) for one, out in jobs)


def stretches(
    state: FastState, light: Keyframes | Pictures, start: int, imaging: Imaging, spikes: Spikes
) -> Iterator[Stretch]:
    """The frames from `start` on, as many as there are in spikes (frames, P), through the optics."""
    if isinstance(light, Keyframes) and not imaging:
        rows = cuts(light.frame, start, start + len(spikes))
        pieces = _at_keys(rows, address_of(light.radiance), light.radiance.strides[0])
        if len(pieces):
            return _key_stretches(state, light.radiance, pieces, spikes)
    return _segment_stretches(state, map(imaging.segment_image, segments(light, start, len(spikes))), spikes)


def _key_stretches(
    state: FastState, radiance: Pictures, pieces: NDArray[np.int64], spikes: Spikes
) -> Iterator[Stretch]:
    """Stretches between keys at whole frames, whose pictures are not copied."""
    if len(spikes) <= MAX_SEGMENT:
        yield Stretch(state, pieces, (radiance,), spikes, spikes.shape[1])
        return
    ends = np.cumsum(pieces[:, PIECE_COUNT])
    first = done = 0
    while first < len(pieces):
        after = int(np.searchsorted(ends, done + MAX_SEGMENT, side="right"))
        stop = int(ends[after - 1])
        yield Stretch(state, pieces[first:after], (radiance,), spikes[done:stop], spikes.shape[1])
        first, done = after, stop


@njit(cache=True, nogil=True)
def _at_keys(rows: NDArray[np.int64], address: int, size: int) -> NDArray[np.int64]:
    """Rows of `cuts` as pieces of `tile_driver.advance`; none where a row needs a picture that is no key's.

    Args:
        address: of the first key's picture.
        size: bytes from one picture to the next.
    """
    pieces = np.empty((len(rows), PIECE_COLUMNS), np.int64)
    for k in range(len(rows)):
        if rows[k, KEY0] < 0 or rows[k, KEY1] < 0:
            return pieces[:0]
        pieces[k, LIGHT0] = address + rows[k, KEY0] * size
        pieces[k, LIGHT1] = address + rows[k, KEY1] * size
        pieces[k, PIECE_LENGTH], pieces[k, PIECE_FIRST] = rows[k, LENGTH], rows[k, FIRST]
        pieces[k, PIECE_COUNT] = rows[k, COUNT]
    return pieces


def _segment_stretches(state: FastState, segments: Iterator[Segment], spikes: Spikes) -> Iterator[Stretch]:
    """Stretches of pictures that are computed one after another."""
    waiting: list[Segment] = []
    done = frames = 0
    for segment in segments:
        if frames + segment.count > MAX_SEGMENT:
            yield Stretch.of(state, waiting, spikes[done : done + frames])
            waiting, done, frames = [], done + frames, 0
        waiting.append(segment)
        frames += segment.count
    yield Stretch.of(state, waiting, spikes[done : done + frames])


def unpack(packed: NDArray[np.uint8], pixels: int, out: Spikes | None = None) -> NDArray[np.uint8]:
    """Bits (count, ceil(pixels/8)) to spikes (count, pixels) uint8, in `out` where that is given."""
    if out is None:
        out = np.empty((len(packed), pixels), dtype=np.uint8)
    padded = 8 * packed.shape[1]
    spikes = out if pixels == padded else np.empty((len(packed), padded), dtype=np.uint8)
    tile_driver.unpack(packed.reshape(-1), spikes.reshape(-1).view(np.uint64))
    if spikes is not out:
        out[:] = spikes[:, :pixels]
    return out


def _shape_of_law(unit: Unit) -> tuple[np.float32, ...]:
    """The fit at the median pixel, rounded to three digits, so that cameras of one model share it."""
    kappa = float(f"{np.median(unit.kappa):.3g}")
    electrons = float(f"{np.median(unit.electrons):.3g}") if unit.shot else np.inf
    return fitted_polynomial(electrons, kappa)


def _padded(values: NDArray[Any], fill: int = 0) -> NDArray[Any]:
    padded = np.full(values.size + -values.size % TILE, fill, values.dtype)
    padded[: values.size] = values
    return padded


def compilable(radiance: Pictures) -> Pictures:
    """The array, or a copy of a read-only or strided one: microseconds, where compiling for it takes seconds."""
    plain = radiance.flags.c_contiguous and radiance.flags.writeable
    return radiance if plain else radiance.copy()
