"""The unit moved until it is refitted as it was measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small import MODEL, unit

from spikecam_env.gap.unit.indirect_inference import inferred_unit


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


@pytest.mark.parametrize("share, stays", [(0.35, True), (0.7, False)])
def test_beside_the_noise_of_an_effect_the_unit_keeps_its_own(share, stays):
    """Of a refit's s^2 the unit has a share; below a half the refits of its twins, a fifth too high, move nothing."""
    base = unit()
    used = replace(base, white=share * base.white)
    found = inferred_unit(MODEL, used, base, [replace(base, white=1.2 * base.white)])
    assert (found.white == used.white) == stays
    assert stays or found.white == pytest.approx((share - 0.2) * base.white)


def test_a_silent_pixel_far_from_all_others_keeps_a_finite_gain():
    """Gains of all others lie within a ten-thousandth, where a parabola through noise of 1 % says nothing of zero."""
    rng, size = np.random.default_rng(3), unit().gain.size
    used = replace(unit(), gain=np.median(unit().gain) * rng.normal(1.0, 1e-4, size))
    used.gain[0] = 0.0
    twin = replace(used, gain=used.gain * rng.normal(1.0, 0.01, size))
    found = inferred_unit(MODEL, used, used, [twin])
    largest = np.abs(np.log(found.gain[1:] / used.gain[1:])).max()
    print(f"others move by {largest:.4f} at most")
    assert np.isfinite(found.gain).all() and found.gain[0] == 0.0 and largest < 0.01
