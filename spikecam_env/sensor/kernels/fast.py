"""The fast engine: random numbers only per spike.

Poisson arrivals of rate lambda(t) are a unit-rate process in Lambda(t) = integral of lambda, so a pixel that needs N
electrons fires when Lambda has advanced by Gamma(N, 1), with the reset's draw mixed in (`quantile`).  Between spikes
nothing is drawn: the crossing time follows from the light ramp (`loop`).  Without noise the bits are the reference's.

The number of threads (`threads`) changes no bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor.compiled_tools.intrinsics import address_of
from spikecam_env.sensor.compiled_tools.quantile import MIN_ELECTRONS, fitted_polynomial
from spikecam_env.sensor.effects import Effect
from spikecam_env.sensor.kernels import every_frame, loop
from spikecam_env.sensor.light import GRAINS, Segment
from spikecam_env.sensor.model import generator
from spikecam_env.sensor.unit import Unit
from spikecam_env.threads import as_many_as_pay, together

DENSE = 0.7
"""Spikes a pixel and frame from which on streaming frame by frame is faster than jumping."""

OFTEN = 4.0
"""Frames a key interval, on average over a stretch, below which to go frame by frame is faster than from spike to spike
(`every_frame`): 1.6 times at 2 frames, 1.0 to 1.2 at 4, 0.8 to 1.1 at 8, at mean intervals of 3 to 100 frames."""

FEWEST = MIN_ELECTRONS / 2
"""Electrons to a threshold, at least, of which a spike's noise is drawn.  The law's shape is that of the median pixel:
with the noise of fewer electrons, in the tail of a spread, it would reach below zero charge."""


def missing(effects: Sequence[Effect]) -> list[str]:
    """Names of effects, or options of them, that this engine does not carry: all that do something a frame."""
    names = [e.name for e in effects if not e.is_fixed()]
    names += ["shot_noise.dark_is_noisy=false" for e in effects if getattr(e, "dark_is_noisy", True) is False]
    quanta = [getattr(e, "quanta", MIN_ELECTRONS) for e in effects]
    return names + [f"shot_noise.quanta={n:g} (below {MIN_ELECTRONS:g})" for n in quanta if n < MIN_ELECTRONS]


@dataclass(frozen=True)
class PixelLaw:
    """A unit in the loop's numbers: float32, padded to whole tiles.

    gain, dark [grains/frame]; spread [grains], standard deviation of a spike's charge; polynomial: its law's shape.
    """

    gain: NDArray[np.float32]
    dark: NDArray[np.float32]
    spread: NDArray[np.float32]
    polynomial: tuple[np.float32, ...]

    @classmethod
    def of(cls, unit: Unit) -> PixelLaw:
        """The shape is fitted at the median pixel; the spread is each pixel's own."""
        gain, dark = unit.grains_per_frame
        spread = GRAINS * np.sqrt(per_electron(unit) + unit.kappa**2)
        return cls(_padded(gain), _padded(dark), _padded(spread.astype(np.float32)), _shape_of_law(unit))

    def __deepcopy__(self, memo: dict[int, Any]) -> PixelLaw:
        return self  # never written to


def per_electron(unit: Unit) -> NDArray[np.float64]:
    """1/N of every pixel (P,), 0 without shot noise; N no less than FEWEST."""
    return 1.0 / np.maximum(unit.electrons, FEWEST) if unit.shot else np.zeros(unit.electrons.size)


@dataclass
class FastState:
    """Pixels mid-stream, padded to whole tiles.

    remaining: int32 grains to the next spike.  fired: uint32 spikes so far.
    seeds: the two words that, with a pixel's number and its spike's, fix every draw.
    What is written is written into these arrays: others do not take their place.
    """

    law: PixelLaw
    remaining: NDArray[np.int32]
    fired: NDArray[np.uint32]
    seeds: tuple[np.uint32, np.uint32]

    @cached_property
    def where(self) -> Where:
        """Where the arrays are in memory; a copy's are elsewhere."""
        polynomial = np.array(self.law.polynomial, np.float32)
        arrays = self.law.gain, self.law.dark, self.law.spread, polynomial, self.remaining, self.fired
        return Where(tuple(map(address_of, arrays)), (int(self.seeds[0]), int(self.seeds[1])), polynomial)

    def __getstate__(self) -> dict[str, Any]:
        return {f.name: getattr(self, f.name) for f in fields(self)}


class Where(NamedTuple):
    """addresses: of a camera's arrays, in the order of `loop.advance`; then its seed's words.  polynomial: one of the
    arrays, which nobody else holds."""

    addresses: tuple[int, ...]
    words: tuple[int, int]
    polynomial: NDArray[np.float32]


