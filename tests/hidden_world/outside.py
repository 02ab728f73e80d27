"""Mechanisms that no catalogue of the diagnosis holds.

Two disjoint lists: TUNE may be looked at while a diagnosis is made, REPORT only when it is judged.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tests.hidden_world.catalogue.drawing import (
    LAG_SUBSTEPS,
    RESET_SUBSTEPS,
    between,
    event_arrays,
    log_uniform,
    shape,
    whole,
)
from tests.hidden_world.catalogue.readout import chosen
from tests.hidden_world.integrator import Physics
from tests.hidden_world.light import Light
from tests.hidden_world.mechanism import Bits, Mechanism, Parameters, Rng
from tests.hidden_world.unit import FRAME_S, Camera
from tests.hidden_world.waves import Flashes, Switched

# ---- to tune on


def _ping_pong(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.laws = ph.laws._replace(alternate=p["step"])


def _two_component_lag(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    fast = p["fraction"] * p["fast_share"]
    ph.lags = ((fast, p["fast_frames"]), (p["fraction"] - fast, p["slow_frames"]))
    ph.substeps = max(ph.substeps, LAG_SUBSTEPS)


def _column_clock(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    phases = np.random.default_rng(int(p["phases"])).random(camera.shape[1])
    turns = np.arange(frames)[:, None] / p["period_frames"] + phases[None, :] + rng.random()
    ph.column_mv = (np.sqrt(2.0) * p["sigma_mV"] * np.sin(2.0 * np.pi * turns)).astype(np.float32)


def _bursts(bits: Bits, p: Parameters, rng: Rng) -> Bits:
    at = chosen(bits, p["probability"], rng)
    for k in range(1, int(p["length"]) + 1):
        again = at + k * bits[0].size
        bits.reshape(-1)[again[again < bits.size]] = 1
    return bits


def _amp_glow(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    rows, columns = camera.shape
    away = np.hypot(*np.mgrid[:rows, :columns])[:: rng.choice([-1, 1]), :: rng.choice([-1, 1])]
    return replace(camera, dark=camera.dark + camera.charge_of(p["corner_pA"]) * np.exp(-away / p["reach_pixels"]))


def _shutter(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    """Shut for `closed` of the time, once a period, at any moments."""
    period = p["period_frames"]
    ph.light_waves += (Switched(period, p["closed"] * period, rng.uniform(0.0, period), 0.0, 1.0),)


def _even_rows(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    every = int(p["every_frames"])
    sign = np.where(np.arange(camera.shape[0]) % 2 == 0, 1.0, -1.0)[:, None] * np.ones((1, camera.shape[1]))
    turns = np.where(np.arange(frames // every + 1) % 2 == 0, 1.0, -1.0)
    movie = 1.0 + p["step"] * turns[:, None] * sign.reshape(-1)[None, :]
    ph.gain_movie, ph.gain_every = movie.astype(np.float32), every


def _array_sag(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.array_sag, ph.sag_tau = p["sag"], p["tau_frames"]


def _recovery_ramp(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.laws = ph.laws._replace(ramp_loss=p["loss"], ramp_tau=p["tau_frames"])
    ph.substeps = max(ph.substeps, RESET_SUBSTEPS)


def _flashes(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    at = rng.uniform(0, frames, rng.poisson(p["per_second"] * frames * FRAME_S))
    ph.light_leak = Flashes(at, p["radiance"], p["tau_frames"])


# ---- to report on


def _persistence(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.trap_charge, ph.trap_half, ph.trap_tau = p["charge"], p["half_radiance"], p["tau_ms"] * 1e-3 / FRAME_S


def _alternate_frames(bits: Bits, p: Parameters, rng: Rng) -> Bits:
    """Spikes of an odd frame appear in the next, in some pixels (the same ones in every recording)."""
    moved = np.random.default_rng(int(p["which"])).random(bits[0].shape) < p["pixels"]
    return _delayed(bits, moved, period=2, slot=1)


def _missing_slot(bits: Bits, p: Parameters, rng: Rng) -> Bits:
    """Spikes of one frame of sixteen appear in the next, in some columns."""
    columns = np.random.default_rng(int(p["which"])).random((1, bits.shape[2])) < p["pixels"]
    return _delayed(bits, np.broadcast_to(columns, bits[0].shape), period=16, slot=5)


def _delayed(bits: Bits, moved: NDArray[np.bool_], period: int, slot: int) -> Bits:
    late = bits[slot::period] & moved
    into = bits[slot + 1 :: period]
    into |= late[: len(into)]
    bits[slot::period] &= ~moved
    return bits


def _hot_band(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    every, (rows, columns) = 40, camera.shape
    middle = (np.arange(frames // every + 1) * every / frames * p["travel"] + rng.random()) * columns
    away = (np.arange(columns)[None, :] - middle[:, None] + columns / 2) % columns - columns / 2
    band = 1.0 + p["rise"] * np.exp(-0.5 * (away / p["width_pixels"]) ** 2)
    movie = np.repeat(band[:, None, :], rows, axis=1).reshape(len(band), -1)
    ph.dark_movie, ph.dark_every = movie.astype(np.float32), every


def _streaks(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    rows, columns = camera.shape
    hits: list[tuple[float, int, float]] = []
    for _ in range(rng.poisson(p["per_second"] * frames * FRAME_S)):
        frame, angle, length = int(rng.integers(frames)), rng.uniform(0, np.pi), rng.uniform(8, 30)
        along = np.arange(0.0, length, 0.5) - length / 2
        r = np.rint(rng.uniform(0, rows) + along * np.sin(angle)).astype(int)
        c = np.rint(rng.uniform(0, columns) + along * np.cos(angle)).astype(int)
        inside = (r >= 0) & (r < rows) & (c >= 0) & (c < columns)
        pixels = np.unique(r[inside] * columns + c[inside])
        hits += [(frame, pixel, p["charge"] * rng.exponential()) for pixel in pixels]
    ph.hits = event_arrays(hits)


def _ghost(light: Light, size: tuple[int, int], p: Parameters) -> Light:
    return Light(light.key_frame, (light.radiance + p["share"] * light.radiance[:, ::-1, ::-1]).astype(np.float32))


def _saturation_memory(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.glare_loss, ph.glare_tau = p["loss"], p["tau_frames"]


def _distant_row_leak(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.laws = ph.laws._replace(kick=p["kick"])
    ph.kick_to, ph.kick_wraps = ((int(p["rows_away"]), 0),), True


def _heavy_tailed_reset(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.laws = ph.laws._replace(outlier_share=p["share"], outlier_kappa=p["kappa"])


def _row_bus(bits: Bits, p: Parameters, rng: Rng) -> Bits:
    _wait_for_bus(bits, int((1.0 - p["blocked"]) * 0.75 * bits.shape[2]))
    return bits


@njit(cache=True)
def _wait_for_bus(bits, most):
    """At most `most` spikes of a row go out in a frame, from the left; the others wait, one at most in each pixel."""
    frames, rows, columns = bits.shape
    waiting = np.zeros(columns, np.uint8)
    for r in range(rows):
        waiting[:] = 0
        for n in range(frames):
            sent = 0
            for c in range(columns):
                wants = bits[n, r, c] | waiting[c]
                waiting[c] = 0
                if wants and sent < most:
                    bits[n, r, c] = 1
                    sent += 1
                elif wants:
                    bits[n, r, c] = 0
                    waiting[c] = 1


def _speckle(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    every, pixels = 8, camera.gain.size
    kept = np.exp(-every / p["tau_frames"])
    movie = np.empty((frames // every + 1, pixels), np.float32)
    movie[0] = rng.standard_normal(pixels)
    for i in range(1, len(movie)):
        movie[i] = kept * movie[i - 1] + np.sqrt(1.0 - kept * kept) * rng.standard_normal(pixels, np.float32)
    ph.gain_movie, ph.gain_every = np.maximum(1.0 + np.float32(p["contrast"]) * movie, 0.0), every


def _fringes(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    y, x = np.mgrid[: camera.shape[0], : camera.shape[1]]
    along = x * np.cos(p["angle"]) + y * np.sin(p["angle"])
    wave = np.sin(2.0 * np.pi * (along / p["period_pixels"] + rng.random()))
    return replace(camera, gain=camera.gain * (1.0 + p["contrast"] * wave))


def _repeated_frames(bits: Bits, p: Parameters, rng: Rng) -> Bits:
    for n in np.flatnonzero(rng.random(len(bits)) < p["probability"]):
        if n:
            bits[n] = bits[n - 1]
    return bits


TUNE = {
    m.name: m
    for m in (
        Mechanism("ping_pong_threshold", "every second threshold of a pixel is higher", physics=_ping_pong),
        Mechanism(
            "two_component_lag",
            "a fast and a slow part of the light come late",
            shape(
                fast_share=between(0.4, 0.6), fast_frames=log_uniform(3.0, 8.0), slow_frames=log_uniform(80.0, 250.0)
            ),
            physics=_two_component_lag,
        ),
        Mechanism(
            "column_clock_modulation",
            "the reference of each column swings with a clock, each with a phase of its own",
            shape(period_frames=between(5.0, 12.0), phases=whole(0, 2**31)),
            physics=_column_clock,
        ),
        Mechanism(
            "spike_bursts",
            "a spike is now and then followed by several, frame by frame",
            shape(length=whole(3, 5)),
            bits=_bursts,
        ),
        Mechanism(
            "amp_glow",
            "dark current that falls off from a corner",
            shape(reach_pixels=between(6.0, 14.0)),
            camera=_amp_glow,
        ),
        Mechanism(
            "duty_cycled_shutter",
            "light shut off for a moment every period",
            shape(period_frames=between(20.0, 60.0)),
            physics=_shutter,
        ),
        Mechanism(
            "even_row_gain_switching",
            "even and odd rows change gain in turns",
            shape(every_frames=whole(100, 400)),
            physics=_even_rows,
        ),
        Mechanism(
            "array_sag",
            "all thresholds follow the activity of the whole array, slowly",
            shape(tau_frames=log_uniform(30.0, 150.0)),
            physics=_array_sag,
        ),
        Mechanism(
            "recovery_ramp",
            "sensitivity comes back gradually after a reset",
            shape(tau_frames=between(2.0, 6.0)),
            physics=_recovery_ramp,
        ),
        Mechanism(
            "light_leak_flashes",
            "flashes of stray light at random times",
            shape(per_second=between(60.0, 150.0), tau_frames=between(8.0, 40.0)),
            physics=_flashes,
        ),
    )
}

REPORT = {
    m.name: m
    for m in (
        Mechanism(
            "persistence",
            "traps fill in the light, saturate, and leak over 100 ms; empty when a recording starts",
            shape(tau_ms=log_uniform(40.0, 150.0), half_radiance=between(0.03, 0.1)),
            physics=_persistence,
        ),
        Mechanism(
            "alternate_frame_comparator",
            "in some pixels the comparator looks only every second frame",
            shape(which=whole(0, 2**31)),
            bits=_alternate_frames,
        ),
        Mechanism(
            "moving_hot_band",
            "a warm band moves across the chip and raises its dark current",
            shape(travel=between(0.5, 1.0), width_pixels=between(5.0, 9.0)),
            physics=_hot_band,
        ),
        Mechanism(
            "cosmic_streaks",
            "charge along straight tracks in single frames",
            shape(charge=between(0.3, 0.7)),
            physics=_streaks,
        ),
        Mechanism("ghost_image", "a faint image turned by 180 degrees", light=_ghost),
        Mechanism(
            "saturation_memory",
            "less sensitive for a while after more than one threshold a frame",
            shape(tau_frames=between(15.0, 60.0)),
            physics=_saturation_memory,
        ),
        Mechanism(
            "distant_row_leak",
            "a spike gives charge to a pixel far away in its column",
            shape(rows_away=whole(8, 31)),
            physics=_distant_row_leak,
        ),
        Mechanism(
            "heavy_tailed_reset",
            "a reset now and then misses widely",
            shape(kappa=between(0.06, 0.12)),
            physics=_heavy_tailed_reset,
        ),
        Mechanism("row_bus_limit", "a row's bus carries so many spikes a frame, the others wait", bits=_row_bus),
        Mechanism(
            "speckle",
            "the light on each pixel fluctuates by itself",
            shape(tau_frames=log_uniform(30.0, 200.0)),
            physics=_speckle,
        ),
        Mechanism(
            "fringes",
            "oblique stripes of sensitivity",
            shape(period_pixels=between(6.0, 14.0), angle=between(0.4, 1.1)),
            camera=_fringes,
        ),
        Mechanism("repeated_frames", "now and then the frame before is read again", bits=_repeated_frames),
        Mechanism(
            "missing_slot",
            "in some columns one frame of sixteen reports nothing, the spike comes a frame later",
            shape(which=whole(0, 2**31)),
            bits=_missing_slot,
        ),
    )
}

OUTSIDE = {**TUNE, **REPORT}
