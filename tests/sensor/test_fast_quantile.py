"""The fast engine's draws: the law's distribution, the polynomial that follows it, and the hash below."""

from __future__ import annotations

import time

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray
from scipy import special, stats

from spikecam_env.sensor import SensorModel
from spikecam_env.sensor.engines.compiled import fast
from spikecam_env.sensor.ground import draws
from spikecam_env.sensor.ground.quantile import bell_cdf, charge_cdf, fitted_polynomial


def polynomial_at(x: NDArray[np.float64], electrons: float, kappa: float) -> NDArray[np.float64]:
    return np.polynomial.polynomial.polyval(x, np.array(fitted_polynomial(electrons, kappa), dtype=np.float64))


@pytest.mark.parametrize(
    ("electrons", "kappa"),
    [*((n, 0.0) for n in (20.0, 50.0, 5000.0, 50_000.0)), (50.0, 0.05), (500.0, 0.0072), (50_000.0, 0.0058)],
)
def test_law_is_the_gamma_law_averaged_over_thresholds(electrons: float, kappa: float) -> None:
    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    z = np.linspace(-4, 5, 100)
    charge = electrons * (1 + np.sqrt(1 / electrons + kappa**2) * z)
    mixture = special.gammainc(electrons * (1 + kappa * nodes), charge[:, None]) @ (weights / weights.sum())
    error = np.abs(charge_cdf(z, electrons, kappa) - mixture).max()
    print(f"N = {electrons:g}, kappa = {kappa:g}: {error:.1e}")
    assert error < (1e-8 if kappa else 1e-9)


OUTLYING = [(np.inf, 0.0058, 1e-5), (1e9, 0.0, 1e-5), (1e9, 0.0001, 1e-5), (20.0, 0.0, 2e-5)]
LAWS = [(n, k) for n in (50.0, 500.0, 5000.0, 29_650.0, 50_000.0) for k in (0.0, 0.0009, 0.0058, 0.09)]


@pytest.mark.parametrize(
    ("electrons", "kappa", "bound"),
    [*((*law, 1e-5) for law in LAWS), *OUTLYING],
)
def test_polynomial_is_the_quantile_within_1e_5_of_probability(electrons: float, kappa: float, bound: float) -> None:
    x, probability = bell_cdf()
    error = np.abs(charge_cdf(polynomial_at(x, electrons, kappa), electrons, kappa) - probability)
    error = error[(probability > 1e-10) & (probability < 1 - 1e-10)].max()
    print(f"N = {electrons:g}, kappa = {kappa:g}: {error:.1e}")
    assert error < bound


@pytest.mark.parametrize("electrons", [20.0, 50.0, 50_000.0, np.inf])
def test_polynomial_rises_throughout_and_leaves_every_threshold_positive(electrons: float) -> None:
    kappa = 0.09
    z = polynomial_at(np.linspace(-4, 4, 10_001), electrons, kappa)
    assert np.all(np.diff(z) > 0)
    assert 1 + np.sqrt(1 / electrons + kappa**2) * z[0] > 0


def test_a_fit_takes_less_than_a_fifth_of_a_second() -> None:
    took = np.inf
    for electrons in (1234.0, 1235.0, 1236.0, 1237.0):
        begin = time.perf_counter()
        fitted_polynomial(electrons, 0.01)
        took = min(took, time.perf_counter() - begin)
    print(f"{1e3 * took:.0f} ms, best of four")
    assert took < 0.2


@njit
def sampled(pixels: int, spikes: int, seed_low: np.uint32, seed_high: np.uint32) -> NDArray[np.float64]:
    out = np.empty((pixels, spikes))
    for p in range(pixels):
        key = draws.first_key(p, seed_low)
        for i in range(spikes):
            counter = np.uint32(key + np.uint32(np.uint32(i) * np.uint32(0x9E3779B9)))
            out[p, i] = draws.bell(counter, draws.second_key(key, seed_high))
    return out


@pytest.fixture(scope="module")
def sample() -> NDArray[np.float64]:
    return sampled(40_000, 50, np.uint32(0xDEADBEEF), np.uint32(0x12345678))


def test_draws_follow_the_sum_of_eight_bytes(sample: NDArray[np.float64]) -> None:
    edges, probability = bell_cdf()
    inner = edges[(probability > 1e-4) & (probability < 1 - 1e-4)][::8]
    expected = np.diff(np.concatenate([[0], np.interp(inner, edges, probability), [1]])) * sample.size
    seen = np.bincount(np.searchsorted(inner, sample.ravel()), minlength=inner.size + 1)
    p = stats.chisquare(seen, expected).pvalue
    print(f"{seen.size} cells, {sample.size} draws: p = {p:.3f}")
    assert p > 1e-3


def test_draws_of_neighbours_and_of_successive_spikes_are_uncorrelated(sample: NDArray[np.float64]) -> None:
    standard = sample / sample.std()
    error = 1 / np.sqrt(sample.size)
    for name, a, b in [
        *((f"spike +{k}", standard[:, :-k], standard[:, k:]) for k in (1, 2, 3)),
        *((f"pixel +{k}", standard[:-k], standard[k:]) for k in (1, 2, 16, 256, 400)),
        ("squares, spike +1", standard[:, :-1] ** 2 - 1, standard[:, 1:] ** 2 - 1),
        ("squares, pixel +1", standard[:-1] ** 2 - 1, standard[1:] ** 2 - 1),
    ]:
        z = np.mean(a * b) / a.std() / b.std() / error
        print(f"{name}: z = {z:+.2f}")
        assert abs(z) < 4.5


def test_cameras_of_neighbouring_seeds_share_no_draws() -> None:
    """Without mixing the seed, seeds 0 and 1 would be the same streams on swapped pixels."""
    pixels = 4096
    unit = SensorModel.preset("scsim").draw_unit((1, pixels), 0)
    states = [fast.start(unit, np.zeros(pixels), seed) for seed in range(4)]
    firsts = [sampled(pixels, 1, *s.seeds).ravel() for s in states]
    equal = sum(np.sum(a[:, None] == b) for i, a in enumerate(firsts) for b in firsts[:i])
    step, sd = 2.0**-16, np.sqrt(8 / 12)
    by_chance = 6 * pixels**2 * step / (2 * np.sqrt(np.pi) * sd)
    print(f"{equal} pairs of equal draws, {by_chance:.0f} by chance")
    assert abs(equal - by_chance) < 4.5 * np.sqrt(by_chance)
