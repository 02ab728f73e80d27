"""The effects that a diagnosis knows by name, each written anew from its stated law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from tests.hidden_world.integrator import Physics
from tests.hidden_world.light import Light
from tests.hidden_world.mechanism import Bits, Mechanism, Parameters, Rng
from tests.hidden_world.unit import FRAME_S, SWING_V, Camera
from tests.hidden_world.waves import Clock, Polygon, Rise, Sine

Array = NDArray[np.float64]
RESET_SUBSTEPS = 4
"""Pieces of a frame where it matters when in a frame a pixel was reset."""
LAG_SUBSTEPS = 4
"""Pieces of a frame in which light that changes is filtered as if it were constant."""


def frames_of(us: float) -> float:
    """Microseconds in frames."""
    return us * 1e-6 / FRAME_S


def event_arrays(events: list[tuple[float, int, float]]) -> tuple[Array, NDArray[np.int64], Array]:
    """Time, pixel and size of events, in the order of time."""
    ordered = sorted(events, key=lambda event: event[0])
    time, pixel, size = zip(*ordered, strict=True) if ordered else ((), (), ())
    return np.array(time, np.float64), np.array(pixel, np.int64), np.array(size, np.float64)


def some_pixels(camera: Camera, fraction: float, rng: Rng) -> NDArray[np.int64]:
    """Flat indices of that share of the pixels, at least one."""
    count = camera.gain.size
    return rng.choice(count, max(1, round(fraction * count)), replace=False)


# ---- optics


def _lamp_drift(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    """Known at whole frames, straight between them."""
    walk = np.cumsum(rng.standard_normal(frames + 1)) * p["sigma_per_root_s"] * np.sqrt(FRAME_S)
    ph.light_waves += (Polygon(np.arange(frames + 1.0), np.maximum(1.0 + walk, 0.0)),)


def _light_flicker(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.light_waves += (Sine(p["modulation"], p["frequency_hz"] * FRAME_S, rng.random()),)


def _optical_blur(light: Light, shape: tuple[int, int], p: Parameters) -> Light:
    if light.radiance.shape[1:] == (1, 1):
        return light
    steps = max(8, int(np.ceil(10.0 * p["sigma_pixels"] ** 2)))
    share = p["sigma_pixels"] ** 2 / 2.0 / steps  # light diffuses to the pixels beside: variance 2 share a step
    blurred = light.radiance
    for _ in range(steps):
        for axis in (1, 2):
            blurred = convolve1d(blurred, np.array([share, 1.0 - 2.0 * share, share]), axis=axis, mode="nearest")
    return Light(light.key_frame, blurred)


def _vignetting(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    rows, columns = camera.shape
    y, x = (np.arange(rows) - (rows - 1) / 2)[:, None], (np.arange(columns) - (columns - 1) / 2)[None, :]
    square = (x * x + y * y) / ((rows - 1) ** 2 / 4 + (columns - 1) ** 2 / 4)
    return replace(camera, gain=camera.gain * (1.0 - p["falloff"] * square))


# ---- photodiode


def _blooming(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.bloom_share, ph.bloom_full = p["share"], p["full"]


def _dark_current_drift(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.dark_waves += (Rise(p["rise"], p["tau_ms"] * 1e-3 / FRAME_S),)


def _dark_current_tail(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    return replace(camera, dark=camera.dark * np.exp(p["sigma"] * rng.standard_normal(camera.shape)))


def _hot_pixels(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    dark, at = camera.dark.copy(), some_pixels(camera, p["fraction"], rng)
    dark.flat[at] += rng.exponential(p["mean_pA"], at.size) * camera.charge_of(1.0).flat[at]
    return replace(camera, dark=dark)


def _nonlinearity(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.nonlinearity = p["beta"]


def _lag(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.lags, ph.substeps = ((p["fraction"], frames_of(p["tau_us"])),), max(ph.substeps, LAG_SUBSTEPS)


def _telegraph(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    """Each trap leaves its state after exponential times, at any moment; which pixels have one is in the key."""
    at = some_pixels(camera, p["fraction"], np.random.default_rng(int(p["traps"])))
    dwell = p["dwell_ms"] * 1e-3 / FRAME_S
    events: list[tuple[float, int, float]] = []
    for pixel in at:
        charge = p["amplitude_pA"] * camera.charge_of(1.0).flat[pixel]
        up, time = rng.random() < 0.5, 0.0
        if up:
            events.append((-1.0, pixel, charge))  # since before the first window, of whatever row
        while (time := time + rng.exponential(dwell)) < frames:
            up = not up
            events.append((time, pixel, charge if up else -charge))
    ph.dark_steps = event_arrays(events)


# ---- threshold


def _row_or_column_pattern(axis: int) -> Callable[[Camera, Parameters, Rng], Camera]:
    def imprint(camera: Camera, p: Parameters, rng: Rng) -> Camera:
        size = [1, 1]
        size[axis] = camera.shape[axis]
        return swung(camera, 1.0 + p["sigma_mV"] * rng.standard_normal(size) * camera.per_mv)

    return imprint


def swung(camera: Camera, factor: Array) -> Camera:
    """The camera with its reset-to-reference voltages times `factor`."""
    return replace(
        camera,
        gain=camera.gain / factor,
        dark=camera.dark / factor,
        quiet=camera.quiet / factor,
        kappa=camera.kappa / factor,
        per_mv=camera.per_mv / factor,
        phi_fc=camera.phi_fc * factor,
    )


def _supply_ripple(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.threshold_waves += (Sine(p["ripple"], p["frequency_hz"] * FRAME_S, rng.random()),)


def _clock_feedthrough(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    """Just after its edge the reference is off by amplitude_mV, below 0 where it falls."""
    ph.clock = Clock(-p["amplitude_mV"], p["phase_frames"], frames_of(p["tau_us"]))


def _add_rows(ph: Physics, millivolt: Array) -> None:
    ph.row_mv = (millivolt if ph.row_mv is None else ph.row_mv + millivolt).astype(np.float32)


def _common_threshold_noise(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    _add_rows(ph, p["sigma_mV"] * rng.standard_normal((frames, 1)) * np.ones((1, camera.shape[0])))


def _row_temporal_noise(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    _add_rows(ph, p["sigma_mV"] * rng.standard_normal((frames, camera.shape[0])))


def _threshold_flicker(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    """S(f) = (sigma^2 / ln 2) / f from six Lorentzians two octaves apart, each with the variance of two octaves."""
    ph.slow_tau = np.array([3.0 * 4.0**j for j in range(6)])
    ph.slow_mv = np.full(6, np.sqrt(2.0) * p["sigma_mV"])


def _excess_threshold_noise(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    return replace(camera, kappa=np.hypot(camera.kappa, p["sigma_mV"] * camera.per_mv))


def _frame_threshold_noise(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.frame_noise_mv = p["sigma_mV"]


def _ir_drop(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.row_droop = p["droop"]


# ---- reset


def _dead_time(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.dead, ph.substeps = frames_of(p["tau_us"]), max(ph.substeps, RESET_SUBSTEPS)


def _comparator_delay(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.delay, ph.substeps = frames_of(p["delay_us"]), max(ph.substeps, RESET_SUBSTEPS)


def _synchronous_reset(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.hold_loss, ph.substeps = p["fraction"], max(ph.substeps, RESET_SUBSTEPS)


def _incomplete_reset(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.left_fraction, ph.left_tau = p["fraction"], frames_of(p["tau_us"])
    ph.substeps = max(ph.substeps, RESET_SUBSTEPS)


def _crosstalk(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    """Capacitive: at the spike (`at_spike` 1); or as if the neighbours took notice at the frame's end."""
    ph.kick, ph.kick_to = p["kick"], ((-1, 0), (1, 0), (0, -1), (0, 1))
    ph.kick_at_spike = bool(p.get("at_spike", 1.0))


