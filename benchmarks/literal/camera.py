"""From a sensor model's parameters to a literal camera: one function an effect, found by its name.

Only values are read from the model; their laws are written here anew, from the effects' laws and the circuit:

    threshold = (C + C_S)(V_d + V_S)        [electrons: N of the nominal one, in proportion]
    dark electrons of a frame = N I / (C V_d frame rate)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.literal.electrons import Film, Law, Pixels, expose, expose_coupled
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats, Spikes

PARTS = 16
"""Parts of a frame in which a threshold that wanders within frames is held."""

DENSE = 64
"""Keys a frame for light that wanders."""


@dataclass
class Camera:
    """One camera before it is exposed.

    Effects also set `early` (H,), the time from a row's read-out to the frame's end, and `jitter` (F + 1,), the delay
    of each read-out [frames].  `offset_mV` (F * k, H or 1, W or 1) is added to the thresholds.
    """

    model: SensorModel
    frames: int
    shape: tuple[int, int]
    keys: Floats
    """(K,) times of light [frames]."""
    levels: Floats
    """(K,) light at the keys [thresholds a frame]."""
    picture: Floats
    """(H, W) light of each pixel over `levels`."""
    rng: np.random.Generator
    law: dict[str, float] = field(default_factory=dict)
    """The values of `Law` that are not 0."""
    trap_pA: float = 0.0
    noise_V: float = 0.0
    edge_V: float = 0.0
    kick: float = 0.0
    late_kick: bool = False
    share: float = 0.0
    full: float = 0.0
    reports: list[Callable[[Spikes], Spikes]] = field(default_factory=list)
    """Changes of the bits, in order."""

    def __post_init__(self) -> None:
        circuit = self.model.circuit
        self.gain = self.picture.copy()
        self.dark_pA = np.zeros(self.shape)
        self.swing_V = np.full(self.shape, circuit.reset_V - circuit.reference_V + circuit.bias_V)
        self.nominal_V = float(self.swing_V[0, 0])
        self.capacitance_fF = np.full(self.shape, circuit.capacitance_fF)
        self.trapped = np.zeros(self.shape, np.bool_)
        self.early = np.zeros(self.shape[0])
        self.jitter = np.zeros(self.frames + 1)
        self.offset_mV = np.zeros((self.frames, 1, 1))
        for effect in self.model.effects:
            if effect.name not in LAWS:
                raise KeyError(f"{effect.name}: benchmarks/literal/camera.py has no law of its own for it")
            LAWS[effect.name](effect, self)

    @property
    def frames_per_s(self) -> float:
        return self.model.frame_rate_hz

    def normal(self, *shape: int) -> Floats:
        return self.rng.standard_normal(shape)

    def add_offset_mV(self, offset: Floats) -> None:
        """Another part of the thresholds' movement, (F * k, H or 1, W or 1)."""
        parts = max(len(offset), len(self.offset_mV))
        both = [np.repeat(a, parts // len(a), axis=0) for a in (self.offset_mV, offset)]
        self.offset_mV = both[0] + both[1]

    def exposed(self) -> Spikes:
        """Spikes (F, H, W) uint8."""
        electrons = self.law.get("electrons", 1000.0)
        per_pA = electrons / (self.model.circuit.capacitance_fF * self.nominal_V * self.frames_per_s * 1e-3)
        law = Law(**{**self.law, "trap": self.trap_pA * per_pA, "edge": electrons * self.edge_V / self.nominal_V})
        area = self.capacitance_fF * self.swing_V / (self.model.circuit.capacitance_fF * self.nominal_V)
        dark = self.dark_pA * per_pA
        pixels = Pixels(self.gain, dark, electrons * area, self.noise_V / self.swing_V, self.trapped)
        spikes = np.zeros((self.frames, *self.shape), np.uint8)
        film = Film(self.keys, self.levels, _most(self.keys, self.levels, self.frames))
        if self.kick or self.share:
            expose_coupled(law, pixels, film, self.kick, self.late_kick, self.share, self.full, self.rng, spikes)
        else:
            edges = (np.arange(self.frames + 1.0) + self.jitter)[:, None] - self.early
            volts_to_electrons = electrons * area / self.swing_V
            uneven = np.ptp(volts_to_electrons) > 0 and np.any(self.offset_mV)
            scale = volts_to_electrons if uneven else volts_to_electrons[:1, :1]
            expose(law, pixels, film, edges, 1e-3 * self.offset_mV * scale, self.rng, spikes)
        for reported in self.reports:
            spikes = reported(spikes)
        return spikes


def _most(keys: Floats, levels: Floats, frames: int) -> Floats:
    """(F,) light that no moment of each frame, with a frame to either side, exceeds: the highest key or end."""
    at = np.arange(frames)[:, None] + np.array([-1.0, 2.0])
    ends = np.interp(at, keys, levels).max(axis=1)
    first, last = np.searchsorted(keys, at[:, 0]), np.searchsorted(keys, at[:, 1], side="right")
    return np.array([max(end, levels[a:b].max(initial=0.0)) for end, a, b in zip(ends, first, last, strict=True)])


LAWS: dict[str, Callable[[Any, Camera], None]] = {}


def law(function: Callable[[Any, Camera], None]) -> Callable[[Any, Camera], None]:
    """Register the law of the effect that the function is named after."""
    LAWS[function.__name__] = function
    return function


# --- optics


@law
def lamp_drift(effect: Any, camera: Camera) -> None:
    """L(t) max(1 + w(t), 0), w a random walk of variance sigma^2 t, drawn DENSE times a frame, before it the lamp is
    steady."""
    at = np.arange(camera.frames * DENSE + 1) / DENSE
    step = effect.sigma_per_root_s / np.sqrt(DENSE * camera.frames_per_s)
    walk = np.concatenate([[0.0], np.cumsum(step * camera.normal(at.size - 1))])
    light = np.interp(at, camera.keys, camera.levels)
    camera.keys, camera.levels = at, light * np.maximum(1.0 + walk, 0.0)


@law
def light_flicker(effect: Any, camera: Camera) -> None:
    """L(t) (1 + m sin 2 pi (f t + p))."""
    camera.law |= {
        "flicker": effect.modulation,
        "flicker_frequency": effect.frequency_hz / camera.frames_per_s,
        "flicker_phase": effect.phase_cycles,
    }


@law
def optical_blur(effect: Any, camera: Camera) -> None:
    """Each pixel sees the mean of all others by exp(-n^2 / 2 v) along rows and columns, v such that the variance is
    s^2; the picture goes on beyond its edge as it ends."""
    n = np.arange(-60, 61)
    low, high = 1e-3, effect.sigma_pixels**2 + 1.0
    for _ in range(60):
        v = 0.5 * (low + high)
        weights = np.exp(-(n**2) / (2.0 * v))
        weights /= weights.sum()
        low, high = (v, high) if weights @ n**2 < effect.sigma_pixels**2 else (low, v)
    for axis in (0, 1):
        size = camera.gain.shape[axis]
        seen = np.clip(np.arange(size)[:, None] + n, 0, size - 1)
        camera.gain = np.moveaxis(np.moveaxis(camera.gain, axis, -1)[..., seen] @ weights, -1, axis)


@law
def vignetting(effect: Any, camera: Camera) -> None:
    """alpha (1 - v r^2 / r_corner^2)."""
    rows, columns = camera.shape
    r, c = np.indices(camera.shape)
    square = (r - effect.centre_y * (rows - 1)) ** 2 + (c - effect.centre_x * (columns - 1)) ** 2
    camera.gain = camera.gain * (1.0 - effect.falloff * square / square.max())


# --- photodiode


@law
def blooming(effect: Any, camera: Camera) -> None:
    """Of the electrons above `full` thresholds a frame, a share goes to the four neighbours."""
    camera.share, camera.full = effect.share, effect.full


@law
def conversion_gain_spread(effect: Any, camera: Camera) -> None:
    """alpha (1 + sigma n)."""
    camera.gain = camera.gain * np.maximum(1.0 + effect.sigma * camera.normal(*camera.shape), 0.0)


@law
def dark_current(effect: Any, camera: Camera) -> None:
    """I_dark, of every pixel."""
    camera.dark_pA = camera.dark_pA + effect.mean_pA


@law
def dark_current_spread(effect: Any, camera: Camera) -> None:
    """I_dark + sigma n, at least none."""
    camera.dark_pA = np.maximum(camera.dark_pA + effect.sigma_pA * camera.normal(*camera.shape), 0.0)


@law
def dark_current_tail(effect: Any, camera: Camera) -> None:
    """I_dark exp(sigma n)."""
    camera.dark_pA = camera.dark_pA * np.exp(effect.sigma * camera.normal(*camera.shape))


@law
def dark_current_drift(effect: Any, camera: Camera) -> None:
    """I_dark (1 + a (1 - exp(-t/tau)))."""
    camera.law |= {"drift": effect.rise, "drift_tau": effect.tau_ms * 1e-3 * camera.frames_per_s}


@law
def hot_pixels(effect: Any, camera: Camera) -> None:
    """A fraction of the pixels leaks besides, by an exponential amount."""
    hot = camera.rng.random(camera.shape) < effect.fraction
    camera.dark_pA = camera.dark_pA + hot * camera.rng.exponential(effect.mean_pA, camera.shape)


@law
def photo_response_nonlinearity(effect: Any, camera: Camera) -> None:
    """x (1 - beta x) of the instantaneous light."""
    camera.law["beta"] = effect.beta


@law
def photodiode_lag(effect: Any, camera: Camera) -> None:
    """An electron is late with probability f, by an exponential time of mean tau."""
    camera.law |= {"lag": effect.fraction, "lag_tau": effect.tau_us * 1e-6 * camera.frames_per_s}


@law
def random_telegraph_noise(effect: Any, camera: Camera) -> None:
    """A trap in a fraction of the pixels adds a current in one of its two states, which last exponential times."""
    camera.trapped = camera.rng.random(camera.shape) < effect.fraction
    camera.trap_pA = effect.amplitude_pA
    camera.law["dwell"] = effect.dwell_ms * 1e-3 * camera.frames_per_s


# --- integration


@law
def shot_noise(effect: Any, camera: Camera) -> None:
    """`quanta` electrons to a nominal threshold, one at a time."""
    camera.law["electrons"] = effect.quanta


@law
def capacitor_spread(effect: Any, camera: Camera) -> None:
    """C + sigma n."""
    camera.capacitance_fF = camera.capacitance_fF + effect.sigma_fF * camera.normal(*camera.shape)


# --- threshold


@law
def bias_voltage_spread(effect: Any, camera: Camera) -> None:
    """V_d + sigma n, by pixel."""
    camera.swing_V = camera.swing_V + effect.sigma_V * camera.normal(*camera.shape)


@law
def row_fixed_pattern(effect: Any, camera: Camera) -> None:
    """V_d + sigma n, by row."""
    camera.swing_V = camera.swing_V + 1e-3 * effect.sigma_mV * camera.normal(camera.shape[0], 1)


@law
def column_fixed_pattern(effect: Any, camera: Camera) -> None:
    """V_d + sigma n, by column."""
    camera.swing_V = camera.swing_V + 1e-3 * effect.sigma_mV * camera.normal(1, camera.shape[1])


@law
def reset_noise(effect: Any, camera: Camera) -> None:
    """A normal voltage left by each reset."""
    camera.noise_V = float(np.hypot(camera.noise_V, 1e-3 * effect.sigma_mV))


@law
def excess_threshold_noise(effect: Any, camera: Camera) -> None:
    """Another, of the comparator."""
    camera.noise_V = float(np.hypot(camera.noise_V, 1e-3 * effect.sigma_mV))


@law
def common_threshold_noise(effect: Any, camera: Camera) -> None:
    """One draw a frame for all pixels."""
    camera.add_offset_mV(effect.sigma_mV * camera.normal(camera.frames, 1, 1))


@law
def row_temporal_noise(effect: Any, camera: Camera) -> None:
    """One draw a frame and row."""
    camera.add_offset_mV(effect.sigma_mV * camera.normal(camera.frames, camera.shape[0], 1))


@law
def frame_threshold_noise(effect: Any, camera: Camera) -> None:
    """One draw a frame and pixel."""
    camera.add_offset_mV(effect.sigma_mV * camera.normal(camera.frames, *camera.shape))


@law
def threshold_flicker_noise(effect: Any, camera: Camera) -> None:
    """A sum of Ornstein-Uhlenbeck processes, one an octave, of correlation times 2, 4, 8 ... frames.

    dtheta = -theta dt / tau + noise: theta(t + h) = theta(t) e + sigma sqrt(1 - e^2) n, e = exp(-h/tau).
    """
    steps = camera.frames * PARTS
    total = np.zeros((steps, *camera.shape))
    for j in range(int(effect.octaves)):
        kept = np.exp(-1.0 / (PARTS * 2.0 ** (j + 1)))
        theta = effect.sigma_mV * camera.normal(*camera.shape)
        for i in range(steps):
            total[i] += theta
            theta = kept * theta + effect.sigma_mV * np.sqrt(1.0 - kept**2) * camera.normal(*camera.shape)
    camera.add_offset_mV(total)


@law
def supply_ripple(effect: Any, camera: Camera) -> None:
    """phi (1 + rho sin 2 pi (f t + p)), crossed when it is crossed."""
    camera.law |= {
        "ripple": effect.ripple,
        "ripple_frequency": effect.frequency_hz / camera.frames_per_s,
        "ripple_phase": effect.phase_cycles,
    }


@law
def clock_feedthrough(effect: Any, camera: Camera) -> None:
    """phi + a (exp(-w/tau) - mean), w the time since the last edge of the array's clock, which all rows share."""
    camera.edge_V = 1e-3 * effect.amplitude_mV
    camera.law |= {"edge_phase": effect.phase_frames, "edge_tau": effect.tau_us * 1e-6 * camera.frames_per_s}


@law
def ir_drop(effect: Any, camera: Camera) -> None:
    """phi (1 + d a), a the share of the row that fired in the frame before."""
    camera.law["droop"] = effect.droop


# --- reset


@law
def dead_time(effect: Any, camera: Camera) -> None:
    """The node is held for tau after a crossing; electrons that arrive meanwhile are lost."""
    camera.law["dead"] = effect.tau_us * 1e-6 * camera.frames_per_s


@law
def comparator_delay(effect: Any, camera: Camera) -> None:
    """The comparator trips c / sqrt(x) after the crossing; electrons that arrive meanwhile are lost.  By convention the
    spike is of the frame in which the threshold is crossed."""
    camera.law["delay"] = effect.delay_us * 1e-6 * camera.frames_per_s


@law
def incomplete_reset(effect: Any, camera: Camera) -> None:
    """A reset leaves f (1 - exp(-T/tau)) of a threshold."""
    camera.law |= {"left": effect.fraction, "left_tau": effect.tau_us * 1e-6 * camera.frames_per_s}


@law
def synchronous_reset(effect: Any, camera: Camera) -> None:
    """From a crossing to the read-out, a share of the charge is lost."""
    camera.law["synchronous"] = effect.fraction


@law
def crosstalk(effect: Any, camera: Camera) -> None:
    """A reset kicks the four neighbours, at once, or by an option when its frame ends."""
    camera.kick = effect.kick
    camera.late_kick = getattr(effect, "when", "at_spike") == "frame_end"


# --- read-out


@law
def readout_skew(effect: Any, camera: Camera) -> None:
    """Rows are read one after the other within |s| frames, the first first, or for s < 0 the last; the one that is read
    last is read at the end of the frame."""
    rows = camera.shape[0]
    order = np.arange(rows) / max(rows - 1, 1)
    camera.early = effect.span * (1.0 - order) if effect.span > 0.0 else -effect.span * order


@law
def clock_jitter(effect: Any, camera: Camera) -> None:
    """Each read-out comes early or late by itself, for all pixels."""
    camera.jitter = effect.sigma_ns * 1e-9 * camera.frames_per_s * camera.normal(camera.frames + 1)


@law
def dead_pixels(effect: Any, camera: Camera) -> None:
    """A fraction of the pixels never fires."""
    alive = camera.rng.random(camera.shape) >= effect.fraction
    camera.reports.append(lambda bits: bits * alive)


@law
def missed_spikes(effect: Any, camera: Camera) -> None:
    """Each bit is lost with probability p."""
    camera.reports.append(lambda bits: bits * (camera.rng.random(bits.shape) >= effect.probability))


@law
def spurious_spikes(effect: Any, camera: Camera) -> None:
    """Each bit is set with probability p."""
    camera.reports.append(lambda bits: bits | (camera.rng.random(bits.shape) < effect.probability))


@law
def afterpulsing(effect: Any, camera: Camera) -> None:
    """Each bit is set again, a delay later, with probability p."""

    def reported(bits: Spikes) -> Spikes:
        later = int(effect.delay_frames)
        again = bits[:-later] & (camera.rng.random(bits[:-later].shape) < effect.probability)
        both = bits.copy()
        both[later:] |= again
        return np.asarray(both)

    camera.reports.append(reported)
