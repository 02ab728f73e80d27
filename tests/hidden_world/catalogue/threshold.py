"""The threshold: patterns of it, noise on it, and the effects of supply and clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tests.hidden_world.catalogue.drawing import (
    RESET_SUBSTEPS,
    Array,
    between,
    followed,
    frames_of,
    lines,
    log_uniform,
    shape,
    swung,
)
from tests.hidden_world.integrator import Physics
from tests.hidden_world.mechanism import Law, Mechanism, OnCamera, OnPhysics, Parameters, Rng
from tests.hidden_world.unit import FRAME_S, SWING_V, Camera
from tests.hidden_world.waves import Clock, Sine, SlewingClock

KEPT = 0.6
"""Of a frame's noise, in the next one, where noise has a memory: a time constant of two frames."""
BURSTS = 0.05
"""Share of the frames in which noise that comes in bursts is there."""


def _lines_of(axis: int, numbers: Callable[[Rng, int], Array]) -> Callable[[Camera, float, Rng], Array]:
    """A number a row (axis 0) or column (axis 1), as an array over the pixels."""

    def draw(camera: Camera, sigma: float, rng: Rng) -> Array:
        size = [1, 1]
        size[axis] = camera.shape[axis]
        return sigma * numbers(rng, camera.shape[axis]).reshape(size)

    return draw


def _normal(rng: Rng, size: int) -> Array:
    return rng.standard_normal(size)


def _alternating(rng: Rng, size: int) -> Array:
    return rng.choice([-1.0, 1.0]) * (-1.0) ** np.arange(size)


def _on_swing(lines: Callable[[Camera, float, Rng], Array]) -> OnCamera:
    return lambda camera, p, rng: swung(camera, 1.0 + lines(camera, p["sigma_mV"], rng) * camera.per_mv)


def _on_gain(lines: Callable[[Camera, float, Rng], Array]) -> OnCamera:
    """Of light alone, relative as sigma over the swing."""
    return lambda camera, p, rng: replace(
        camera, gain=camera.gain * (1.0 + lines(camera, p["sigma_mV"], rng) * 1e-3 / SWING_V)
    )