# ---- read-out


def _clock_jitter(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.edge = frames_of(1e-3 * p["sigma_ns"]) * rng.standard_normal(frames + 1)


def _dead_pixels(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    gain, dark, at = camera.gain.copy(), camera.dark.copy(), some_pixels(camera, p["fraction"], rng)
    gain.flat[at], dark.flat[at] = 0.0, 0.0
    return replace(camera, gain=gain, dark=dark)


def _readout_skew(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    """From the first row to the last, which is read at the frame's end; upwards where span is negative."""
    early = abs(p["span"]) * (1.0 - np.arange(camera.shape[0]) / (camera.shape[0] - 1))
    ph.skew = early if p["span"] >= 0.0 else early[::-1].copy()


def _missed_spikes(bits: Bits, p: Parameters, rng: Rng) -> Bits:
    at = chosen(bits, p["probability"], rng)
    bits.reshape(-1)[at] = 0
    return bits


def _spurious_spikes(bits: Bits, p: Parameters, rng: Rng) -> Bits:
    at = rng.integers(0, bits.size, rng.poisson(p["probability"] * bits.size))
    bits.reshape(-1)[at] = 1
    return bits


def _afterpulsing(bits: Bits, p: Parameters, rng: Rng) -> Bits:
    pixels = bits[0].size
    again = chosen(bits, p["probability"], rng) + int(p["delay_frames"]) * pixels
    bits.reshape(-1)[again[again < bits.size]] = 1
    return bits


def chosen(bits: Bits, probability: float, rng: Rng) -> NDArray[np.int64]:
    """Flat indices of spikes, each picked with that probability."""
    flat = bits.reshape(-1)
    total = int(np.count_nonzero(flat))
    which = np.unique(rng.integers(0, total, rng.poisson(probability * total))) if total else np.zeros(0, np.int64)
    return _places(flat, which)


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


# ---- the base model's own


def _shot_noise(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    phi0 = camera.phi_fc.mean()
    return replace(camera, quiet=phi0 / camera.phi_fc / p["quanta"])


def _conversion_gain_spread(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    return replace(camera, gain=camera.gain * np.maximum(1.0 + p["sigma"] * rng.standard_normal(camera.shape), 0.0))


def _dark_current(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    return replace(camera, dark=camera.dark + camera.charge_of(p["mean_pA"]))


def _dark_current_spread(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    extra = rng.standard_normal(camera.shape) * camera.charge_of(p["sigma_pA"])
    return replace(camera, dark=np.maximum(camera.dark + extra, 0.0))


def _capacitor_spread(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    capacitance = camera.phi_fc / SWING_V
    changed = swung(camera, 1.0 + p["sigma_fF"] / capacitance * rng.standard_normal(camera.shape))
    return replace(changed, kappa=camera.kappa, per_mv=camera.per_mv)


def _bias_voltage_spread(camera: Camera, p: Parameters, rng: Rng) -> Camera:
    return swung(camera, 1.0 + 1e3 * p["sigma_V"] * camera.per_mv * rng.standard_normal(camera.shape))


def _log_uniform(low: float, high: float) -> Callable[[Rng], float]:
    return lambda rng: float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _shape(**laws: Callable[[Rng], float]) -> Callable[[Rng], Parameters]:
    return lambda rng: {name: law(rng) for name, law in laws.items()}


def _whole(low: int, high: int) -> Callable[[Rng], float]:
    return lambda rng: float(rng.integers(low, high + 1))


def _mostly(rng: Rng) -> float:
    """1 in three cases of four, else 0."""
    return float(rng.random() < 0.75)


def _lines(low: float, high: float) -> Callable[[Rng], float]:
    """Hertz: in one case of four up to 18 kHz, near half the frame rate, as a switched supply or a dimmed lamp has."""
    return lambda rng: _log_uniform(low, high)(rng) if rng.random() < 0.75 else _log_uniform(high, 18e3)(rng)


def _between(low: float, high: float) -> Callable[[Rng], float]:
    return lambda rng: float(rng.uniform(low, high))


CATALOGUE = {
    m.name: m
    for m in (
        Mechanism("dead_time", "T = 1/x + tau", physics=_dead_time),
        Mechanism("comparator_delay", "T = 1/x + c / sqrt(x)", physics=_comparator_delay),
        Mechanism("synchronous_reset", "charge between crossing and read-out lost", physics=_synchronous_reset),
        Mechanism(
            "incomplete_reset",
            "charge f (1 - exp(-T/tau)) left by a reset",
            _shape(tau_us=_log_uniform(100.0, 1000.0)),
            physics=_incomplete_reset,
        ),
        Mechanism(
            "photodiode_lag",
            "x <- (1 - f) x + f h_tau * x",
            _shape(tau_us=_log_uniform(150.0, 3000.0)),
            physics=_lag,
        ),
        Mechanism("photo_response_nonlinearity", "x <- x (1 - beta x)", physics=_nonlinearity),
        Mechanism(
            "light_flicker",
            "L (1 + m sin), the phase new in every recording",
            _shape(frequency_hz=_lines(100.0, 2000.0)),
            physics=_light_flicker,
        ),
        Mechanism("lamp_drift", "L (1 + w), w a random walk", physics=_lamp_drift),
        Mechanism(
            "supply_ripple",
            "phi (1 + rho sin), the phase new in every recording",
            _shape(frequency_hz=_lines(100.0, 3000.0)),
            physics=_supply_ripple,
        ),
        Mechanism(
            "clock_feedthrough",
            "the reference of all falls at one moment of the array's clock, and recovers",
            _shape(phase_frames=_between(0.0, 1.0), tau_us=_between(2.5, 10.0)),
            signs=(-1.0,),
            physics=_clock_feedthrough,
        ),
        Mechanism("common_threshold_noise", "one draw a frame for all", physics=_common_threshold_noise),
        Mechanism("clock_jitter", "each read-out early or late by itself", physics=_clock_jitter),
        Mechanism("row_temporal_noise", "one draw a frame and row", physics=_row_temporal_noise),
        Mechanism("threshold_flicker_noise", "1/f, each pixel its own", physics=_threshold_flicker),
        Mechanism(
            "random_telegraph_noise",
            "two-state dark current in some pixels",
            _shape(fraction=_between(0.01, 0.04), dwell_ms=_log_uniform(4.0, 25.0), traps=_whole(0, 2**31)),
            physics=_telegraph,
        ),
        Mechanism(
            "dark_current_drift",
            "I (1 + a (1 - exp(-t/tau)))",
            _shape(tau_ms=_log_uniform(20.0, 120.0)),
            physics=_dark_current_drift,
        ),
        Mechanism(
            "hot_pixels",
            "exponential extra current in a few pixels",
            _shape(mean_pA=_between(2.0, 5.0)),
            camera=_hot_pixels,
        ),
        Mechanism("dark_current_tail", "I exp(sigma n)", camera=_dark_current_tail),
        Mechanism("dead_pixels", "a few pixels never fire", camera=_dead_pixels),
        Mechanism("row_fixed_pattern", "V_d of a row", camera=_row_or_column_pattern(0)),
        Mechanism("column_fixed_pattern", "V_d of a column", camera=_row_or_column_pattern(1)),
        Mechanism("vignetting", "alpha (1 - v r^2/r_corner^2)", camera=_vignetting),
        Mechanism("optical_blur", "light diffuses: heat equation of variance s^2", light=_optical_blur),
        Mechanism(
            "crosstalk",
            "a spike kicks its four neighbours, at once; in a quarter of the cases at the end of the frame",
            _shape(at_spike=_mostly),
            physics=_crosstalk,
        ),
        Mechanism(
            "blooming",
            "share of what is beyond `full` goes to four neighbours",
            _shape(full=_between(0.7, 1.0)),
            physics=_blooming,
        ),
        Mechanism("ir_drop", "phi (1 + d a), a: share of the row that fired in the frame before", physics=_ir_drop),
        Mechanism(
            "readout_skew",
            "row r is read |s| (1 - r/(H-1)) early, or from the last row on",
            signs=(-1.0, 1.0),
            physics=_readout_skew,
        ),
        Mechanism("missed_spikes", "a spike is not reported", bits=_missed_spikes),
        Mechanism("spurious_spikes", "a report without a spike", bits=_spurious_spikes),
        Mechanism(
            "afterpulsing",
            "a spike is reported again some frames later",
            _shape(delay_frames=_whole(1, 6)),
            bits=_afterpulsing,
        ),
        Mechanism("excess_threshold_noise", "a wider draw at each reset", camera=_excess_threshold_noise),
        Mechanism("frame_threshold_noise", "a draw a pixel and frame", physics=_frame_threshold_noise),
    )
}

BASE_EFFECTS = {
    m.name: m
    for m in (
        Mechanism("shot_noise", "Poisson electrons", camera=_shot_noise),
        Mechanism("reset_noise", "a threshold drawn at each reset", camera=_excess_threshold_noise),
        Mechanism("conversion_gain_spread", "alpha (1 + sigma n)", camera=_conversion_gain_spread),
        Mechanism("dark_current", "I the same in all pixels", camera=_dark_current),
        Mechanism("dark_current_spread", "I + sigma n", camera=_dark_current_spread),
        Mechanism("capacitor_spread", "C + sigma n", camera=_capacitor_spread),
        Mechanism("bias_voltage_spread", "V_d + sigma n", camera=_bias_voltage_spread),
    )
}
