"""Parts of laws: units, places of pixels, how a case draws its parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tests.hidden_world.mechanism import Parameters, Rng
from tests.hidden_world.unit import FRAME_S, Camera

Array = NDArray[np.float64]
Whole = NDArray[np.int64]
RESET_SUBSTEPS = 4
"""Pieces of a frame where it matters when in a frame a pixel was reset."""
LAG_SUBSTEPS = 4
"""Pieces of a frame in which light that changes is filtered as if it were constant."""


def frames_of(us: float) -> float:
    """Microseconds in frames."""
    return us * 1e-6 / FRAME_S


def event_arrays(events: list[tuple[float, int, float]]) -> tuple[Array, Whole, Array]:
    """Time, pixel and size of events, in the order of time."""
    time, pixel, size = np.array(events, np.float64).reshape(-1, 3).T
    order = np.argsort(time, kind="stable")
    return time[order], pixel[order].astype(np.int64), size[order]


def some_pixels(camera: Camera, fraction: float, rng: Rng) -> Whole:
    """Flat indices of that share of the pixels, at least one."""
    count = camera.gain.size
    return rng.choice(count, max(1, round(fraction * count)), replace=False)


def clusters(camera: Camera, fraction: float, rng: Rng) -> Whole:
    """Flat indices of that share of the pixels in squares of two by two, at least one square."""
    rows, columns = (size // 2 for size in camera.shape)
    square = rng.choice(rows * columns, max(1, round(fraction * camera.gain.size / 4)), replace=False)
    corner = 2 * (square // columns) * camera.shape[1] + 2 * (square % columns)
    return np.concatenate([corner, corner + 1, corner + camera.shape[1], corner + camera.shape[1] + 1])


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


def followed(white: Array, kept: float) -> Array:
    """An AR(1) series along the first axis with the variance of `white`: each keeps `kept` of the one before."""
    series = white.copy()
    for n in range(1, len(series)):
        series[n] = kept * series[n - 1] + np.sqrt(1.0 - kept * kept) * white[n]
    return series


def shape(**laws: Callable[[Rng], float]) -> Callable[[Rng], Parameters]:
    """Parameters drawn each by its law."""
    return lambda rng: {name: law(rng) for name, law in laws.items()}


def between(low: float, high: float) -> Callable[[Rng], float]:
    return lambda rng: float(rng.uniform(low, high))


def log_uniform(low: float, high: float) -> Callable[[Rng], float]:
    return lambda rng: float(np.exp(rng.uniform(np.log(low), np.log(high))))


def whole(low: int, high: int) -> Callable[[Rng], float]:
    return lambda rng: float(rng.integers(low, high + 1))


def lines(low: float, high: float) -> Callable[[Rng], float]:
    """Hertz: in one case of four up to 18 kHz, near half the frame rate, as a switched supply or a dimmed lamp has."""
    return lambda rng: log_uniform(low, high)(rng) if rng.random() < 0.75 else log_uniform(high, 18e3)(rng)