def _ripples(*harmonics: tuple[float, float]) -> OnPhysics:
    """(share, multiple of the frequency) of each sine on all thresholds, in one phase."""

    def ripple(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        cycles, phase = p["frequency_hz"] * FRAME_S, p.get("phase_cycles", rng.random())
        for share, times in harmonics:
            ph.threshold_waves += (Sine(share * p["ripple"], times * cycles, times * phase),)

    return ripple


def _ripple_of_reset(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    cycles = p["frequency_hz"] * FRAME_S
    ph.laws = ph.laws._replace(ripple=p["ripple"], ripple_cycles=cycles, ripple_phase=rng.random())
    ph.substeps = max(ph.substeps, RESET_SUBSTEPS)


def _clock(kind: type[Clock]) -> OnPhysics:
    """Just after its edge the reference is off by amplitude_mV, below 0 where it falls."""

    def feed(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        ph.clock = kind(-p["amplitude_mV"], p["phase_frames"], frames_of(p["tau_us"]))

    return feed


# ---- noise drawn a frame


def _common(rng: Rng, frames: int, rows: int) -> Array:
    return rng.standard_normal((frames, 1)) * np.ones((1, rows))


def _common_with_memory(rng: Rng, frames: int, rows: int) -> Array:
    return followed(rng.standard_normal((frames, 1)), KEPT) * np.ones((1, rows))


def _common_bursts(rng: Rng, frames: int, rows: int) -> Array:
    return _common(rng, frames, rows) * (rng.random((frames, 1)) < BURSTS) / np.sqrt(BURSTS)


def _by_row(rng: Rng, frames: int, rows: int) -> Array:
    return rng.standard_normal((frames, rows))


def _by_pair_of_rows(rng: Rng, frames: int, rows: int) -> Array:
    return np.repeat(rng.standard_normal((frames, (rows + 1) // 2)), 2, axis=1)[:, :rows]


def _by_row_with_memory(rng: Rng, frames: int, rows: int) -> Array:
    return followed(rng.standard_normal((frames, rows)), KEPT)


def _rows(noise: Callable[[Rng, int, int], Array]) -> OnPhysics:
    """Noise of (frames, rows), of variance one."""

    def add(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        millivolt = p["sigma_mV"] * noise(rng, frames, camera.shape[0])
        ph.row_mv = (millivolt if ph.row_mv is None else ph.row_mv + millivolt).astype(np.float32)

    return add


def _flicker(exponent: float) -> OnPhysics:
    """S(f) ~ f^-exponent from six Lorentzians two octaves apart; of 1/f (sigma^2 / ln 2) / f, two octaves each."""

    def add(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        octaves = 2.0 * (np.arange(6) - 2.5)
        ph.slow_tau = np.array([3.0 * 4.0**j for j in range(6)])
        ph.slow_mv = np.sqrt(2.0) * p["sigma_mV"] * 2.0 ** (0.5 * (exponent - 1.0) * octaves)

    return add


def _one_trap(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    """With half of the variance of the six."""
    ph.slow_tau, ph.slow_mv = np.array([p["tau_frames"]]), np.array([np.sqrt(6.0) * p["sigma_mV"]])


def _alike(rng: Rng, shape: tuple[int, int]) -> Array:
    return np.ones(shape)


def _each_its_own(rng: Rng, shape: tuple[int, int]) -> Array:
    """Deviations whose squares are exponential, of mean one."""
    return np.sqrt(rng.exponential(1.0, shape))


def of_a_reset(sizes: Callable[[Rng, tuple[int, int]], Array]) -> OnCamera:
    """A wider draw at each reset, by so much in each pixel."""
    return lambda camera, p, rng: replace(
        camera, kappa=np.hypot(camera.kappa, p["sigma_mV"] * sizes(rng, camera.shape) * camera.per_mv)
    )


def _of_a_frame(sizes: Callable[[Rng, tuple[int, int]], Array]) -> OnPhysics:
    def add(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        which = np.random.default_rng(int(p.get("which", 0.0)))
        ph.frame_noise_mv = p["sigma_mV"] * sizes(which, camera.shape).reshape(-1)

    return add


# ---- the supply of a row


def _drops(axis: int, rises: bool = False) -> OnPhysics:
    """By the share of the pixel's row (axis 1) or column (axis 0) that fired in the frame before.

    rises: from nothing at the pad to twice the mean at the other end.
    """

    def drop(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        along = 2.0 * np.arange(camera.shape[1]) / (camera.shape[1] - 1) if rises else np.ones(camera.shape[1])
        ph.droop, ph.droop_axis = p["droop"] * np.tile(along, camera.shape[0]), axis

    return drop


wide_draw, uneven_draw = of_a_reset(_alike), of_a_reset(_each_its_own)

_ROWS = "Nakamura (ed.), Image Sensors (2006): row drivers"
_NOISE = "van der Ziel, Noise in Solid State Devices and Circuits (1986)"

MECHANISMS = (
    Mechanism(
        "supply_ripple",
        "phi (1 + rho sin), the phase new in every recording",
        shape(frequency_hz=lines(100.0, 3000.0)),
        physics=_ripples((1.0, 1.0)),
        far=(
            Law("of the reset", "the level that a pixel is reset to swings: a cycle keeps what it was at its reset",
                physics=_ripple_of_reset,
                source="Razavi, Analog CMOS Circuits: supply rejection of either rail"),
            Law("rectified", "0.8 rho sin, and 0.6 rho sin of twice the frequency",
                physics=_ripples((0.8, 1.0), (0.6, 2.0)),
                source="Horowitz & Hill, The Art of Electronics: ripple of a rectifier"),
        ),
    ),
    Mechanism(
        "clock_feedthrough",
        "the reference of all falls at one moment of the array's clock, and recovers",
        shape(phase_frames=between(0.0, 1.0), tau_us=between(2.5, 10.0)),
        signs=(-1.0,),
        physics=_clock(Clock),
        far=(
            Law("slewing", "it recovers along a straight line, in 2 tau", physics=_clock(SlewingClock),
                source="Razavi, Analog CMOS Circuits: slewing"),
        ),
    ),
    Mechanism(
        "common_threshold_noise",
        "one draw a frame for all",
        physics=_rows(_common),
        far=(
            Law("with memory", "AR(1): 0.6 of it is there in the next frame", physics=_rows(_common_with_memory),
                source=f"{_NOISE}: low-pass filtered"),
            Law("bursts", "in one frame of twenty, sqrt(20) times as large", physics=_rows(_common_bursts),
                source="impulsive interference: Middleton class A"),
        ),
    ),
    Mechanism(
        "row_temporal_noise",
        "one draw a frame and row",
        physics=_rows(_by_row),
        far=(
            Law("pairs of rows", "one draw a frame and two rows", physics=_rows(_by_pair_of_rows), source=_ROWS),
            Law("with memory", "AR(1): 0.6 of it is there in the next frame", physics=_rows(_by_row_with_memory),
                source=f"{_NOISE}: low-pass filtered"),
        ),
    ),
    Mechanism(
        "threshold_flicker_noise",
        "1/f, each pixel its own",
        physics=_flicker(1.0),
        far=(
            Law("steeper", "1/f^1.4", physics=_flicker(1.4), source=f"{_NOISE}: exponents of 0.7 to 1.4"),
            Law("one trap", "one Lorentzian of 30 to 300 frames", shape(tau_frames=log_uniform(30.0, 300.0)),
                physics=_one_trap, source=f"{_NOISE}: generation-recombination"),
        ),
    ),
    Mechanism(
        "row_fixed_pattern",
        "V_d of a row",
        camera=_on_swing(_lines_of(0, _normal)),
        far=(
            Law("of gain", "light of a row counts more or less, the dark does not",
                camera=_on_gain(_lines_of(0, _normal)),
                source="Janesick, Photon Transfer (2007): photo-response non-uniformity"),
            Law("alternating", "V_d of even rows against odd ones", camera=_on_swing(_lines_of(0, _alternating)),
                source=_ROWS),
        ),
    ),
    Mechanism(
        "column_fixed_pattern",
        "V_d of a column",
        camera=_on_swing(_lines_of(1, _normal)),
        far=(
            Law("of gain", "light of a column counts more or less, the dark does not",
                camera=_on_gain(_lines_of(1, _normal)),
                source="Janesick, Photon Transfer (2007): photo-response non-uniformity"),
            Law("alternating", "V_d of even columns against odd ones", camera=_on_swing(_lines_of(1, _alternating)),
                source="Nakamura (ed.), Image Sensors (2006): two read-out banks"),
        ),
    ),
    Mechanism(
        "excess_threshold_noise",
        "a wider draw at each reset",
        camera=wide_draw,
        far=(
            Law("each its own", "wider by another deviation in each pixel, squares exponential", camera=uneven_draw,
                source="Janesick, Photon Transfer (2007): noise histograms with a tail"),
        ),
    ),
    Mechanism(
        "frame_threshold_noise",
        "a draw a pixel and frame",
        physics=_of_a_frame(_alike),
        far=(
            Law("each its own", "with another deviation in each pixel, squares exponential",
                lambda rng: {"which": float(rng.integers(0, 2**31))}, physics=_of_a_frame(_each_its_own),
                source="Janesick, Photon Transfer (2007): noise histograms with a tail"),
        ),
    ),
    Mechanism(
        "ir_drop",
        "phi (1 + d a), a: share of the row that fired in the frame before",
        physics=_drops(axis=1),
        far=(
            Law("from the pad", "rising along the row from 0 to 2 d a", physics=_drops(axis=1, rises=True),
                source="Dally & Poulton, Digital Systems Engineering: a line fed from one end"),
            Law("by columns", "a: share of the column that fired", physics=_drops(axis=0),
                source="Dally & Poulton, Digital Systems Engineering: a supply mesh with vertical straps"),
        ),
    ),
)  # fmt: skip
