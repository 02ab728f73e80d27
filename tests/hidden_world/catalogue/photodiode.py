"""The photodiode: its response, its lag, its dark current."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tests.hidden_world.catalogue.drawing import (
    LAG_SUBSTEPS,
    Array,
    Whole,
    between,
    clusters,
    event_arrays,
    frames_of,
    log_uniform,
    shape,
    some_pixels,
    whole,
)
from tests.hidden_world.integrator import Physics
from tests.hidden_world.mechanism import Law, Mechanism, OnCamera, OnPhysics, Parameters, Rng
from tests.hidden_world.unit import FRAME_S, Camera
from tests.hidden_world.waves import Polygon, Rise

WARM_UP_RECORDINGS = 3.0
"""Time constant of a camera that warms through a campaign, in recordings."""
PARETO = 2.5
"""Exponent of the tail of a power law of currents: finite mean and variance."""
RARELY_UP = 0.2
"""Share of its time that a trap of unequal dwells is up."""


def _response(law: Callable[[Array, float], Array]) -> OnPhysics:
    """The charge of a frame's light goes through a curve."""

    def bend(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        ph.response = lambda x: law(x, p["beta"])

    return bend


def _lag(fills_at_once: bool) -> OnPhysics:
    def lag(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        ph.lags, ph.substeps = ((p["fraction"], frames_of(p["tau_us"])),), max(ph.substeps, LAG_SUBSTEPS)
        ph.lag_fills_at_once = fills_at_once

    return lag


def _blooms(*ways: tuple[int, int]) -> OnPhysics:
    """To the pixels so many rows and columns away, in equal parts."""

    def bloom(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        ph.bloom_share, ph.bloom_full, ph.bloom_to = p["share"], p["full"], ways

    return bloom


# ---- dark current


def _saturating(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.dark_waves += (Rise(p["rise"], p["tau_ms"] * 1e-3 / FRAME_S),)


def _through(factor: Callable[[Array], Array]) -> OnPhysics:
    """A factor on the dark current, of `rise` times the share of the recording that is over."""

    def drift(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        over = np.linspace(0.0, 1.0, 65)
        ph.dark_waves += (Polygon(frames * over, factor(p["rise"] * over)),)

    return drift


def _running_on(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    ph.dark_waves += (Rise(p["rise"], WARM_UP_RECORDINGS * frames, begin=-ph.before),)


def _hot(where: Callable[[Camera, float, Rng], Whole], current: Callable[[float, int, Rng], Array]) -> OnCamera:
    def heat(camera: Camera, p: Parameters, rng: Rng) -> Camera:
        dark, at = camera.dark.copy(), where(camera, p["fraction"], rng)
        dark.flat[at] += current(p["mean_pA"], at.size, rng) * camera.charge_of(1.0).flat[at]
        return replace(camera, dark=dark)

    return heat


def _exponential(mean: float, size: int, rng: Rng) -> Array:
    return rng.exponential(mean, size)


def _power_law(mean: float, size: int, rng: Rng) -> Array:
    return mean * (PARETO - 1.0) / PARETO * (1.0 + rng.pareto(PARETO, size))


def _tail(factor: Callable[[float, tuple[int, int], Rng], Array]) -> OnCamera:
    """Each pixel's dark current times a factor of its own."""
    return lambda camera, p, rng: replace(camera, dark=camera.dark * factor(p["sigma"], camera.shape, rng))


def _telegraph(size: Callable[[Camera, Whole, float, Rng], Array], up_share: float = 0.5) -> OnPhysics:
    """Each trap leaves its state after exponential times, at any moment; which pixels have one is in the key."""

    def switch(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
        traps = np.random.default_rng(int(p["traps"]))
        at = some_pixels(camera, p["fraction"], traps)
        charges = size(camera, at, p["amplitude_pA"], traps)
        dwell = 2.0 * p["dwell_ms"] * 1e-3 / FRAME_S
        events: list[tuple[float, int, float]] = []
        for pixel, charge in zip(at, charges, strict=True):
            up, time = rng.random() < up_share, 0.0
            if up:
                events.append((-1.0, pixel, charge))  # since before the first window, of whatever row
            while (time := time + rng.exponential(dwell * (up_share if up else 1.0 - up_share))) < frames:
                up = not up
                events.append((time, pixel, charge if up else -charge))
        ph.dark_steps = event_arrays(events)

    return switch


def _equal(camera: Camera, at: Whole, amplitude: float, traps: Rng) -> Array:
    return amplitude * camera.charge_of(1.0).flat[at]


def _in_proportion(camera: Camera, at: Whole, amplitude: float, traps: Rng) -> Array:
    """The amplitude is that of a pixel with the mean dark current."""
    return amplitude * camera.charge_of(1.0).mean() * camera.dark.flat[at] / camera.dark.mean()


def _unequal(camera: Camera, at: Whole, amplitude: float, traps: Rng) -> Array:
    return traps.exponential(amplitude, at.size) * camera.charge_of(1.0).flat[at]


MECHANISMS = (
    Mechanism(
        "photo_response_nonlinearity",
        "x <- x (1 - beta x)",
        physics=_response(lambda x, beta: x * (1.0 - beta * x)),
        far=(
            Law("third order", "x <- x (1 - beta x^2)", physics=_response(lambda x, beta: x * (1.0 - beta * x * x)),
                source="Razavi, RF Microelectronics: odd distortion"),
            Law("gamma", "x <- x^(1 - beta)", physics=_response(lambda x, beta: x ** (1.0 - beta)),
                source="Nakamura (ed.), Image Sensors (2006): gamma"),
        ),
    ),
    Mechanism(
        "photodiode_lag",
        "x <- (1 - f) x + f h_tau * x",
        shape(tau_us=log_uniform(150.0, 3000.0)),
        physics=_lag(fills_at_once=False),
        far=(
            Law("after a fall", "traps fill at once and empty with tau: lag where light falls only",
                physics=_lag(fills_at_once=True),
                source="Janesick, Scientific CCDs (2001): capture is fast, emission slow"),
        ),
    ),
    Mechanism(
        "blooming",
        "share of what is beyond `full` goes to four neighbours",
        shape(full=between(0.7, 1.0)),
        physics=_blooms((1, 0), (-1, 0), (0, 1), (0, -1)),
        far=(
            Law("along columns", "it goes up and down only", physics=_blooms((1, 0), (-1, 0)),
                source="Janesick, Scientific CCDs (2001): channel stops between columns"),
        ),
    ),
    Mechanism(
        "dark_current_drift",
        "I (1 + a (1 - exp(-t/tau)))",
        shape(tau_ms=log_uniform(20.0, 120.0)),
        physics=_saturating,
        far=(
            Law("linear", "I (1 + a t / T), fresh in each recording of length T", shape(),
                physics=_through(lambda rise: 1.0 + rise), source="the first order of any slow change"),
            Law("exponential", "I exp(a t / T), fresh in each recording", shape(), physics=_through(np.exp),
                source="Janesick, Scientific CCDs (2001): dark current doubles every few kelvin"),
            Law("running on", "I (1 + a (1 - exp(-t / 3 T))), t from the first recording on", shape(),
                physics=_running_on, source="Newton's law of cooling: a camera that warms up once"),
        ),
    ),
    Mechanism(
        "hot_pixels",
        "exponential extra current in a few pixels",
        shape(mean_pA=between(2.0, 5.0)),
        camera=_hot(some_pixels, _exponential),
        far=(
            Law("clusters", "in squares of two by two", camera=_hot(clusters, _exponential),
                source="Janesick, Scientific CCDs (2001): radiation damage"),
            Law("power law", "currents with a Pareto tail of exponent 2.5", camera=_hot(some_pixels, _power_law),
                source="field-enhanced generation: heavy tails"),
        ),
    ),
    Mechanism(
        "dark_current_tail",
        "I exp(sigma n)",
        camera=_tail(lambda sigma, size, rng: np.exp(sigma * rng.standard_normal(size))),
        far=(
            Law("gamma", "I times a gamma law of mean 1 and deviation sigma",
                camera=_tail(lambda sigma, size, rng: rng.gamma(sigma**-2, sigma**2, size)),
                source="Baer, A model for dark current characterization (2006): few defects a pixel"),
            Law("one side", "I exp(sigma |n|): none is darker",
                camera=_tail(lambda sigma, size, rng: np.exp(sigma * np.abs(rng.standard_normal(size)))),
                source="defects add current and take none"),
        ),
    ),
    Mechanism(
        "random_telegraph_noise",
        "two-state dark current in some pixels",
        shape(fraction=between(0.01, 0.04), dwell_ms=log_uniform(4.0, 25.0), traps=whole(0, 2**31)),
        physics=_telegraph(_equal),
        far=(
            Law("in proportion", "the step is a multiple of the pixel's own dark current",
                physics=_telegraph(_in_proportion), source="Hopkins & Hopkinson (1993): meta-stable defect of a pixel"),
            Law("unequal", "steps of an exponential law, up for a fifth of the time",
                physics=_telegraph(_unequal, RARELY_UP),
                source="Hopkins & Hopkinson (1993): amplitudes; Kirton & Uren (1989): capture is not emission"),
        ),
    ),
)  # fmt: skip
