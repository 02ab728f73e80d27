"""The lamp and the lens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from tests.hidden_world.catalogue.drawing import between, lines, shape
from tests.hidden_world.integrator import Physics
from tests.hidden_world.light import Light
from tests.hidden_world.mechanism import Law, Mechanism, OnCamera, Parameters, Rng
from tests.hidden_world.unit import FRAME_S, Camera
from tests.hidden_world.waves import Polygon, Sine, Switched

HOPS_PER_S = 40.0
"""Jumps of an arc lamp: eight in a recording of 8000 frames."""
HALO_PIXELS = 2.0


def _lamp_walks(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    """Known at whole frames, or at `steps` moments of each, straight between them."""
    steps = int(p.get("steps", 1))
    walk = np.cumsum(rng.standard_normal(frames * steps + 1)) * p["sigma_per_root_s"] * np.sqrt(FRAME_S / steps)
    ph.light_waves += (Polygon(np.arange(walk.size) / steps, np.maximum(1.0 + walk, 0.0)),)


def _lamp_warms(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    """As far at the end as the walk is in the root mean square."""
    end = rng.choice([-1.0, 1.0]) * p["sigma_per_root_s"] * np.sqrt(frames * FRAME_S)
    ph.light_waves += (Polygon(np.array([0.0, frames]), np.array([1.0, 1.0 + end])),)


def _lamp_hops(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    """A walk of few large steps, with the variance a second of the walk of small ones."""
    at = np.sort(rng.uniform(0.0, frames, rng.poisson(HOPS_PER_S * frames * FRAME_S)))
    level = 1.0 + np.cumsum(np.r_[0.0, rng.standard_normal(at.size)]) * p["sigma_per_root_s"] / np.sqrt(HOPS_PER_S)
    time = np.c_[np.r_[0.0, at + 1e-3], np.r_[at, max(frames, 1.0 + at.max(initial=0.0))]].reshape(-1)
    ph.light_waves += (Polygon(np.maximum.accumulate(time), np.maximum(np.repeat(level, 2), 0.0)),)


def _sine(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    phase = p.get("phase_cycles", rng.random())
    ph.light_waves += (Sine(p["modulation"], p["frequency_hz"] * FRAME_S, phase),)


def _switched(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    period, m = 1.0 / (p["frequency_hz"] * FRAME_S), p["modulation"]
    ph.light_waves += (Switched(period, 0.5 * period, period * rng.random(), 1.0 + m, 1.0 - m),)


def _two_lamps(ph: Physics, camera: Camera, frames: int, p: Parameters, rng: Rng) -> None:
    """Each with half of the power."""
    for factor in (1.0, p["ratio"]):
        cycles = p["frequency_hz"] * factor * FRAME_S
        ph.light_waves += (Sine(p["modulation"] / np.sqrt(2.0), cycles, rng.random()),)


def _diffused(radiance: NDArray[np.float32], variance: float, axes: tuple[int, ...]) -> NDArray[np.float32]:
    """Light that diffuses to the pixels beside, `variance` [pixels^2] along each of these axes; of a flat, itself."""
    if radiance.shape[1:] == (1, 1):
        return radiance
    steps = max(8, int(np.ceil(10.0 * variance)))
    share = variance / 2.0 / steps
    for _ in range(steps):
        for axis in axes:
            radiance = convolve1d(radiance, np.array([share, 1.0 - 2.0 * share, share]), axis=axis, mode="nearest")
    return radiance


def normal_law(picture: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """Light spread along rows and columns by exp(-n^2 / 2 v) over n pixels, v such that the variance is sigma^2."""
    n = np.arange(-60, 61)
    low, high = 1e-3, sigma**2 + 1.0
    for _ in range(60):
        weights = np.exp(-(n**2) / (low + high))
        weights /= weights.sum()
        low, high = (0.5 * (low + high), high) if weights @ n**2 < sigma**2 else (low, 0.5 * (low + high))
    for axis in (0, 1):
        picture = convolve1d(picture, weights, axis=axis, mode="nearest")
    return picture


def _round(light: Light, shape: tuple[int, int], p: Parameters) -> Light:
    return Light(light.key_frame, _diffused(light.radiance, p["sigma_pixels"] ** 2, (1, 2)))


def _astigmatic(light: Light, shape: tuple[int, int], p: Parameters) -> Light:
    return Light(light.key_frame, _diffused(light.radiance, 2.0 * p["sigma_pixels"] ** 2, (2,)))


def _halo(light: Light, shape: tuple[int, int], p: Parameters) -> Light:
    """A share of the light, wide: the variance of the whole is that of the near law."""
    share = np.float32(p["sigma_pixels"] ** 2 / HALO_PIXELS**2)
    wide = _diffused(light.radiance, HALO_PIXELS**2, (1, 2))
    return Light(light.key_frame, light.radiance + share * (wide - light.radiance))


def _falls_off(power: int, centre: tuple[str, ...] = ()) -> OnCamera:
    """alpha (1 - v (r / r_corner)^power), never below a twentieth.

    centre: parameters by which it is off along columns and rows, in half of the height and width.
    """

    def shade(camera: Camera, p: Parameters, rng: Rng) -> Camera:
        rows, columns = camera.shape
        down, right = (p[name] for name in centre) if centre else (0.0, 0.0)
        y = (np.arange(rows) - (rows - 1) / 2 * (1.0 + down))[:, None]
        x = (np.arange(columns) - (columns - 1) / 2 * (1.0 + right))[None, :]
        square = (x * x + y * y) / ((rows - 1) ** 2 / 4 + (columns - 1) ** 2 / 4)
        return replace(camera, gain=camera.gain * np.maximum(1.0 - p["falloff"] * square ** (power // 2), 0.05))

    return shade


MECHANISMS = (
    Mechanism(
        "lamp_drift",
        "L (1 + w), w a random walk",
        physics=_lamp_walks,
        far=(
            Law("warms", "L (1 + d t / T), up or down", physics=_lamp_warms,
                source="Janesick, Photon Transfer (2007): lamp warm-up"),
            Law("hops", "L jumps 40 times a second, by a normal law", physics=_lamp_hops,
                source="arc wander; compound Poisson process, Kingman (1993)"),
        ),
    ),
    Mechanism(
        "light_flicker",
        "L (1 + m sin), the phase new in every recording",
        shape(frequency_hz=lines(100.0, 2000.0)),
        physics=_sine,
        far=(
            Law("switched", "L (1 + m sgn sin)", physics=_switched,
                source="Horowitz & Hill, The Art of Electronics: pulse-width dimming"),
            Law("two lamps", "two sines of m / sqrt 2, their frequencies 2 to 6 % apart",
                shape(frequency_hz=lines(100.0, 2000.0), ratio=between(1.02, 1.06)), physics=_two_lamps,
                source="beats: two oscillators that are not locked"),
        ),
    ),
    Mechanism(
        "vignetting",
        "alpha (1 - v r^2/r_corner^2)",
        camera=_falls_off(2),
        far=(
            Law("off centre", "the same about a centre that is off by 15 to 35 % of the half height and width",
                shape(rows_off=between(0.15, 0.35), columns_off=between(-0.35, -0.15)),
                camera=_falls_off(2, ("rows_off", "columns_off")),
                source="Smith, Modern Optical Engineering: decentred lens"),
            Law("mechanical", "alpha (1 - v r^4/r_corner^4): flat in the middle", camera=_falls_off(4),
                source="Smith, Modern Optical Engineering: vignetting by a stop"),
        ),
    ),
    Mechanism(
        "optical_blur",
        "light diffuses: heat equation of variance s^2",
        light=_round,
        far=(
            Law("astigmatic", "along rows only, variance 2 s^2", light=_astigmatic,
                source="Smith, Modern Optical Engineering: astigmatism"),
            Law("halo", "a share s^2 / 4 of the light spreads by 2 pixels, the rest is sharp", light=_halo,
                source="Janesick, Photon Transfer (2007): wings of the point spread"),
        ),
    ),
)  # fmt: skip
