"""The base refit: a unit's own response, dark level and jitter from its recordings."""

from __future__ import annotations

import numpy as np
import pytest
from made_up_refit import IDEAL, PIXELS, made_up_refit, model_with
from small import MODEL, effect, recorded, unit

from spikecam_env.gap.unit.refit import common_level, constrained_refit, free_refit


@pytest.mark.parametrize("seed", [1, 5])
def test_gain_and_dark_maps_are_right_within_their_stated_errors(seed):
    """Mean of (error / sd)^2 over 1024 pixels is 1 -+ 4 sqrt(2 / 1024); the mean of error / sd is 0 -+ 4 / sqrt(1024).

    Up to 15 % more is left to errors that are no Gaussian: ends of recordings are read in whole frames.
    """
    base, true = recorded(seed=seed).base, unit()
    for name in ("gain", "dark"):
        z = (getattr(base, name) - getattr(true, name)) / getattr(base, f"{name}_sd")
        square, mean = float(np.mean(z**2)), float(np.mean(z))
        print(f"{name}: mean {mean:+.3f}, mean square {square:.3f}")
        assert abs(square - 1) < 4 * np.sqrt(2 / PIXELS) + 0.15
        assert abs(mean) < 4 / np.sqrt(PIXELS)


@pytest.mark.parametrize("kappa_mV, electrons", [(6.36, 50_000), (0.976, 29_646), (20.0, 50_000)])
def test_jitter_is_found_without_knowing_its_parts(kappa_mV, electrons):
    """Some 2e6 spikes in pieces of 64: s^2 to sqrt(2 * 64 / 2e6) = 0.8 %, four times."""
    model = MODEL.with_effect(effect("reset_noise", sigma_mV=kappa_mV))
    model = model.with_effect(effect("shot_noise", quanta=float(electrons)))
    found, true = recorded(model=model).base.white, unit(model).white
    print(f"s^2 {found:.3e} of {true:.3e}: {found / true - 1:+.2%}")
    assert found == pytest.approx(true, rel=0.032)


def test_a_few_false_spikes_are_no_jitter(monkeypatch):
    """Two in a recording of a thousand pixels: s^2 to 3.2 % as without them, while irregular pixels are left out."""
    model = MODEL.with_effect(effect("spurious_spikes", probability=1e-6))
    case, without = recorded(model=model), recorded().base.white
    print(f"s^2 {case.base.white:.3e}, without {without:.3e}: {case.base.white / without - 1:+.2%}")
    assert case.base.white == pytest.approx(without, rel=0.032)
    monkeypatch.setattr("spikecam_env.gap.observe.observation.MOST_IRREGULAR", 0.0)
    with_them = free_refit(list(case.observations), list(case.conditions)).white
    print(f"with them {with_them / without - 1:+.2%}")
    assert with_them > 1.1 * without


def test_residuals_of_an_unbent_camera_are_noise_about_nothing():
    base = recorded().base
    known = np.isfinite(base.residual)
    mean = np.array([r[k].mean() for r, k in zip(base.residual, known, strict=True)])
    spread = np.array([r[k].std() / np.sqrt(k.sum()) for r, k in zip(base.residual, known, strict=True)])
    print(np.round(mean / spread, 1))
    assert np.all(np.abs(mean[1:]) < 5 * spread[1:] + 2e-5)
    assert abs(mean[0]) < 5 * spread[0] + 2e-3  # in the dark 10 spikes a pixel: relative means are biased by 1/n^2


def test_dead_pixels_are_not_live():
    model = MODEL.with_effect(effect("dead_pixels", fraction=0.02))
    base, true = recorded(model=model).base, unit(model)
    dead = true.gain == 0
    print(f"{dead.sum()} dead, {(~base.live).sum()} not live")
    assert dead.sum() > 5 and np.array_equal(base.live, ~dead)


def test_under_an_ideal_model_a_refit_keeps_the_mean_gain_and_nothing_else():
    base = made_up_refit()
    found = constrained_refit(IDEAL, base)
    assert np.all(found.gain == np.median(base.gain))
    assert not found.dark.any() and found.white == 0.0


@pytest.mark.parametrize(
    "names, gain, dark, white",
    [
        (["conversion_gain_spread"], "own", "none", False),
        (["vignetting"], "own", "none", False),
        (["dark_current"], "mean", "mean", False),
        (["dark_current", "dark_current_spread"], "mean", "own", False),
        (["dark_current", "conversion_gain_spread"], "own", "own", False),
        (["shot_noise"], "mean", "none", True),
        (["reset_noise"], "mean", "none", True),
        (["dead_time", "crosstalk"], "mean", "none", False),
    ],
    ids=lambda v: "+".join(v) if isinstance(v, list) else None,
)
def test_a_constrained_refit_keeps_what_the_model_has_effects_for(names, gain, dark, white):
    base = made_up_refit()
    found = constrained_refit(model_with(*names), base)
    expected = {"own": base.gain, "mean": np.full(PIXELS, np.median(base.gain))}
    assert np.array_equal(found.gain, expected[gain])
    expected = {"own": base.dark, "mean": np.full(PIXELS, np.median(base.dark)), "none": np.zeros(PIXELS)}
    assert np.array_equal(found.dark, expected[dark])
    assert found.white == (base.white if white else 0.0)


def test_a_constrained_refit_leaves_no_negative_charge():
    base = made_up_refit()
    base.dark[:3] = -1e-4
    assert constrained_refit(MODEL, base).dark.min() == 0.0


def test_the_level_of_all_pixels_is_the_mean_of_those_that_do_not_differ():
    """Rates between whole frames lie on a lattice, of which their median is a step.  Hot pixels are left out."""
    rng = np.random.default_rng(0)
    level, step = 0.37, 1.0
    lattice = np.floor(level + rng.random(4000)) * step  # 0 or 1, 0.37 on average
    errors = np.full(4000, 0.5)
    assert common_level(lattice, errors) == pytest.approx(level, abs=0.03) and np.median(lattice) == 0.0
    hot = np.where(np.arange(4000) < 20, 1000.0, lattice)
    assert common_level(hot, errors) == pytest.approx(level, abs=0.03)
    spread = 100.0 * rng.standard_normal(4000)
    assert common_level(spread, errors) == np.median(spread)
