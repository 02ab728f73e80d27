"""The fixed pattern, against fresh units of the model."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from small import CLEAR, FRAMES, MODEL, SHAPE, conditions, effect, quiet, recorded

from spikecam_env.gap.statistics import StatisticKey, floor_of, pattern
from spikecam_env.gap.twins.fresh_units import drawn_banks
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.sensor import SensorModel

DRAWS = 40

CASES = [
    (effect("hot_pixels", fraction=0.02, mean_pA=6.0), "dark", "top", "flat-0.65"),
    (effect("dark_current_tail", sigma=1.2), "dark", "high tail", "flat-0.65"),
    (effect("dead_pixels", fraction=0.02), "flat-0.5", "silent", None),
    (effect("row_fixed_pattern", sigma_mV=30.0), "flat-0.5", "rows", None),
    (effect("column_fixed_pattern", sigma_mV=30.0), "flat-0.5", "columns", None),
    (effect("vignetting", falloff=0.1), "flat-0.5", "bowl", "dark"),
]


def deviates_from_units(case) -> dict[StatisticKey, float]:
    """Every pattern statistic against units drawn from the model, Student's t of DRAWS made normal."""
    banks = drawn_banks(MODEL, case.base, case.conditions, case.shape, DRAWS, 11, (0.6, 1.67))
    found = {}
    for key in banks[0]:
        values = np.array([b[key] for b in banks])
        noise = np.hypot(values.std(ddof=1) * np.sqrt(1 + 1 / DRAWS), floor_of(key))
        t = (case.bank[key] - values.mean()) / noise
        found[key] = float(np.sign(t) * stats.norm.isf(stats.t.sf(abs(t), DRAWS - 1)))
    return found


@pytest.mark.parametrize("shown_by, where, name, silent", CASES, ids=lambda v: getattr(v, "name", None))
def test_pattern_reveals(shown_by, where, name, silent):
    z, clean = deviates_from_units(recorded(shown_by)), deviates_from_units(recorded(seed=5))
    key = StatisticKey("pattern", where, name)
    print(f"{where} {name} {z[key]:.1f}, without {clean[key]:.1f}")
    assert abs(z[key]) > CLEAR and abs(clean[key]) < quiet(1)
    if silent:
        alone = {k: abs(v) for k, v in z.items() if k.recording == silent}
        worst = max(alone, key=lambda k: alone[k])
        print(f"left alone: at worst {worst} {alone[worst]:.1f}")
        assert alone[worst] < quiet(len(alone))


def test_nothing_of_the_pattern_of_a_unit_of_the_model_is_off():
    """Six recordings share one pattern, so that this is about 12 independent numbers, not 72."""
    z = deviates_from_units(recorded(seed=5))
    worst = max(z, key=lambda k: abs(z[k]))
    print(f"{worst} {z[worst]:.1f} of {len(z)}")
    assert abs(z[worst]) < quiet(len(z))


def test_a_gaussian_map_has_gaussian_tails():
    """Quantiles 0.995 of 90 000 pixels are known to 2.576 -+ 0.023 spreads, and log to 1 %."""
    rate = np.random.default_rng(0).normal(0.3, 0.01, (300, 300))
    found = pattern.statistics(rate)
    print({k: round(v, 3) for k, v in found.items()})
    assert np.exp(found["width"]) == pytest.approx(1 / 30, rel=0.02)
    assert found["low tail"] == pytest.approx(2.576, abs=0.12)
    assert np.exp(found["high tail"]) == pytest.approx(2.576, abs=0.12)
    assert abs(found["near"]) < 4 / 300 and abs(found["rows"]) < 4 * np.sqrt(2 / 300)


def test_a_dark_map_without_spikes_has_no_pattern():
    assert pattern.statistics(np.zeros(SHAPE)) == {}


def test_a_map_without_a_pattern_has_a_width_and_no_shape():
    """Rates of an ideal pixel, read between two whole frames: spread by 1e-5, in a few steps."""
    steps = np.random.default_rng(0).integers(0, 3, (32, 32))
    found = pattern.statistics(0.2 + 2e-6 * steps)
    assert set(found) == {"width", "silent"} and found == pattern.statistics(np.full((32, 32), 0.2))


def test_pixels_that_fire_once_or_twice_in_the_dark_differ_though_they_are_all_alike():
    """1.6 spikes to be expected of each: four in ten have one and six two, 1 / F and an interval's 1.6 / F."""
    model = SensorModel.preset("ideal").with_effect(effect("dark_current", mean_pA=0.04))
    dark = [c for c in conditions() if c.kind == "dark"]
    one = np.ones(SHAPE[0] * SHAPE[1])
    base = BaseFit(one, 1.6 / FRAMES * one, 0 * one, 0 * one, 0.0, np.zeros((0, one.size)), one > 0)
    banks = drawn_banks(model, base, dark, SHAPE, 4, 0, (0.6, 1.67))
    widths = [np.exp(b[StatisticKey("pattern", "dark", "width")]) for b in banks]
    assert widths == pytest.approx(4 * [0.3 / 1.6], rel=0.1)


@pytest.mark.parametrize("width, narrow", [(3.5e-4, True), (8e-4, False)])
def test_a_map_narrower_than_five_in_ten_thousand_has_no_pattern(width, narrow):
    grid = stats.norm.ppf((np.arange(4096) + 0.5) / 4096)
    rate = 0.2 * (1.0 + width * np.random.default_rng(0).permutation(grid)).reshape(64, 64)
    assert (set(pattern.statistics(rate)) == {"width", "silent"}) == narrow
