"""Models: presets, TOML, effects in order, and one clear error for what is wrong."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, Circuit, SensorModel, SpikeSensor

PRESETS = ("ideal", "scsim", "physical")


@pytest.mark.parametrize("name", PRESETS)
def test_toml_round_trip_is_exact(name, tmp_path) -> None:
    model = SensorModel.preset(name)
    model.to_toml(tmp_path / "model.toml")
    assert SensorModel.load(tmp_path / "model.toml") == model
    assert [p.name for p in tmp_path.iterdir()] == ["model.toml"]


def test_script_option_is_the_public_script() -> None:
    script = SensorModel.preset("scsim", script=True)
    assert {"dead_time", "frame_threshold_noise"} <= {e.name for e in script.effects}
    with pytest.raises(InputError, match="scsim"):
        SensorModel.preset("physical", script=True)


def test_physical_constants_follow_from_the_circuit() -> None:
    circuit = Circuit()
    effects = {e.name: e for e in SensorModel.preset("physical").effects}
    assert effects["shot_noise"].quanta == pytest.approx(circuit.threshold_electrons, rel=1e-4)
    assert effects["reset_noise"].sigma_mV == pytest.approx(circuit.thermal_noise_mV, rel=1e-3)
    assert circuit.threshold_electrons == pytest.approx(29_650, rel=1e-3)


def test_effects_stand_in_physical_order_whatever_the_order_given() -> None:
    effects = SensorModel.preset("scsim").effects
    shuffled = SensorModel("x", Circuit(), 40_000.0, effects[::-1])
    assert shuffled.effects == effects
    assert [e.stage for e in effects] == sorted(e.stage for e in effects)


@pytest.mark.parametrize("removed", [e.name for e in SensorModel.preset("scsim").effects])
def test_removing_one_effect_leaves_the_fixed_pattern_of_the_others(removed: str) -> None:
    whole = SensorModel.preset("scsim")
    names = ("conversion_gain_spread", "dark_current_spread", "capacitor_spread", "bias_voltage_spread")
    for kept in (n for n in names if n != removed):
        alone = SensorModel("a", whole.circuit, whole.frame_rate_hz, tuple(e for e in whole.effects if e.name == kept))
        with_removed = alone if removed == kept else alone.with_effect(_effect(whole, removed))
        a, b = alone.draw_unit((8, 8), 3), with_removed.without(removed).draw_unit((8, 8), 3)
        np.testing.assert_array_equal(a.gain, b.gain)


def _effect(model: SensorModel, name: str):
    return next(e for e in model.effects if e.name == name)


ZERO_STRENGTH = {
    "conversion_gain_spread": {"sigma": 0.0},
    "dark_current": {"mean_pA": 0.0},
    "dark_current_spread": {"sigma_pA": 0.0},
    "capacitor_spread": {"sigma_fF": 0.0},
    "bias_voltage_spread": {"sigma_V": 0.0},
    "reset_noise": {"sigma_mV": 0.0},
    "frame_threshold_noise": {"sigma_mV": 0.0},
    "synchronous_reset": {"fraction": 0.0},
    "dead_time": {"tau_us": 0.0},
}


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_strength_zero_changes_no_bit(name: str) -> None:
    light = np.random.default_rng(0).uniform(0, 1.2, (12, 12)).astype(np.float32)
    ideal = SensorModel.preset("ideal")
    expected = SpikeSensor(ideal, (12, 12), 4, engine="reference").step(light, 200)
    if name == "shot_noise":
        # Its zero is infinitely many electrons; at 1e9 the charge of 200 frames is off by 1e-3 of a threshold at most.
        model = ideal.with_effect(CATALOGUE[name](quanta=1e9))
        different = SpikeSensor(model, (12, 12), 4, engine="reference").step(light, 200) != expected
        assert different.mean() < 2e-3
        return
    model = ideal.with_effect(CATALOGUE[name](**ZERO_STRENGTH[name]))
    np.testing.assert_array_equal(SpikeSensor(model, (12, 12), 4, engine="reference").step(light, 200), expected)


def test_spreads_are_the_stated_ones() -> None:
    """Standard deviations over 40 000 pixels, within four standard errors sigma / sqrt(2 n)."""
    base = SensorModel.preset("ideal").with_effect(CATALOGUE["dark_current"](mean_pA=2.0))
    dark = 2.0e-12 / 40_000 / (base.circuit.capacitance_fF * 1e-15 * base.circuit.swing_V)
    expected = {
        "conversion_gain_spread": (0.0584 / 1.0128, lambda u: u.gain),
        "dark_current_spread": (0.1731 / 2.0, lambda u: u.dark / dark),
        "capacitor_spread": (0.0128 / 4.348, lambda u: 1 / u.gain),
        "bias_voltage_spread": (0.0497 / 1.0924, lambda u: 1 / u.gain),
    }
    for name, (sigma, read) in expected.items():
        values = read(base.with_effect(CATALOGUE[name]()).draw_unit((200, 200), 0))
        print(f"{name}: {values.std():.5f}, expected {sigma:.5f}")
        assert abs(values.std() - sigma) < 4 * sigma / np.sqrt(2 * values.size)


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_every_effect_is_documented_and_bounded(name: str) -> None:
    effect = CATALOGUE[name]
    doc = __import__(effect.__module__, fromlist=["_"]).__doc__
    assert "Stage:" in doc and "Seen in:" in doc and "Source:" in doc
    for f in fields(effect):
        assert f.metadata["doc"]
        if f.metadata["bounds"]:
            with pytest.raises(InputError, match=f"{name}.{f.name}"):
                effect(**{f.name: f.metadata["bounds"][1] * 2 + 1})
            with pytest.raises(InputError):
                effect(**{f.name: float("nan")})


def test_what_is_wrong_is_named_with_what_is_allowed(tmp_path) -> None:
    with pytest.raises(InputError, match=r"unknown preset 'scs'; choose one of ideal, physical, scsim"):
        SensorModel.preset("scs")
    with pytest.raises(InputError, match="shot_nois"):
        SensorModel.preset("scsim").without("shot_nois")
    good = tmp_path / "model.toml"
    SensorModel.preset("scsim").to_toml(good)
    text = good.read_text()
    for bad, message in [
        ("[[effect]", "not a TOML file"),
        (text.replace("spikecam-model/1", "other/1"), "expected 'spikecam-model/1'"),
        (text.replace('"dark_current"', '"dark_curent"'), "unknown effect 'dark_curent'"),
        (text.replace("mean_pA", "mean_nA"), "mean_nA"),
        (text.replace("mean_pA = 0.4442", "mean_pA = -1.0"), "dark_current.mean_pA = -1.0 is outside"),
        (text.replace("frame_rate_hz = 40000.0", "frame_rate_hz = -1.0"), "frame_rate_hz"),
        (text.replace("temperature_K = 300.0", 'temperature_K = "warm"'), "temperature_K"),
    ]:
        path = tmp_path / "bad.toml"
        path.write_text(bad)
        with pytest.raises(InputError, match=message):
            SensorModel.from_toml(path)
    with pytest.raises(InputError, match="cannot read model file"):
        SensorModel.from_toml(tmp_path / "absent.toml")
