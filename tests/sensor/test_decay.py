"""The exponential that numpy and a compiled loop have in common."""

from __future__ import annotations

import numpy as np
from numba import njit

from spikecam_env.sensor.decay import LONG, decayed

X = np.concatenate([[0.0, 1e-12, LONG], np.random.default_rng(0).uniform(0.0, LONG, 10_000)])


def test_it_is_the_exponential() -> None:
    assert np.allclose(decayed(X), np.exp(-X), rtol=1e-13, atol=0.0)
    assert decayed(0.0) == 1.0
    assert decayed(LONG) < np.finfo(float).eps / 2, "a decay of LONG is nothing beside 1"


def test_numpy_and_a_compiled_loop_give_the_same_bits() -> None:
    one = njit(decayed)

    @njit(error_model="numpy")
    def loop(x, out):  # type: ignore[no-untyped-def]
        for i in range(x.size):
            out[i] = one(x[i])

    compiled = np.empty_like(X)
    loop(X, compiled)
    assert np.array_equal(compiled, decayed(X))