def start(unit: Unit, phase: NDArray[np.float64], seed: int) -> FastState:
    """Pixels part-way through a cycle: phase (P,) in [0, 1) is the share of the nominal threshold collected.

    The first spike's charge is drawn literally: threshold, whole electrons still missing, their Gamma waiting charge.
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


def run(
    state: FastState, segment: Segment, out: NDArray[np.uint8] | None = None, *, threads: int | None = None
) -> NDArray[np.uint8]:
    """Advance `state` over a segment; returns spikes (count, P) uint8, 0 or 1, in `out` where that is given.

    out: (count, P) uint8, C-contiguous.  threads: default NUMBA_NUM_THREADS.
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
    """Frames, MAX_SEGMENT at most, that one camera is to be advanced over.

    pieces: (S, PIECE_COLUMNS) int64, addresses of light and frames of key intervals, see `loop.advance`.
    light: the arrays at those addresses.  out: (frames, P) uint8, C-contiguous, where spikes go.  pixels: P.
    """

    state: FastState
    pieces: NDArray[np.int64]
    light: Sequence[NDArray[np.float32]]
    out: NDArray[np.uint8]
    pixels: int

    @property
    def changes_often(self) -> bool:
        """Whether its light does, so that it is advanced frame by frame (`every_frame`)."""
        frames = len(self.out)
        return frames >= every_frame.AT_ONCE and frames < OFTEN * len(self.pieces)

    @classmethod
    def of(cls, state: FastState, segments: Sequence[Segment], out: NDArray[np.uint8]) -> Stretch:
        """Over segments that follow one another."""
        light = [np.ascontiguousarray(end) for each in segments for end in (each.radiance0, each.radiance1)]
        pieces = [
            (address_of(low), address_of(high), each.length, each.first, each.count)
            for each, low, high in zip(segments, light[::2], light[1::2], strict=True)
        ]
        return cls(state, np.array(pieces, np.int64), light, out, segments[0].radiance0.size)


def run_together(stretches: Sequence[Stretch], *, threads: int | None = None) -> None:
    """Advance cameras, each over its stretch, in one compiled call a thread: spikes go where each says.

    threads: default NUMBA_NUM_THREADS.
    """
    whole = [one.out if one.pixels % 8 == 0 else _wide(one) for one in stretches]
    _advance(stretches, whole, False, threads)
    for one, spikes in zip(stretches, whole, strict=True):
        if spikes is not one.out:
            one.out[:] = spikes[:, : one.pixels]


def _wide(one: Stretch) -> NDArray[np.uint8]:
    """Room for whole words of pixels."""
    return np.empty((len(one.out), one.pixels + -one.pixels % 8), dtype=np.uint8)


def _advance(
    stretches: Sequence[Stretch], outs: Sequence[NDArray[np.uint8]], packed: bool, threads: int | None
) -> None:
    """outs: where the spikes of each go, as bits or as bytes (`loop.advance`)."""
    jobs = list(zip(stretches, outs, strict=True))
    for often in (False, True):
        of_kind = [job for job in jobs if job[0].changes_often is often]
        if of_kind:
            _share(of_kind, often, packed, threads)


def _share(jobs: Sequence[tuple[Stretch, NDArray[np.uint8]]], often: bool, packed: bool, threads: int | None) -> None:
    """One compiled call a thread: frame by frame where light changes often, else from spike to spike."""
    cameras, bands, done = [], [], 0
    for number, (one, out) in enumerate(jobs):
        pieces = done, done + len(one.pieces)
        where = one.state.where
        cameras.append((*where.addresses, address_of(out), *where.words, one.pixels, len(out), *pieces))
        bands += [(number, band) for band in range(-(-one.state.remaining.size // loop.WIDTH))]
        done = pieces[1]
    steps = sum(one.pixels * len(out) for one, out in jobs)
    count = as_many_as_pay(threads, len(bands), steps)
    tickets = np.zeros((count, 8), dtype=np.int64)
    tickets[:, 0] = len(bands) * np.arange(count) // count
    work = (
        tickets,
        np.array(cameras, np.int64),
        np.array(bands, np.int32),
        np.concatenate([one.pieces for one, _ in jobs]) if len(jobs) > 1 else jobs[0][0].pieces,
        np.float32(DENSE),
        packed,
    )
    advance = every_frame.advance if often else loop.advance
    together([partial(advance, worker, *work) for worker in range(count)], shared=True)


def unpack(packed: NDArray[np.uint8], pixels: int, out: NDArray[np.uint8] | None = None) -> NDArray[np.uint8]:
    """Bits (count, ceil(pixels/8)) to spikes (count, pixels) uint8, in `out` where that is given."""
    if out is None:
        out = np.empty((len(packed), pixels), dtype=np.uint8)
    padded = 8 * packed.shape[1]
    spikes = out if pixels == padded else np.empty((len(packed), padded), dtype=np.uint8)
    loop.unpack(packed.reshape(-1), spikes.reshape(-1).view(np.uint64))
    if spikes is not out:
        out[:] = spikes[:, :pixels]
    return out


def _shape_of_law(unit: Unit) -> tuple[np.float32, ...]:
    kappa = _rounded(float(np.median(unit.kappa)))
    electrons = _rounded(float(np.median(unit.electrons))) if unit.shot else np.inf
    return fitted_polynomial(electrons, kappa)


def _rounded(value: float) -> float:
    """To three digits, so that cameras of one model share a fit."""
    return float(f"{value:.3g}")


def _padded(values: NDArray[Any], fill: int = 0) -> NDArray[Any]:
    padded = np.full(values.size + -values.size % loop.TILE, fill, values.dtype)
    padded[: values.size] = values
    return padded


def compilable(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """A read-only or strided array would be compiled for anew: seconds, against microseconds for a copy."""
    plain = radiance.flags.c_contiguous and radiance.flags.writeable
    return radiance if plain else radiance.copy()
