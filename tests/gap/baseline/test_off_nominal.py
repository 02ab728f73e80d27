"""Whether the model's own parameters are those of the unit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small import MODEL, effect, recorded

from spikecam_env.gap.baseline.off_nominal import off_nominal, with_strengths
from spikecam_env.gap.settings import UnitSettings
from spikecam_env.gap.twins.fresh_units import width
from spikecam_env.gap.unit.conversion import exact_refit
from spikecam_env.sensor import CATALOGUE, SensorModel

SHAPE = (128, 128)


def base_of(*effects):
    """A unit of the model with other strengths."""
    model = MODEL
    for e in effects:
        model = model.with_effect(e)
    return exact_refit(model.draw_unit(SHAPE, 5))


@pytest.mark.parametrize(
    "other",
    [
        effect("reset_noise", sigma_mV=25.0),
        effect("shot_noise", quanta=10_000.0),
        effect("dark_current", mean_pA=1.5),
        effect("dark_current_spread", sigma_pA=0.05),
    ],
    ids=lambda e: e.name,
)
def test_a_strength_that_is_off_is_measured_in_its_own_unit(other):
    """Noise beyond shot noise is stated as reset noise: at one V_d the two are the same."""
    off = off_nominal(recorded(), MODEL, base_of(other)).parameters
    print(off)
    name = "reset_noise" if other.name == "shot_noise" else other.name
    row = off[name]
    assert row["nominal"] == next(e for e in MODEL.effects if e.name == name).parameters()[type(other).strength
                                  if name == other.name else "sigma_mV"]  # fmt: skip
    if name == other.name:
        assert row["measured"] == pytest.approx(other.parameters()[type(other).strength], rel=0.1)
    patched = next(e for e in with_strengths(MODEL, off).effects if e.name == name)
    assert patched.parameters()[type(patched).strength] == row["measured"]


@pytest.mark.parametrize(("level", "off"), [(1.0, False), (0.5, True), (1.5, False), (5.0, True)])
def test_dark_levels_of_another_distribution_are_off_if_their_middle_and_their_mean_are(level, off):
    """Gamma of a unit's mean and 1.5 of it in standard deviation: its median is two fifths of its mean."""
    unit = base_of()
    dark = np.random.default_rng(0).gamma(1 / 2.25, 2.25 * level * unit.dark.mean(), unit.dark.size)
    assert np.median(dark) < np.median(unit.dark) * level / UnitSettings().usual
    found = off_nominal(recorded(), MODEL, replace(unit, dark=dark)).parameters
    assert ("dark_current" in found) == off


def test_less_noise_than_shot_noise_is_more_electrons():
    quiet = base_of(effect("shot_noise", quanta=2e5), effect("reset_noise", sigma_mV=0.5))
    off = off_nominal(recorded(), MODEL, quiet).parameters
    assert list(off) == ["shot_noise"] and off["shot_noise"]["ratio"] > 2


@pytest.mark.parametrize(("times", "off"), [(1.0, False), (1.2, False), (1.45, True)])
def test_noise_is_off_where_units_20_percent_off_do_not_reach(times, off):
    """Electrons a fifth fewer and a fifth more millivolts are a unit's; half as many millivolts again are none's."""
    noisy = base_of(effect("shot_noise", quanta=50_000 / min(times, 1.2)), effect("reset_noise", sigma_mV=6.36 * times))
    assert bool(off_nominal(recorded(), MODEL, noisy).parameters) == off


def test_all_spreads_of_the_response_are_off_together_and_the_nominal_unit_has_the_models():
    wide = base_of(effect("conversion_gain_spread", sigma=0.2), effect("bias_voltage_spread", sigma_V=0.17))
    off = off_nominal(recorded(), MODEL, wide)
    assert {"conversion_gain_spread", "bias_voltage_spread"} <= set(off.parameters)
    assert off.parameters["conversion_gain_spread"]["measured"] == pytest.approx(0.2, rel=0.1)
    assert width(off.nominal.gain) == pytest.approx(width(base_of().gain), rel=0.1)


def test_a_unit_as_the_model_has_it_is_not_off():
    usual = base_of()
    off = off_nominal(recorded(), MODEL, usual)
    assert off.parameters == {} and off.nominal is usual
    assert with_strengths(MODEL, off.parameters) == MODEL


@pytest.mark.parametrize("preset", ["scsim", "physical", "measured"])
def test_any_strength_of_a_preset_may_be_patched(preset):
    """Other parameters stay, booleans too."""
    model = SensorModel.preset(preset)
    for e in model.effects:
        key = CATALOGUE[e.name].strength
        if key is None:
            continue
        patched = with_strengths(model, {e.name: {"measured": e.parameters()[key]}})
        assert next(p for p in patched.effects if p.name == e.name).parameters() == e.parameters()
