"""The base refit: a unit's own response, dark level and jitter from its recordings."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from small import MODEL, SHAPE, effect, recorded, unit

from spikecam_env.gap.observe.observation import DIFFERENCES
from spikecam_env.gap.unit.refit import (
    LINES,
    BaseFit,
    common_level,
    constrained_refit,
    exact_refit,
    free_refit,
    noisy_pixels,
    unit_from_refit,
)
from spikecam_env.sensor import CATALOGUE, SensorModel

PIXELS = SHAPE[0] * SHAPE[1]
IDEAL = SensorModel.preset("ideal")


def made_up(white: float = 1e-4) -> BaseFit:
    rng = np.random.default_rng(0)
    zero = np.zeros(PIXELS)
    gain, dark = 1 + 0.05 * rng.standard_normal(PIXELS), 0.004 + 0.001 * rng.random(PIXELS)
    return BaseFit(gain, dark, zero, zero, white, np.zeros((0, PIXELS)), np.ones(PIXELS, bool))


def model_with(*names: str) -> SensorModel:
    model = IDEAL
    for name in names:
        model = model.with_effect(CATALOGUE[name]())
    return model


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
def test_jitter_is_found_without_being_told_its_parts(kappa_mV, electrons):
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


def test_within_an_ideal_model_keeps_the_mean_gain_and_nothing_else():
    base = made_up()
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
def test_within_keeps_what_the_model_has_effects_for(names, gain, dark, white):
    base = made_up()
    found = constrained_refit(model_with(*names), base)
    expected = {"own": base.gain, "mean": np.full(PIXELS, np.median(base.gain))}
    assert np.array_equal(found.gain, expected[gain])
    expected = {"own": base.dark, "mean": np.full(PIXELS, np.median(base.dark)), "none": np.zeros(PIXELS)}
    assert np.array_equal(found.dark, expected[dark])
    assert found.white == (base.white if white else 0.0)


def test_within_leaves_no_negative_charge():
    base = made_up()
    base.dark[:3] = -1e-4
    assert constrained_refit(MODEL, base).dark.min() == 0.0


@pytest.mark.parametrize(
    "names, white",
    [
        (["shot_noise", "reset_noise"], 1e-4),
        (["shot_noise", "reset_noise"], 1e-6),
        (["shot_noise"], 1e-4),
        (["reset_noise"], 1e-4),
        (["shot_noise", "excess_threshold_noise"], 1e-3),
        ([], 0.0),
        (["shot_noise"], 0.0),
    ],
    ids=lambda v: "+".join(v) or "ideal" if isinstance(v, list) else None,
)
def test_unit_splits_jitter_into_shot_and_reset_noise(names, white):
    """N as the model says and the rest kappa^2; a smaller s^2, or a model without reset noise, is all shot noise."""
    model = model_with(*names)
    law = unit_from_refit(model, constrained_refit(model, made_up(white)), SHAPE)
    inverse = 1 / law.electrons[0] if law.shot else 0.0
    print(f"1/N {inverse:.2e}, kappa^2 {law.kappa[0] ** 2:.2e}")
    assert inverse + law.kappa[0] ** 2 == pytest.approx(white, rel=1e-9, abs=1e-15)
    if "shot_noise" not in names:
        assert not law.shot
    elif len(names) == 2 and white > 1e-5:
        assert law.electrons[0] == pytest.approx(CATALOGUE["shot_noise"]().quanta)
    else:
        assert law.kappa[0] < 1e-9


def test_unit_has_the_maps_of_the_refit():
    base = made_up()
    law = unit_from_refit(MODEL, constrained_refit(MODEL, base), SHAPE)
    assert np.array_equal(law.gain, base.gain) and np.array_equal(law.dark, base.dark)


def test_a_slow_pixel_has_as_much_larger_a_swing_as_slow_pixels_of_the_model_have():
    """Regression of log swing on log gain, over 16 384 drawn pixels: at one V_d no single pixel's swing is known."""
    shape = (128, 128)
    true = MODEL.draw_unit(shape, 3)
    law = unit_from_refit(MODEL, exact_refit(true), shape)
    x = np.log(true.gain / np.median(true.gain))
    slopes = [np.polyfit(x, np.log(swing), 1)[0] for swing in (true.swing_V, law.swing_V)]
    print(slopes)
    assert slopes[0] < -0.2 and slopes[1] == pytest.approx(slopes[0], abs=0.03)
    without = unit_from_refit(MODEL.without("bias_voltage_spread"), exact_refit(true), shape)
    assert np.ptp(without.swing_V) == 0.0


