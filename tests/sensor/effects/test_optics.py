"""Optics: lamp and lens, each against its closed form."""

from __future__ import annotations

import numpy as np
import pytest
from laws import camera, check, population, rates
from scipy.special import erf

from spikecam_env.sensor import CATALOGUE, Keyframes, SensorModel, SpikeSensor


def test_light_flicker_has_its_amplitude_at_its_frequency_and_none_in_the_dark() -> None:
    """Rate x (1 + m sin): the share of P random phases that fires in a frame is off by sqrt(x/P) at most."""
    pixels, frames, x, m = 20_000, 800, 0.2, 0.1
    sensor = camera("light_flicker", (1, pixels), modulation=m, frequency_hz=200.0, phase_cycles=0.25)
    rate = population(sensor, x, frames)
    wave = np.sin(2 * np.pi * (200.0 * (np.arange(frames) + 0.5) / 40_000 + 0.25))
    amplitude = 2 * np.mean(rate * wave) / x
    check("relative amplitude", amplitude, m, 4.5 * np.sqrt(2 / frames / pixels / x))
    assert sensor.step(np.zeros((1, pixels)), 100)[1:].sum() == 0


def test_lamp_drift_moves_all_pixels_together() -> None:
    """Halves of the array see the same walk: their rates, each known to sqrt(x/P) a frame, differ by no more."""
    sensor = camera("lamp_drift", (2, 20_000), seed=3, sigma_per_root_s=5.0)
    spikes = sensor.step(np.full((2, 20_000), 0.3), 400).mean(axis=2)
    windows = spikes.reshape(10, 40, 2).mean(axis=1)
    apart, moved = np.abs(windows[:, 0] - windows[:, 1]).max(), np.ptp(windows[:, 0])
    print(f"range of the rate {moved:.4f}, halves apart {apart:.4f}")
    assert apart < 4.5 * np.sqrt(2 * 0.3 / 20_000 / 40) < moved


@pytest.mark.parametrize("sigma", [0.1, 0.3, 0.5, 1.0, 2.0])
def test_optical_blur_of_an_edge_is_the_error_function_averaged_over_each_pixel(sigma) -> None:
    """Edges at 40 places within a pixel, which a kernel on pixels cannot know: the error by that is at most 1.5 times
    the error of the best symmetric kernel, found by least squares."""

    def area(x):  # integral of the normal distribution function
        z = x / sigma
        return sigma * (0.5 * z * (1 + erf(z / np.sqrt(2))) + np.exp(-z * z / 2) / np.sqrt(2 * np.pi))

    left = np.arange(61) - 30 - (np.arange(40)[:, None] + 0.5) / 40
    edge, exact, middle = np.clip(left + 1, 0.0, 1.0), area(left + 1) - area(left), slice(22, 39)
    blur = CATALOGUE["optical_blur"](sigma_pixels=sigma)
    off = np.stack([blur.image(np.stack([e] * 3))[1] for e in edge]) - exact
    shifted = [(np.roll(edge, n, axis=1) + np.roll(edge, -n, axis=1))[:, middle].ravel() for n in range(10)]
    _, best, *_ = np.linalg.lstsq(np.stack(shifted, axis=1), exact[:, middle].ravel(), rcond=None)
    missed, least = float(np.sqrt(np.mean(off[:, middle] ** 2))), float(np.sqrt(best[0] / (40 * 17)))
    print(f"missed {100 * missed:.2f} % of the edge, by the best kernel {100 * least:.2f} %")
    assert missed < 1.5 * least


@pytest.mark.parametrize("sigma", [0.05, 0.1, 0.3, 0.5, 1.0, 3.0])
def test_optical_blur_has_its_variance_however_small(sigma) -> None:
    spot = np.zeros((61, 61))
    spot[30, 30] = 1.0
    spread = CATALOGUE["optical_blur"](sigma_pixels=sigma).image(spot)
    variance = float(spread.sum(axis=0) @ (np.arange(61) - 30.0) ** 2)
    check("variance [pixels^2]", variance, sigma**2, 1e-6 + 1e-5 * sigma**2)
    check("light", float(spread.sum()), 1.0, 1e-9)


@pytest.mark.parametrize("engine", ["fast", "reference"])
def test_every_picture_of_a_film_goes_through_the_lens_once(engine, monkeypatch) -> None:
    """Also where a step begins within a key interval; and the bits are those of a film that was blurred before."""
    film = Keyframes(np.arange(6) * 4.0, np.random.default_rng(0).random((6, 8, 9), dtype=np.float32))
    blur, seen = CATALOGUE["optical_blur"](sigma_pixels=0.8), []
    image = type(blur).image
    blurred = Keyframes(film.frame, np.stack([image(blur, picture) for picture in film.radiance]))
    monkeypatch.setattr(type(blur), "image", lambda self, picture: seen.append(1) or image(self, picture))
    ideal = SensorModel.preset("ideal")
    one, other = (SpikeSensor(m, (8, 9), 0, engine=engine) for m in (ideal.with_effect(blur), ideal))
    for frames in (3, 6, 11):
        assert np.array_equal(one.step(film, frames), other.step(blurred, frames))
    assert len(seen) == 6
    for _ in range(9):
        one.step(np.full((8, 9), 0.3, np.float32))
    assert len(seen) == 7


def test_optical_blur_leaves_flat_light_alone() -> None:
    rate = rates(camera("optical_blur", (8, 8), sigma_pixels=1.0), 0.37, 1000)
    assert np.abs(rate - 0.37).max() <= 1 / 1000


@pytest.mark.parametrize(
    "centre, expected",
    [({}, {(10, 10): 0.5, (0, 20): 0.3, (10, 0): 0.4}),
     ({"centre_x": 1.0, "centre_y": 0.0}, {(0, 20): 0.5, (20, 0): 0.3, (0, 0): 0.4})],
)  # fmt: skip
def test_vignetting_is_full_in_its_centre_and_loses_its_falloff_in_the_farthest_corner(centre, expected) -> None:
    rate = rates(camera("vignetting", (21, 21), falloff=0.4, **centre), 0.5, 4000)
    for pixel, value in expected.items():
        check(f"rate at {pixel}", rate[pixel], value, 1 / 4000)
