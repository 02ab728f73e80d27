"""The read-out: its moments, and its reports."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tests.hidden_world.catalogue.drawing import (
    Array,
    Whole,
    clusters,
    followed,
    frames_of,
    log_uniform,
    shape,
    some_pixels,
    whole,
)
from tests.hidden_world.integrator import Physics
from tests.hidden_world.mechanism import Bits, Law, Mechanism, OnBits, OnCamera, OnPhysics, Parameters, Rng
from tests.hidden_world.unit import Camera

WANDER = 0.5
"""Share of its error that a loop keeps from frame to frame when it locks to a reference."""
FAINT = 0.05
"""Gain of an almost dead pixel, over that of a whole one."""
GLITCH = 8
"""Pixels side by side that a glitch of a row's bus makes spikes of."""


def _jitters(edges: Callable[[Rng, int, Parameters], Array]) -> OnPhysics:
    """Edges of variance one."""

    def move(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        ph.edge = frames_of(1e-3 * p["sigma_ns"]) * edges(rng, frames + 1, p)

    return move


def _white(rng: Rng, count: int, p: Parameters) -> Array:
    return rng.standard_normal(count)


def _wandering(rng: Rng, count: int, p: Parameters) -> Array:
    return followed(rng.standard_normal(count), WANDER)


def _spur(rng: Rng, count: int, p: Parameters) -> Array:
    return np.sqrt(2.0) * np.sin(2.0 * np.pi * (np.arange(count) / p["period_frames"] + rng.random()))


def _dies(where: Callable[[Camera, float, Rng], Whole], left: float = 0.0) -> OnCamera:
    """So much of gain and dark current left to some pixels."""

    def kill(camera: Camera, p: Parameters, rng: Rng) -> Camera:
        factor = np.ones(camera.shape)
        factor.flat[where(camera, p["fraction"], rng)] = left
        return replace(camera, gain=camera.gain * factor, dark=camera.dark * factor)

    return kill


def _reads(order: Callable[[NDArray[np.int64], int], Array]) -> OnPhysics:
    """`order`: 0 (the first read) .. 1 (at the frame's end) of each row; upwards where span is negative."""

    def read(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        rows = np.arange(camera.shape[0])
        early = abs(p["span"]) * (1.0 - order(rows, rows.size))
        ph.skew = early if p["span"] >= 0.0 else early[::-1].copy()

    return read


# ---- reports


def _misses(bits: Bits, p: Parameters, rng: Rng) -> Bits:
    at = chosen(bits, p["probability"], rng)
    bits.reshape(-1)[at] = 0
    return bits


def _misses_where_busy(bits: Bits, p: Parameters, rng: Rng) -> Bits:
    """In proportion to the share of the row that fires in the frame; as often as stated where it is a fifth."""
    for frame in bits:
        busy = 5.0 * frame.mean(axis=1, keepdims=True)
        frame[rng.random(frame.shape) < p["probability"] * busy] = 0
    return bits


def _misses_words(bits: Bits, p: Parameters, rng: Rng) -> Bits:
    frames, rows = bits.shape[:2]
    at = np.unique(rng.integers(0, frames * rows, rng.poisson(p["probability"] * frames * rows)))
    bits.reshape(frames * rows, -1)[at] = 0
    return bits


def _adds(bits: Bits, p: Parameters, rng: Rng) -> Bits:
    at = rng.integers(0, bits.size, rng.poisson(_draws(p["probability"], bits.size)))
    bits.reshape(-1)[at] = 1
    return bits


def _adds_in_some(bits: Bits, p: Parameters, rng: Rng) -> Bits:
    """Rates of an exponential law over the pixels, the same in every recording."""
    weight = np.random.default_rng(int(p["which"])).exponential(1.0, bits[0].size)
    count = rng.poisson(p["probability"] * bits.size)
    pixel = rng.choice(bits[0].size, count, p=weight / weight.sum())
    bits.reshape(len(bits), -1)[rng.integers(0, len(bits), count), pixel] = 1
    return bits


def _adds_glitches(bits: Bits, p: Parameters, rng: Rng) -> Bits:
    frames, rows, columns = bits.shape
    length = min(GLITCH, columns)
    count = rng.poisson(p["probability"] * bits.size / length)
    word = rng.integers(0, frames * rows, count)
    first = rng.integers(0, columns - length + 1, count)
    for k in range(length):
        bits.reshape(frames * rows, columns)[word, first + k] = 1
    return bits


def _repeats(delays: Callable[[Rng, Parameters, int], Whole]) -> OnBits:
    def again(bits: Bits, p: Parameters, rng: Rng) -> Bits:
        at = chosen(bits, p["probability"], rng)
        at = at + delays(rng, p, at.size) * bits[0].size
        bits.reshape(-1)[at[at < bits.size]] = 1
        return bits

    return again


def _fixed(rng: Rng, p: Parameters, count: int) -> Whole:
    return np.full(count, int(p["delay_frames"]))


def _geometric(rng: Rng, p: Parameters, count: int) -> Whole:
    return rng.geometric(1.0 / p["delay_frames"], count)


def chosen(bits: Bits, probability: float, rng: Rng) -> Whole:
    """Flat indices of spikes, each picked with that probability."""
    flat = bits.reshape(-1)
    total = int(np.count_nonzero(flat))
    draws = rng.poisson(_draws(probability, total))
    return _places(flat, np.unique(rng.integers(0, total, draws)) if total else np.zeros(0, np.int64))


def _draws(probability: float, count: int) -> float:
    """Mean number of draws, each of one of `count` places, from which a place is drawn at all with this probability."""
    return -np.log1p(-min(probability, 1.0 - 1e-9)) * count


@njit(cache=True)
def _places(flat, which):
    """Where the `which`-th ones of `flat` are, in order."""
    at = np.empty(which.size, np.int64)
    seen, k = 0, 0
    for i in range(flat.size):
        if k == which.size:
            break
        if flat[i]:
            if seen == which[k]:
                at[k] = i
                k += 1
            seen += 1
    return at


_WHICH = shape(which=whole(0, 2**31))

MECHANISMS = (
    Mechanism(
        "clock_jitter",
        "each read-out early or late by itself",
        physics=_jitters(_white),
        far=(
            Law("wandering", "AR(1): 0.5 of an edge's error is in the next one's", physics=_jitters(_wandering),
                source="Gardner, Phaselock Techniques: jitter within the loop's bandwidth"),
            Law("spur", "a sine of 2.5 to 8 frames", shape(period_frames=log_uniform(2.5, 8.0)),
                physics=_jitters(_spur), source="Gardner, Phaselock Techniques: a reference spur"),
        ),
    ),
    Mechanism(
        "dead_pixels",
        "a few pixels never fire",
        camera=_dies(some_pixels),
        far=(
            Law("clusters", "in squares of two by two", camera=_dies(clusters), source="dust on the chip"),
            Law("almost", "a twentieth of their charge is left", camera=_dies(some_pixels, FAINT),
                source="EMVA 1288: defect pixels by their response"),
        ),
    ),
    Mechanism(
        "readout_skew",
        "row r is read |s| (1 - r/(H-1)) early, or from the last row on",
        signs=(-1.0, 1.0),
        physics=_reads(lambda row, rows: row / (rows - 1)),
        far=(
            Law("two banks", "both halves are read at once, each from its first row on",
                physics=_reads(lambda row, rows: row % (rows // 2) / (rows // 2 - 1)),
                source="Nakamura (ed.), Image Sensors (2006): parallel read-out"),
            Law("groups", "eight groups of rows, each at one moment",
                physics=_reads(lambda row, rows: np.floor(8.0 * row / rows) / 7.0),
                source="Nakamura (ed.), Image Sensors (2006): shared row drivers"),
        ),
    ),
    Mechanism(
        "missed_spikes",
        "a spike is not reported",
        bits=_misses,
        far=(
            Law("busy rows", "in proportion to the share of the row that fires; as stated at a fifth",
                bits=_misses_where_busy, source="Boahen (2000): collisions in a shared bus"),
            Law("words", "the whole row of a frame is lost", bits=_misses_words,
                source="a packet that fails its checksum"),
        ),
    ),
    Mechanism(
        "spurious_spikes",
        "a report without a spike",
        bits=_adds,
        far=(
            Law("some pixels", "rates of an exponential law over the pixels", _WHICH, bits=_adds_in_some,
                source="comparators of unequal noise"),
            Law("glitches", "eight side by side in a row's word", bits=_adds_glitches,
                source="burst errors: Gilbert (1960)"),
        ),
    ),
    Mechanism(
        "afterpulsing",
        "a spike is reported again some frames later",
        shape(delay_frames=whole(1, 6)),
        bits=_repeats(_fixed),
        far=(
            Law("exponential", "after a geometric law of frames with the stated mean", shape(delay_frames=whole(2, 6)),
                bits=_repeats(_geometric), source="Knoll, Radiation Detection: afterpulses of trap release"),
        ),
    ),
)  # fmt: skip