@pytest.mark.parametrize("lines", [(), ("row_fixed_pattern",), ("column_fixed_pattern",)], ids=str)
def test_noise_follows_the_swing_as_in_drawn_units_and_is_the_refits_in_the_mean(lines):
    """Regressions on log gain: a fast pixel of a small swing has fewer electrons, and a millivolt is more to it."""
    shape = (256, 256)
    model = MODEL
    for name in lines:
        model = model.with_effect(effect(name, sigma_mV=100.0))
    true = model.draw_unit(shape, 3)
    base = exact_refit(true)
    law = unit_from_refit(model, base, shape)
    assert np.mean(1 / law.electrons + law.kappa**2) == pytest.approx(base.white, rel=1e-9)
    x = np.log(true.gain / np.median(true.gain))
    for what in ("electrons", "kappa"):
        slopes = [np.polyfit(x, np.log(getattr(unit, what)), 1)[0] for unit in (true, law)]
        print(what, slopes)
        assert abs(slopes[0]) > 0.2 and slopes[1] == pytest.approx(slopes[0], abs=0.04)


@pytest.mark.parametrize("name", ["row_fixed_pattern", "column_fixed_pattern"])
def test_the_swing_of_a_whole_line_is_all_of_its_response(name):
    """Pixels of a line differ by other things too, their median hardly: its swing within 3 % of the drawn, and 5 %
    off where a share of every pixel's response was taken for swing."""
    shape = (64, 64)
    model = MODEL.with_effect(effect(name, sigma_mV=100.0))
    true = model.draw_unit(shape, 4)
    law = unit_from_refit(model, exact_refit(true), shape)
    axis = LINES[name]
    lines = [np.median(unit.swing_V.reshape(shape), axis=axis) for unit in (true, law)]
    off = (lines[1] / np.median(lines[1])) / (lines[0] / np.median(lines[0])) - 1.0
    print(f"{np.abs(off).max():.3f} of lines that differ by {np.ptp(lines[0]) / np.median(lines[0]):.2f}")
    assert np.ptp(lines[0]) / np.median(lines[0]) > 0.3
    assert np.abs(off).max() < 0.03


def test_what_all_pixels_have_is_the_mean_of_those_that_do_not_differ():
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


@pytest.mark.parametrize("errors, counted", [(3.5, True), (7.0, False)])
def test_pixels_within_five_errors_of_most_share_their_level(errors, counted):
    """A third of the pixels lies so many standard errors above the others."""
    values = np.where(np.arange(90) < 30, errors, 0.0)
    assert common_level(values, np.ones(90)) == pytest.approx(errors / 3 if counted else 0.0)


@pytest.mark.parametrize("times, noisy", [(2.2, False), (4.5, True)])
def test_a_pixel_of_three_times_the_usual_noise_is_left_out_of_the_jitter(times, noisy):
    square = np.ones((100, len(DIFFERENCES))) * 50.0
    square[7] *= times
    seen = SimpleNamespace(square=square, terms=np.full(square.shape, 50), rate=np.full(100, 0.2))
    found = noisy_pixels(SimpleNamespace(times=seen, irregular=np.zeros(100, bool)))
    assert found[7] == noisy and not np.delete(found, 7).any()
