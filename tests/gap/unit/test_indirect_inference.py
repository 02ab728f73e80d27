"""The unit moved until it is refitted as it was measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small import MODEL, unit

from spikecam_env.gap.unit.indirect_inference import extrapolated_unit, inferred_unit


def test_a_unit_is_inferred_along_a_line_and_not_to_the_noise_of_each_pixel():
    """Refits 1 % low at the dimmest pixel to 3 % at the brightest, each with 0.5 % of noise of its own: the rest of
    the noise is that of a line through 1024 pixels, at its ends some 4 sigma / sqrt(n)."""
    base = unit()
    x = (base.gain - base.gain.min()) / np.ptp(base.gain)
    noise = 0.005 * np.random.default_rng(0).standard_normal(x.size)
    seen = replace(base, gain=base.gain * np.exp(-(0.01 + 0.02 * x) + noise))
    ratio = np.log(inferred_unit(MODEL, base, base, [seen]).gain / base.gain)
    off = ratio - (0.01 + 0.02 * x)
    print(f"off by {np.abs(off).max():.2g} at most, noise {noise.std():.2g}")
    assert np.abs(off).max() < 4.5 * 4 * 0.005 / np.sqrt(x.size)


def test_a_unit_stays_where_an_effect_silences_its_twins():
    base = unit()
    silent = replace(base, gain=np.zeros_like(base.gain))
    assert inferred_unit(MODEL, base, base, [silent]) is base


@pytest.mark.parametrize("factor", [0.5, 3.0, 1e3, 1e6])
def test_a_unit_is_extrapolated_in_proportion_and_four_times_as_far_at_most(factor):
    base = unit()
    there = replace(base, gain=1.01 * base.gain, dark=0.9 * base.dark, white=3.0 * base.white)
    found = extrapolated_unit(base, there, factor, 4.0)
    reach = min(factor, 4.0)
    assert np.allclose(found.gain, base.gain * 1.01**reach) and found.white == pytest.approx(base.white * 3.0**reach)
    assert np.allclose(found.dark, np.maximum(base.dark * (1 - 0.1 * reach), 0.0))


@pytest.mark.parametrize("factor", [-0.5, 0.3])
def test_a_pixel_without_gain_keeps_its_own(factor):
    """A refit of a dead pixel may have any gain about none."""
    base = unit()
    gain = 1.01 * base.gain
    gain[:2] = -1e-4 * base.gain[0], 0.0
    found = extrapolated_unit(base, replace(base, gain=gain), factor, 4.0)
    assert np.array_equal(found.gain[:2], base.gain[:2]) and np.isfinite(found.gain).all()


@pytest.mark.parametrize("share, stays", [(0.35, True), (0.7, False)])
def test_beside_the_noise_of_an_effect_the_unit_keeps_its_own(share, stays):
    """Of a refit's s^2 the unit has a share; below a half the refits of its twins, a fifth too high, move nothing."""
    base = unit()
    used = replace(base, white=share * base.white)
    found = inferred_unit(MODEL, used, base, [replace(base, white=1.2 * base.white)])
    assert (found.white == used.white) == stays
    assert stays or found.white == pytest.approx((share - 0.2) * base.white)
