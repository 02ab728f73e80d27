"""From a refit to a unit that can be simulated."""

from __future__ import annotations

import numpy as np
import pytest
from made_up_refit import made_up_refit, model_with
from small import MODEL, SHAPE, effect

from spikecam_env.gap.unit.conversion import LINES, exact_refit, unit_from_refit
from spikecam_env.gap.unit.refit import constrained_refit
from spikecam_env.sensor import CATALOGUE


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
    law = unit_from_refit(model, constrained_refit(model, made_up_refit(white)), SHAPE)
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
    base = made_up_refit()
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
