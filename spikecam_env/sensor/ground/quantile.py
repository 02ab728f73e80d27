"""The spread of a threshold as a polynomial: from a sum of eight random bytes to the exact law of a spike's charge.

A pixel has a threshold of N electrons, redrawn at each reset with relative spread kappa.  It fires when its expected
charge has advanced by X = Gamma(N (1 + kappa n)) / N, n ~ N(0, 1).  With L = log(1 - i u / N) the law has
the characteristic function

    E exp(i u X) = exp(-N L + (kappa N L)^2 / 2),       mean 1, variance s^2 = 1/N + kappa^2

(the Gamma law's (1 - iu/N)^(-N(1 + kappa n)), averaged over n), and the distribution follows by Gil-Pelaez inversion.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy

from spikecam_env.types import Floats

DEGREE = 7
"""Enough for an error below 1e-5 of probability from N = 50 on, 2e-5 at N = 20 (tests/sensor/test_fast_quantile)."""

MIN_ELECTRONS = 20.0
"""Below this a polynomial of that degree no longer follows the Gamma law."""

_REFITS = 20
_USED = 1e-9
"""Probability beyond which the fit is not weighted; the polynomial still rises there."""


def charge_cdf(z: Floats, electrons: float, kappa: float) -> Floats:
    """P((X - 1) / s <= z) for the law above, to 1e-10 for N >= 20.

    Gil-Pelaez: F(z) = 1/2 - (1/pi) integral_0^inf Im(exp(-i w z) phi(w)) / w dw, by trapezia.

    Args:
        z: (n,).
        electrons: N; inf for no shot noise (a normal law).
        kappa: relative spread of the threshold.
    """
    if np.isinf(electrons):
        return np.asarray(scipy.special.ndtr(z))
    w = np.arange(1, 161) * 0.1
    x = w / np.sqrt(1.0 / electrons + kappa**2) / electrons  # u / N
    log = np.log1p(-1j * x)
    log_less_mean = np.where(x < 1e-3, 0.5 * x**2 + 1j * (x**3 / 3 - x**5 / 5) - 0.25 * x**4, log + 1j * x)
    phi = np.exp(-electrons * log_less_mean + 0.5 * (kappa * electrons * log) ** 2)
    integrand = np.imag(np.exp(-1j * np.outer(z, w)) * phi) / w
    at_zero = -z
    return np.asarray(0.5 - 0.1 / np.pi * (0.5 * at_zero + integrand.sum(axis=1)))


def bell_cdf() -> tuple[Floats, Floats]:
    """Where the sum of eight bytes steps, as a number in (-4, 4), and the exact probability of lying below."""
    byte = np.full(256, 1.0 / 256.0)
    mass: Floats = byte
    for _ in range(7):
        mass = np.convolve(mass, byte).astype(np.float64)
    edges = np.arange(1, mass.size + 1, dtype=np.float64) / 256.0 + 3.5 / 256.0 - 4.0
    return edges, np.cumsum(mass)


@lru_cache(maxsize=64)
def fitted_polynomial(electrons: float, kappa: float) -> tuple[np.float32, ...]:
    """The law's quantile, by least squares on Chebyshev polynomials, reweighted towards the smallest greatest error.

    Returns:
        Coefficients c0 .. c7 of z(x), x in (-4, 4) the centred sum of eight bytes.
    """
    x, probability = bell_cdf()
    used = (probability > _USED) & (probability < 1.0 - _USED)
    x, normal = x[used][::4], scipy.special.ndtri(probability[used][::4])
    target = _quantile(electrons, kappa)(normal)
    density = np.exp(-0.5 * normal**2) / np.sqrt(2.0 * np.pi)
    weight = density + 1e-4
    for _ in range(_REFITS):
        series = np.polynomial.chebyshev.chebfit(x / 4.0, target, DEGREE, w=weight)
        error = density * np.abs(np.polynomial.chebyshev.chebval(x / 4.0, series) - target)
        weight *= np.sqrt(0.7 + 0.3 * np.sqrt((error + 1e-7) / (error.mean() + 1e-7)))
    power = np.polynomial.chebyshev.cheb2poly(series) / 4.0 ** np.arange(DEGREE + 1)
    return tuple(np.float32(c) for c in power)


def _quantile(electrons: float, kappa: float) -> scipy.interpolate.CubicSpline:
    """Quantile of the law against that of the normal law: nearly a straight line, so a spline follows it."""
    z = np.linspace(-8.0, 9.0, 341)
    probability = charge_cdf(z, electrons, kappa)
    sure = (probability > 1e-11) & (probability < 1.0 - 1e-11)
    normal = scipy.special.ndtri(probability[sure])
    return scipy.interpolate.CubicSpline(normal, z[sure])
