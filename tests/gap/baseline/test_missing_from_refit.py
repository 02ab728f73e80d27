"""Effects of the base pixel that a model lacks, from `ideal` on data of `physical` and `scsim`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small import SHAPE, effect, recorded, unit

from spikecam_env.gap import Dark, Flat
from spikecam_env.gap.baseline.missing_from_refit import LEAST_SPREAD, missing_effects
from spikecam_env.gap.observe.conditions import planned_conditions
from spikecam_env.gap.observe.observation import observe
from spikecam_env.gap.twins.case import case_of
from spikecam_env.gap.twins.simulate import expose
from spikecam_env.gap.unit.conversion import unit_from_refit
from spikecam_env.sensor import CATALOGUE, SensorModel

NAMES = tuple(CATALOGUE)
IDEAL = SensorModel.preset("ideal")
PIXELS = SHAPE[0] * SHAPE[1]


def lacking(model: SensorModel, assumed: SensorModel = IDEAL, names=NAMES):
    found = {m.effect.name: m for m in missing_effects(recorded(model=model), assumed, names)}
    for m in found.values():
        print(f"{m.effect} +- {m.sd:.2g}; also {m.also}")
    return found


@pytest.mark.parametrize("preset", ["physical", "scsim"])
def test_from_ideal_the_base_effects_are_found_with_their_values(preset):
    """The gain's spread is that of three effects together; s^2 of two.  1024 pixels give spreads to 2.2 % (1 sd)."""
    model = SensorModel.preset(preset)
    true = {e.name: e for e in model.effects}
    found = lacking(model)
    assert list(found) == ["conversion_gain_spread", "dark_current", "dark_current_spread", "shot_noise"]
    circuit = model.circuit
    parts = [
        true["conversion_gain_spread"].sigma,
        true["capacitor_spread"].sigma_fF / circuit.capacitance_fF,
        true["bias_voltage_spread"].sigma_V / circuit.swing_V,
    ]
    whole = float(np.sqrt(np.sum(np.square(parts))))
    assert found["conversion_gain_spread"].effect.sigma == pytest.approx(whole, rel=4 / np.sqrt(2 * PIXELS))
    dark = true["dark_current"].mean_pA
    spread = true["dark_current_spread"].sigma_pA
    assert found["dark_current"].effect.mean_pA == pytest.approx(dark, abs=5 * spread / np.sqrt(PIXELS))
    assert found["dark_current_spread"].effect.sigma_pA == pytest.approx(spread, rel=0.15)
    kappa = true["reset_noise"].sigma_mV * 1e-3 / circuit.swing_V
    white = 1 / true["shot_noise"].quanta + kappa**2
    assert found["shot_noise"].effect.quanta == pytest.approx(1 / white, rel=0.05)


@pytest.mark.parametrize("preset", ["physical", "scsim"])
def test_a_model_with_its_effects_lacks_none(preset):
    model = SensorModel.preset(preset)
    assert lacking(model, model) == {}


def test_an_ideal_camera_lacks_nothing():
    assert lacking(IDEAL) == {}


@pytest.mark.parametrize(
    "name, parameters, tolerance",
    [
        ("conversion_gain_spread", {"sigma": 0.03}, 4 / np.sqrt(2 * PIXELS)),
        ("dark_current", {"mean_pA": 0.5}, 0.02),
    ],
)
def test_one_effect_alone_is_found_alone(name, parameters, tolerance):
    found = lacking(IDEAL.with_effect(effect(name, **parameters)))
    assert list(found) == [name]
    ((key, value),) = parameters.items()
    assert getattr(found[name].effect, key) == pytest.approx(value, rel=tolerance)


def test_shot_noise_beside_a_spread_is_found_with_its_size():
    """A spread, so that intervals are no whole number of frames: of those no noise is seen."""
    model = IDEAL.with_effect(effect("conversion_gain_spread", sigma=0.03)).with_effect(
        effect("shot_noise", quanta=2e4)
    )
    found = lacking(model)
    assert list(found) == ["conversion_gain_spread", "shot_noise"]
    assert found["shot_noise"].effect.quanta == pytest.approx(2e4, rel=0.05)


def test_dark_levels_that_differ_by_their_errors_alone_are_no_spread():
    """However far their median, all but none, is from their mean: of pixels without a dark level neither is a scale."""
    case = recorded(model=IDEAL.with_effect(effect("conversion_gain_spread", sigma=0.03)))
    errors = np.random.default_rng(3).normal(0.0, 5e-7, PIXELS)
    errors -= np.median(errors)
    for middle in (1e-12, 1e-9, 1e-7):
        dark = np.where(errors > 0, 1.1, 1.0) * errors + middle
        base = replace(case.base, dark=dark, dark_sd=np.full(PIXELS, 5e-7))
        found = [m.effect.name for m in missing_effects(replace(case, base=base), IDEAL, NAMES)]
        assert found == ["conversion_gain_spread"]


def test_dark_levels_that_are_not_known_alike_are_no_spread():
    """Of equal pixels that fire once or twice in the dark, two fifths have no rate there: thirty times the error."""
    case, rng = recorded(model=IDEAL.with_effect(effect("dark_current", mean_pA=0.1))), np.random.default_rng(0)
    sd = np.where(np.arange(PIXELS) % 5 < 2, 6e-7, 2e-8)
    base = replace(case.base, dark=2e-4 + sd * rng.standard_normal(PIXELS), dark_sd=sd)
    found = [m.effect.name for m in missing_effects(replace(case, base=base), IDEAL, NAMES)]
    assert found == ["dark_current"]


def test_only_candidates_are_added():
    found = lacking(SensorModel.preset("scsim"), names=("dark_current", "shot_noise"))
    assert list(found) == ["dark_current", "shot_noise"]


def test_effects_that_one_voltage_does_not_separate_are_listed():
    found = lacking(SensorModel.preset("scsim"))
    assert set(found["conversion_gain_spread"].also) == {"bias_voltage_spread", "capacitor_spread"}
    assert "reset_noise" in found["shot_noise"].also


@pytest.mark.parametrize("quanta", [np.inf, 2e6])
def test_noise_that_twins_without_it_seem_to_have_is_not_missing(quanta):
    """Equal pixels at rates where they beat with the read-out's clock as if they had 3.5 million electrons' noise."""
    camera = IDEAL if np.isinf(quanta) else IDEAL.with_effect(effect("shot_noise", quanta=quanta))
    flats = (0.008892, 0.026286, 0.07269, 0.16783, 0.34862, 0.54416)
    shown = planned_conditions((Dark(), *(Flat(radiance=radiance) for radiance in flats)), SHAPE, 8000)
    law = unit_from_refit(camera, unit(camera), SHAPE)
    seen_by = [observe(expose(camera, law, c, SHAPE, 1, take), SHAPE, film=False) for take, c in enumerate(shown)]
    case = case_of(SHAPE, shown, seen_by, 1)
    print(f"s^2 of the refit {case.base.white:.3g}, of the camera {1 / quanta:.3g}")
    assert case.base.white > LEAST_SPREAD**2
    assert [m.effect.name for m in missing_effects(case, IDEAL, NAMES)] == ([] if np.isinf(quanta) else ["shot_noise"])
