"""The settings at which every effect is compared, the hard ones among them, each with its statistics.

Few electrons make shot noise large and their simulation cheap; many of them show small differences.  A frame is 25 us,
a threshold a frame 190 pA.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.settings.statistics import (
    A1,
    A4,
    COINCIDENCE,
    COLUMNS,
    HISTOGRAM,
    POPULATION,
    QUANTILES,
    RATE,
    ROWS,
    SERIAL,
    SPREAD,
    STEADY,
    VARIANCE,
    Statistic,
    after,
    bands,
    latency,
    line,
    moments,
    places,
    wander,
    windows,
)
from benchmarks.settings.world import filmed
from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor
from spikecam_env.sensor.effects import CATALOGUE
from spikecam_env.types import Floats, Spikes
from tests.hidden_world.light import Light

JUMP = 1e-6
"""Time that a jump of light takes [frames]."""

Film = Callable[[int], tuple[Floats, Floats]]
"""Keys [frames] and levels of so many frames."""


@dataclass(frozen=True)
class Case:
    """One setting."""

    label: str
    film: Film
    effects: dict[str, dict[str, Any]]
    """Parameters by effect; the first effect is compared."""
    statistics: tuple[Statistic, ...]
    electrons: float = 100.0
    shape: tuple[int, int] = (8, 8)
    """Pixels of a group."""
    groups: int = 48
    """Number of independent groups; they make one camera side by side unless `separate`."""
    frames: int = 300
    separate: bool = False
    """Whether each group is a camera, for an effect that all pixels of a camera share."""
    picture: Floats = field(default_factory=lambda: np.ones((1, 1)))
    """Light of each pixel of a group over that of the film."""
    quick: bool = False

    @property
    def effect(self) -> str:
        return next(iter(self.effects), "light")

    @property
    def model(self) -> SensorModel:
        """The ideal pixel with shot noise and this setting's effects."""
        model = SensorModel.preset("ideal")
        for name, parameters in ({"shot_noise": {"quanta": self.electrons}} | self.effects).items():
            model = model.with_effect(CATALOGUE[name](**parameters))
        return model

    @property
    def cameras(self) -> tuple[int, tuple[int, int]]:
        """(number, shape) of the cameras."""
        rows, columns = self.shape
        return (self.groups, self.shape) if self.separate else (1, (rows, columns * self.groups))

    def world(self, seed: int) -> list[Spikes]:
        """Spikes (F, H, W) of every group in the hidden world."""
        cameras, shape = self.cameras
        keys, levels = self.film(self.frames)
        light = Light(keys, levels[:, None, None].astype(np.float32))
        seeds = np.random.SeedSequence([seed, 1]).generate_state(cameras)
        picture = self._picture(shape)
        return self._grouped([filmed(self.effects, self.electrons, picture, light, self.frames, int(s)) for s in seeds])

    def check(self) -> None:
        """Raise InputError where the sensor refuses this setting."""
        sensor = SpikeSensor(self.model, self.shape, engine="fast", threads=1)
        sensor.step(self._keyframes(self.shape), self.frames)

    def engine(self, name: str, seed: int) -> list[Spikes]:
        """The same by one of the sensor's engines."""
        cameras, shape = self.cameras
        light = self._keyframes(shape)
        seeds = np.random.SeedSequence([seed, 2 if name == "fast" else 3]).generate_state(cameras)
        return self._grouped(
            [SpikeSensor(self.model, shape, int(s), engine=name, threads=1).step(light, self.frames) for s in seeds]
        )

    def _keyframes(self, shape: tuple[int, int]) -> Keyframes:
        keys, levels = self.film(self.frames)
        return Keyframes(keys, (levels[:, None, None] * self._picture(shape)).astype(np.float32))

    def _picture(self, shape: tuple[int, int]) -> Floats:
        picture = np.broadcast_to(self.picture, self.shape)
        return np.tile(picture, (1, shape[1] // self.shape[1]))

    def _grouped(self, cameras: list[Spikes]) -> list[Spikes]:
        return cameras if self.separate else np.split(cameras[0], self.groups, axis=2)


# --- light


def steady(level: float) -> Film:
    return lambda frames: (np.array([0.0]), np.array([level]))


def repeated(period: float, at: list[float], levels: list[float]) -> Film:
    """These keys in every period."""

    def film(frames: int) -> tuple[Floats, Floats]:
        starts = period * np.arange(-2, int(frames / period) + 3)
        return (starts[:, None] + np.array(at)).ravel(), np.tile(levels, starts.size)

    return film


def strobe(mean: float, duty: float, phase: float = 0.0) -> Film:
    """One flash a frame."""
    high = mean / duty
    at = [phase, phase + JUMP, phase + duty, phase + duty + JUMP]
    return repeated(1.0, at, [0.0, high, high, 0.0])


def square(low: float, high: float, period: int, at: float) -> Film:
    """Up at `at` of every period, down half a period later."""
    edges = [at, at + JUMP, at + period / 2, at + period / 2 + JUMP]
    return repeated(period, edges, [low, high, high, low])


COSINE = repeated(1.0, [0.0, 0.25, 0.5, 0.75], [0.0, 0.2, 0.4, 0.2])
"""0.2 (1 - cos 2 pi t) by keys at quarter frames."""

SWING = repeated(48.0, [0.0, 7.3, 19.85, 30.4], [0.1, 0.55, 0.3, 0.75])
"""Slow light with keys between frames."""


def spot(rows: int, columns: int, low: float, high: float) -> Floats:
    picture = np.full((rows, columns), low)
    picture[rows // 2, columns // 2] = high
    return picture


# --- settings

PATTERN = (RATE, SPREAD, *QUANTILES)
"""Statistics of a fixed pattern."""


def _light() -> list[Case]:
    none: dict[str, dict[str, Any]] = {}
    return [
        Case("steady .3, N 50", steady(0.3), none, STEADY, electrons=50.0, quick=True),
        Case("steady .77, N 500", steady(0.77), none, STEADY, electrons=500.0, groups=32, shape=(4, 8)),
        Case("steady .05, N 200", steady(0.05), none, STEADY, electrons=200.0, frames=800),
        Case("steady 1.4, N 50", steady(1.4), none, (RATE, HISTOGRAM), electrons=50.0, frames=150),
        Case("steady 1.0, N 50", steady(1.0), none, (RATE, VARIANCE, HISTOGRAM), electrons=50.0, frames=150),
        Case("cosine, keys at quarters", COSINE, none, STEADY, quick=True),
        Case("strobe, 20 % duty, mean .3", strobe(0.3, 0.2), none, STEADY, frames=150),
        Case("strobe across the read-out", strobe(0.3, 0.2, 0.9), none, STEADY, frames=150),
        Case("strobe, peak 3, mean .6", strobe(0.6, 0.2, 0.35), none, STEADY, frames=100),
        Case("edges at n + .6", square(0.1, 0.6, 20, 5.6), none, (RATE, VARIANCE, SERIAL, *after(5, 20))),
        Case("step .25 after a frame's start", square(0.05, 0.9, 20, 5.25), none, (RATE, *after(5, 20))),
        Case("step .75 after a frame's start", square(0.05, 0.9, 20, 5.75), none, (RATE, *after(5, 20))),
        Case("swing, keys between frames", SWING, none, (RATE, VARIANCE, SERIAL, A1, A4, *after(19, 48))),
    ]


def _optics() -> list[Case]:
    def flicker(m: float, hz: float, p: float = 0.0) -> dict[str, dict[str, Any]]:
        return {"light_flicker": {"modulation": m, "frequency_hz": hz, "phase_cycles": p}}

    drift = {"lamp_drift": {"sigma_per_root_s": 10.0}}
    beside = (*places((4, 4), (4, 5), (3, 4), (3, 5), (4, 6), (0, 0)), RATE)
    shaded = {"vignetting": {"falloff": 0.4, "centre_x": 0.3}}
    array: dict[str, Any] = {"electrons": 500.0, "frames": 150, "separate": True}
    large: dict[str, Any] = {"shape": (16, 16), "separate": True}
    blurred: dict[str, Any] = {**array, "picture": spot(8, 8, 0.2, 1.0), "groups": 40}
    return [
        Case("100 Hz, m .3", steady(0.3), flicker(0.3, 100.0), (*STEADY, *line(0.0025)), frames=800, groups=32),
        Case("40 kHz, m .5, phase 0", steady(0.3), flicker(0.5, 40e3), STEADY, quick=True),
        Case("40 kHz, m .5, phase .25", steady(0.3), flicker(0.5, 40e3, 0.25), STEADY),
        Case("17 kHz, m .5", steady(0.3), flicker(0.5, 17e3), (*STEADY, *line(0.425)), electrons=500.0, groups=32),
        Case("20 kHz, m 1", steady(0.3), flicker(1.0, 20e3), (*STEADY, *line(0.5))),
        Case("57 kHz, m 1, light .8", steady(0.8), flicker(1.0, 57e3, 0.1), (*STEADY, *line(1.425)), groups=32),
        Case("17 kHz in cosine light", COSINE, flicker(0.5, 17e3), (*STEADY, *line(0.425))),
        Case("40 kHz in a strobe", strobe(0.3, 0.2, 0.1), flicker(0.5, 40e3), STEADY, frames=150),
        Case("10 / sqrt(s)", steady(0.3), drift, (RATE, *wander(1, 2, 8, 32)), **{**large, "frames": 64}),
        Case("sigma .5", steady(1.0), {"optical_blur": {"sigma_pixels": 0.5}}, beside, **blurred),
        Case("sigma 1.5", steady(1.0), {"optical_blur": {"sigma_pixels": 1.5}}, beside, **blurred),
        Case("falloff .4", steady(0.5), shaded, (*places((0, 0), (7, 7), (4, 2)), RATE, SPREAD), **array),
    ]


def _photodiode() -> list[Case]:
    def lag(f: float, frames: float) -> dict[str, dict[str, Any]]:
        return {"photodiode_lag": {"fraction": f, "tau_us": 25.0 * frames}}

    def trap(frames: float) -> dict[str, dict[str, Any]]:
        telegraph = {"amplitude_pA": 76.0, "fraction": 1.0, "dwell_ms": 0.025 * frames}
        return {"random_telegraph_noise": telegraph, "dark_current": {"mean_pA": 19.0}}

    def warming(rise: float, frames: float) -> dict[str, dict[str, Any]]:
        return {"dark_current_drift": {"rise": rise, "tau_ms": 0.025 * frames}, "dark_current": {"mean_pA": 38.0}}

    def bent(beta: float) -> dict[str, dict[str, Any]]:
        return {"photo_response_nonlinearity": {"beta": beta}}

    dark, step = steady(0.0), (RATE, *after(5, 40))
    edges = square(0.1, 0.7, 40, 5.6)
    in_the_dark = {"dark_current": {"mean_pA": 38.0}}
    hot, bias = {"hot_pixels": {"fraction": 0.05, "mean_pA": 40.0}}, {"bias_voltage_spread": {"sigma_V": 0.05}}
    patterns: dict[str, Any] = {"electrons": 200.0, "frames": 100, "shape": (16, 16), "groups": 32}
    bloom = {"blooming": {"share": 0.4, "full": 1.0}}
    beside = (*places((4, 4), (4, 5), (3, 4), (3, 5)), RATE)
    blooms: dict[str, Any] = {"electrons": 100.0, "separate": True, "groups": 48, "frames": 200}
    return [
        Case("f .3, tau 1.5, edges at n + .6", edges, lag(0.3, 1.5), step, frames=400, quick=True),
        Case("f 1, tau 1.5, edges at n + .6", edges, lag(1.0, 1.5), step, frames=400),
        Case("f .5, tau .2, edges at n + .6", edges, lag(0.5, 0.2), step, frames=400),
        Case("f .3, tau 12, edges at n + .1", square(0.1, 0.7, 40, 5.1), lag(0.3, 12.0), step, frames=400),
        Case("f .5, tau 1.5, cosine light", COSINE, lag(0.5, 1.5), STEADY),
        Case("f .5, tau .3, strobe", strobe(0.3, 0.2, 0.7), lag(0.5, 0.3), STEADY),
        Case("dwell 1 frame", dark, trap(1.0), (*STEADY, *windows(4, 16))),
        Case("dwell .1 frames", dark, trap(0.1), (*STEADY, *windows(4, 16)), groups=32),
        Case("dwell 20 frames", dark, trap(20.0), (*STEADY, *windows(4, 16))),
        Case("dwell 1 frame, in light", steady(0.2), trap(1.0), (*STEADY, *windows(4, 16))),
        Case("rise 3, tau .5", dark, warming(3.0, 0.5), moments(0, 1, 2, 4, 8), frames=16, groups=640),
        Case("rise 3, tau 3", dark, warming(3.0, 3.0), moments(0, 1, 2, 4, 8), frames=16, groups=640),
        Case("beta .25, light .8", steady(0.8), bent(0.25), STEADY),
        Case("beta -.25, light .5", steady(0.5), bent(-0.25), STEADY),
        Case("beta .25, strobe", strobe(0.3, 0.3), bent(0.25), STEADY),
        Case("beta .25, cosine light", COSINE, bent(0.25), STEADY),
        Case("a spot of 1.8", steady(1.0), bloom, beside, picture=spot(8, 8, 0.3, 1.8), **blooms),
        Case("a spot, strobe", strobe(1.0, 0.6, 0.2), bloom, beside, picture=spot(8, 8, 0.3, 1.2), **blooms),
        Case("a spot, slow swing", SWING, bloom, beside, picture=spot(8, 8, 0.3, 2.4), **blooms),
        Case("38 pA", dark, in_the_dark, STEADY),
        Case("38 +- 8 pA", dark, {"dark_current_spread": {"sigma_pA": 8.0}} | in_the_dark, PATTERN, **patterns),
        Case("38 pA, log .45", dark, {"dark_current_tail": {"sigma": 0.45}} | in_the_dark, PATTERN, **patterns),
        Case("5 % hot, 40 pA", dark, hot | in_the_dark, PATTERN, **patterns),
        Case("gain 5 %", steady(0.3), {"conversion_gain_spread": {"sigma": 0.05}}, PATTERN, **patterns),
        Case("capacitance .3 fF", steady(0.3), {"capacitor_spread": {"sigma_fF": 0.3}}, PATTERN, **patterns),
        Case("bias 50 mV", steady(0.3), bias, PATTERN, **patterns),
        Case("bias 50 mV, in the dark", dark, bias | in_the_dark, PATTERN, **patterns),
    ]


def _threshold() -> list[Case]:
    def ripple(rho: float, hz: float, p: float = 0.0) -> dict[str, dict[str, Any]]:
        return {"supply_ripple": {"ripple": rho, "frequency_hz": hz, "phase_cycles": p}}

    def mV(name: str, sigma: float) -> dict[str, dict[str, Any]]:
        return {name: {"sigma_mV": sigma}}

    def edge(height_mV: float, tau: float) -> dict[str, dict[str, Any]]:
        return {"clock_feedthrough": {"amplitude_mV": height_mV, "phase_frames": 0.6, "tau_us": 25.0 * tau}}

    fine: dict[str, Any] = {"electrons": 1000.0, "groups": 32, "shape": (4, 8), "frames": 250}
    of_all = (*STEADY, *POPULATION)
    dim: dict[str, Any] = {"electrons": 1000.0, "frames": 400, "groups": 32}
    common: dict[str, Any] = {"electrons": 300.0, "groups": 40, "shape": (8, 8), "frames": 200, "separate": True}
    dark = {"dark_current": {"mean_pA": 57.0}}
    skew, by_rows = {"readout_skew": {"span": -1.1}}, (*STEADY, ROWS, *bands(4))
    banded: dict[str, Any] = {"electrons": 1000.0, "groups": 32, "shape": (16, 2), "frames": 250}
    rows: dict[str, Any] = {"electrons": 500.0, "shape": (16, 8), "groups": 48, "frames": 100, "separate": True}
    flicker = {"threshold_flicker_noise": {"sigma_mV": 20.0, "octaves": 4}}
    return [
        Case("2 % at 17 kHz", steady(0.4), ripple(0.02, 17e3), (*STEADY, *line(0.425)), **fine, quick=True),
        Case("2 % at 17 kHz, light .9", steady(0.9), ripple(0.02, 17e3), (*STEADY, *line(0.425)), **fine),
        Case("2 % at 17 kHz, in the dark", steady(0.0), ripple(0.02, 17e3) | dark, (*STEADY, *line(0.425)), **fine),
        Case("2 % at 100 kHz", steady(0.3), ripple(0.02, 100e3, 0.2), STEADY, **fine),
        Case("5 % at 40 kHz", steady(0.3), ripple(0.05, 40e3), STEADY, **fine),
        Case("5 % at 40 kHz, phase .5", steady(0.3), ripple(0.05, 40e3, 0.5), STEADY, **fine),
        Case("30 % at 17 kHz", steady(0.3), ripple(0.3, 17e3), (*STEADY, *line(0.425)), **fine),
        Case("5 % at 17 kHz", steady(0.3), ripple(0.05, 17e3), (*STEADY, *line(0.425)), **fine),
        Case("5 % at 1 kHz", steady(0.3), ripple(0.05, 1e3), (*STEADY, *line(0.025)), electrons=500.0, groups=32),
        Case("2 % at 17 kHz, cosine light", COSINE, ripple(0.02, 17e3), (*STEADY, *line(0.425)), **fine),
        Case("2 % at 17 kHz, strobe", strobe(0.3, 0.2), ripple(0.02, 17e3), (*STEADY, *line(0.425)), **fine),
        Case(".4 % at 17 kHz, strobe", strobe(0.3, 0.2), ripple(0.004, 17e3), (*STEADY, *line(0.425)), **fine),
        Case("5 % at 40 kHz, light 1.3", steady(1.3), ripple(0.05, 40e3), (RATE, HISTOGRAM), frames=100),
        Case("-20 mV, tau .25", steady(0.333), edge(-20.0, 0.25), (*STEADY, ROWS), **banded),
        Case("-20 mV, tau .25, skew -1.1", steady(0.35), edge(-20.0, 0.25) | skew, by_rows, **banded),
        Case("-50 mV, tau .25, skew -1.1", steady(0.5), edge(-50.0, 0.25) | skew, by_rows, **banded),
        Case("50 mV, tau .1, skew -1.1", steady(0.35), edge(50.0, 0.1) | skew, by_rows, **banded),
        Case("-50 mV, cosine light", COSINE, edge(-50.0, 0.25), (*STEADY, ROWS), **banded),
        Case("-21 mV, cosine light", COSINE, edge(-21.0, 0.25), (*STEADY, ROWS), **banded),
        Case("50 mV, N 500", steady(0.3), mV("reset_noise", 50.0), STEADY, electrons=500.0, groups=32),
        Case("50 mV, N 500", steady(0.3), mV("excess_threshold_noise", 50.0), STEADY, electrons=500.0, groups=32),
        Case("20 mV", steady(0.3), mV("common_threshold_noise", 20.0), of_all, **common),
        Case("20 mV", steady(0.3), mV("row_temporal_noise", 20.0), of_all, **common | {"shape": (1, 64)}),
        Case("6.36 mV, light .05", steady(0.05), mV("frame_threshold_noise", 6.36), STEADY, **dim),
        Case("60 mV, light .1", steady(0.1), mV("frame_threshold_noise", 60.0), STEADY, electrons=500.0, groups=32),
        Case("60 mV, light .9", steady(0.9), mV("frame_threshold_noise", 60.0), STEADY, groups=32),
        Case("4 octaves of 20 mV", steady(0.2), flicker, STEADY, electrons=500.0, groups=32, shape=(4, 8)),
        Case("d .1, light .3", steady(0.3), {"ir_drop": {"droop": 0.1}}, of_all, **common),
        Case("d -.1, light .8", steady(0.8), {"ir_drop": {"droop": -0.1}}, of_all, **common),
        Case("20 mV", steady(0.3), mV("row_fixed_pattern", 20.0), (RATE, ROWS), **rows),
        Case("20 mV", steady(0.3), mV("column_fixed_pattern", 20.0), (RATE, COLUMNS), **{**rows, "shape": (8, 16)}),
    ]


def _reset() -> list[Case]:
    def dead(frames: float) -> dict[str, dict[str, Any]]:
        return {"dead_time": {"tau_us": 25.0 * frames}}

    def delay(frames: float) -> dict[str, dict[str, Any]]:
        return {"comparator_delay": {"delay_us": 25.0 * frames}}

    def left(f: float, frames: float) -> dict[str, dict[str, Any]]:
        return {"incomplete_reset": {"fraction": f, "tau_us": 25.0 * frames}}

    def lost(f: float) -> dict[str, dict[str, Any]]:
        return {"synchronous_reset": {"fraction": f}}

    def kick(k: float) -> dict[str, dict[str, Any]]:
        return {"crosstalk": {"kick": k}}

    beside: dict[str, Any] = {"electrons": 150.0, "shape": (12, 12), "groups": 40, "frames": 200, "separate": True}
    few, coupled = beside | {"electrons": 100.0}, (*STEADY, *COINCIDENCE)
    edges = square(0.1, 0.7, 20, 5.6)
    return [
        Case("tau .1, light .3", steady(0.3), dead(0.1), STEADY),
        Case("tau .9, light .3", steady(0.3), dead(0.9), STEADY, quick=True),
        Case("tau .9, light .8", steady(0.8), dead(0.9), STEADY),
        Case("tau .5, light 1.6", steady(1.6), dead(0.5), STEADY, electrons=500.0, frames=200, groups=32),
        Case("tau .9, cosine light", COSINE, dead(0.9), STEADY),
        Case("tau .5, strobe", strobe(0.4, 0.2, 0.3), dead(0.5), STEADY),
        Case("tau .9, edges at n + .6", edges, dead(0.9), (RATE, VARIANCE, SERIAL, *after(5, 20))),
        Case("tau .045, cosine light", COSINE, dead(0.045), STEADY),
        Case("tau .006, strobe", strobe(0.4, 0.2, 0.3), dead(0.006), STEADY),
        Case("tau .025, edges at n + .6", edges, dead(0.025), (RATE, VARIANCE, SERIAL, *after(5, 20))),
        Case("c .1, light .3", steady(0.3), delay(0.1), STEADY),
        Case("c .5, light .3", steady(0.3), delay(0.5), STEADY),
        Case("c .9, light .1, N 25", steady(0.1), delay(0.9), STEADY, electrons=25.0, frames=600),
        Case("c .3, edges at n + .6", edges, delay(0.3), (RATE, VARIANCE, SERIAL, *after(5, 20))),
        Case("c .015, edges at n + .6", edges, delay(0.015), (RATE, VARIANCE, SERIAL, *after(5, 20))),
        Case("f .02, tau 10", steady(0.3), left(0.02, 10.0), STEADY),
        Case("f .4, tau 1", steady(0.3), left(0.4, 1.0), STEADY),
        Case("f .4, tau 3, light .9", steady(0.9), left(0.4, 3.0), STEADY, quick=True),
        Case("f .4, tau 5, edges at n + .6", edges, left(0.4, 5.0), (RATE, VARIANCE, SERIAL, *after(5, 20))),
        Case("f .055, tau 5, edges at n + .6", edges, left(0.055, 5.0), (RATE, VARIANCE, SERIAL, *after(5, 20))),
        Case("all, light .3", steady(0.3), lost(1.0), STEADY),
        Case("half, N 1000", steady(0.7), lost(0.5), STEADY, electrons=1000.0, groups=16),
        Case("all, strobe", strobe(0.4, 0.2, 0.3), lost(1.0), STEADY),
        Case("k .02, light .22", steady(0.22), kick(0.02), coupled, **beside, quick=True),
        Case("k -.02, light .22", steady(0.22), kick(-0.02), coupled, **beside),
        Case("k .05, light .22", steady(0.22), kick(0.05), coupled, **beside),
        Case("k .1, light .22", steady(0.22), kick(0.1), coupled, **beside),
        Case("k .02, light .85", steady(0.85), kick(0.02), coupled, **{**beside, "frames": 100}),
        Case("k -.1, light 1.2", steady(1.2), kick(-0.1), coupled, **few),
        Case("k .05, cosine light", COSINE, kick(0.05), coupled, **few),
        Case("k .05, edges at n + .6", edges, kick(0.05), (*coupled, *after(5, 20)), **few),
        Case("k .005, edges at n + .6", edges, kick(0.005), (*coupled, *after(5, 20)), **few),
    ]


def _readout() -> list[Case]:
    def skew(span: float) -> dict[str, dict[str, Any]]:
        return {"readout_skew": {"span": span}}

    def jitter(ns: float) -> dict[str, dict[str, Any]]:
        return {"clock_jitter": {"sigma_ns": ns}}

    edges = square(0.1, 0.7, 20, 5.6)
    seen = (RATE, *after(5, 20), *latency(5, 20))
    flicker = {"light_flicker": {"modulation": 0.5, "frequency_hz": 17e3}}
    ripple = {"supply_ripple": {"ripple": 0.02, "frequency_hz": 17e3}}
    lag = {"photodiode_lag": {"fraction": 0.5, "tau_us": 37.5}}
    rows: dict[str, Any] = {"shape": (16, 4), "groups": 48, "frames": 400}
    short = rows | {"frames": 250}
    fine: dict[str, Any] = {"electrons": 1000.0, "shape": (16, 2), "groups": 32, "frames": 250}
    common: dict[str, Any] = {"shape": (16, 16), "groups": 40, "frames": 150, "separate": True}
    lines = (RATE, VARIANCE, SERIAL, A1, *line(0.425), *line(0.575))
    together = {
        "readout_skew": {"span": 0.8},
        "supply_ripple": {"ripple": 0.03, "frequency_hz": 23e3, "phase_cycles": 0.0},
        "light_flicker": {"modulation": 0.5, "frequency_hz": 17e3, "phase_cycles": 0.3},
        "photodiode_lag": {"fraction": 0.3, "tau_us": 20.0},
        "dead_time": {"tau_us": 8.0},
        "dark_current": {"mean_pA": 10.0},
    }
    return [
        Case("span .9, edges at n + .6", edges, skew(0.9), seen, **rows, quick=True),
        Case("span 1, cosine light", COSINE, skew(1.0), (*STEADY, ROWS), **short),
        Case("span 1, strobe", strobe(0.3, 0.2, 0.3), skew(1.0), (*STEADY, ROWS), **short),
        Case("span 1, flicker 17 kHz", steady(0.3), skew(1.0) | flicker, (*STEADY, *line(0.425)), **short),
        Case("span 1, ripple 2 % at 17 kHz", steady(0.3), skew(1.0) | ripple, (*STEADY, *line(0.425)), **fine),
        Case("span .9, lag, edges at n + .6", edges, skew(0.9) | lag, seen, **rows),
        Case("span -1.1, edges at n + .6", edges, skew(-1.1), seen, **rows),
        Case("1.25 us", steady(0.3), jitter(1250.0), (*STEADY, *POPULATION), **common),
        Case("5 us, light .8", steady(0.8), jitter(5000.0), (*STEADY, *POPULATION), **{**common, "frames": 100}),
        Case("5 us, cosine light", COSINE, jitter(5000.0), (*STEADY, *POPULATION), **common),
        Case("5 us, edges at n + .6", edges, jitter(5000.0), (RATE, *after(5, 20)), **common),
        Case(".24 us, cosine light", COSINE, jitter(240.0), (*STEADY, *POPULATION), **common),
        Case(".25 us, edges at n + .6", edges, jitter(250.0), (RATE, *after(5, 20)), **common),
        Case("p .05, 2 frames", steady(0.22), {"afterpulsing": {"probability": 0.05, "delay_frames": 2}}, STEADY),
        Case("p .3, 1 frame", steady(0.7), {"afterpulsing": {"probability": 0.3, "delay_frames": 1}}, STEADY),
        Case("5 %", steady(0.3), {"dead_pixels": {"fraction": 0.05}}, (RATE, SPREAD), frames=100),
        Case("p .05", steady(0.3), {"missed_spikes": {"probability": 0.05}}, STEADY),
        Case("p .01", steady(0.2), {"spurious_spikes": {"probability": 0.01}}, STEADY),
        Case("skew, ripple, flicker, lag, dead", SWING, together, lines, electrons=500.0, shape=(16, 2), groups=32),
    ]


def cases() -> list[Case]:
    """All settings, in the physical order of the effects."""
    listed = [*_light(), *_optics(), *_photodiode(), *_threshold(), *_reset(), *_readout()]
    return [case for case in listed if case.effects.keys() <= CATALOGUE.keys()]
