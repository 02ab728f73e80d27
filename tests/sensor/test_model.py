"""Models: presets, TOML, effects in order, and one clear error for each fault."""

from __future__ import annotations

import numpy as np
import pytest

from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, Circuit, SensorModel

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
    of_name = {e.name: e for e in whole.effects}
    for kept in (n for n in names if n != removed):
        alone = SensorModel("a", whole.circuit, whole.frame_rate_hz, (of_name[kept],))
        with_removed = alone.with_effect(of_name[removed])
        a, b = alone.draw_unit((8, 8), 3), with_removed.without(removed).draw_unit((8, 8), 3)
        np.testing.assert_array_equal(a.gain, b.gain)


def test_what_is_wrong_is_named_with_what_is_allowed(tmp_path) -> None:
    with pytest.raises(InputError, match=r"unknown preset 'scs'; choose one of ideal, measured, physical, scsim"):
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
        (text.replace("mean_pA = 0.4442", "mean_pA = -1.0"), "dark_current.mean_pA = -1.0; it must be"),
        (text.replace("frame_rate_hz = 40000.0", "frame_rate_hz = -1.0"), "frame_rate_hz"),
        (text.replace("temperature_K = 300.0", 'temperature_K = "warm"'), "temperature_K"),
    ]:
        path = tmp_path / "bad.toml"
        path.write_text(bad)
        with pytest.raises(InputError, match=message):
            SensorModel.from_toml(path)
    with pytest.raises(InputError, match="cannot read model file"):
        SensorModel.from_toml(tmp_path / "absent.toml")


@pytest.mark.parametrize("effect", ["dead_time", CATALOGUE["dead_time"], None, {"tau_us": 1.0}])
def test_what_is_no_effect_is_refused(effect: object) -> None:
    with pytest.raises(InputError, match=r"effect = .* give an instance of its class"):
        SensorModel.preset("scsim").with_effect(effect)  # type: ignore[arg-type]
