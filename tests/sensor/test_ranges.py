"""Every number of a model has a range: outside it is refused by name, inside it both engines end, and agree."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from dataclasses import Field, fields, replace
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from laws import with_effects

from spikecam_env.cli.named import named
from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, Circuit, Effect, SensorModel, SpikeSensor

DECLARED: dict[str, type[Any]] = {"circuit": Circuit, **CATALOGUE}
EVERY_FIELD = [(name, f) for name, cls in DECLARED.items() for f in fields(cls)]
FIELD_NAMES = [f"{name}.{f.name}" for name, f in EVERY_FIELD]
CHOICES = [(name, f) for name, f in EVERY_FIELD if f.metadata["choices"]]
SWITCHES = [(name, f) for name, f in EVERY_FIELD if f.metadata["bounds"] is None and not f.metadata["choices"]]
NUMBERS = [(name, f) for name, f in EVERY_FIELD if f.metadata["bounds"] is not None]

NO_NUMBERS = ["1", b"1", None, True, False, np.True_, [0.3], np.array(0.3), np.array([0.3]), 1j, Decimal(1), object()]
TOO_MUCH = [1e308, -1e308, 10**400, -(10**400), 10**5000, math.nan, -math.inf]

NOISE = {"shot_noise", "reset_noise", "excess_threshold_noise"}
"""Noise that each engine draws in its own way; without it they give the same bits."""


def names(f: tuple[str, Field[Any]]) -> str:
    return f"{f[0]}.{f[1].name}"


@pytest.mark.parametrize("declared", NUMBERS, ids=names)
def test_what_is_no_number_or_out_of_range_is_refused_by_name(declared: tuple[str, Field[Any]]) -> None:
    name, f = declared
    low, high = f.metadata["bounds"]
    beyond = [np.nextafter(low, -np.inf), *([] if math.isinf(high) else [np.nextafter(high, np.inf), math.inf])]
    if f.metadata["largest"] is not None:
        beyond += [2 * f.metadata["largest"], 1e308]
    for bad in (*NO_NUMBERS, *TOO_MUCH, *beyond):
        if bad == 1e308 and math.isinf(high) and f.metadata["largest"] is None:
            continue
        unit = re.escape(f.metadata["unit"])
        bounds = rf"a .*number (from|of at least) {re.escape(f'{low:g}')}.*{unit}(, or inf)?"
        outside = rf"^{name}\.{f.name} = .*; it must be {bounds}$"
        with pytest.raises(InputError, match=outside):
            DECLARED[name](**{f.name: bad})


@pytest.mark.parametrize("declared", SWITCHES, ids=names)
def test_a_switch_is_true_or_false(declared: tuple[str, Field[Any]]) -> None:
    name, f = declared
    for bad in (0, 1, "false", "no", None, 1.0):
        with pytest.raises(InputError, match=rf"{name}\.{f.name} = .*; it must be true or false"):
            DECLARED[name](**{f.name: bad})
    assert getattr(DECLARED[name](**{f.name: np.False_}), f.name) is False


@pytest.mark.parametrize("declared", CHOICES, ids=names)
def test_a_choice_is_one_of_its_names_and_is_written_and_read(declared: tuple[str, Field[Any]], tmp_path) -> None:
    name, f = declared
    for bad in ("", "never", f.default.upper(), 0, 1.0, None, True, [f.default], np.array([f.default, f.default])):
        with pytest.raises(
            InputError, match=rf"unknown {name}\.{f.name} .*; choose one of {sorted(f.metadata['choices'])[0]}"
        ):
            DECLARED[name](**{f.name: bad})
    for good in f.metadata["choices"]:
        model = with_effects("ideal", CATALOGUE[name](**{f.name: good}))
        model.to_toml(tmp_path / "model.toml")
        assert SensorModel.from_toml(tmp_path / "model.toml") == model
        assert named(f"{name}:{f.name}={good}", CATALOGUE, "effect") == model.effects[-1]


def test_numbers_are_kept_plain_so_that_models_compare_and_write() -> None:
    given = {"tau_us": np.float32(0.5)}, {"tau_us": Fraction(1, 2)}, {"tau_us": np.float64(0.5)}
    for one in given:
        assert type(CATALOGUE["dead_time"](**one).tau_us) is float and CATALOGUE["dead_time"](**one).tau_us == 0.5
    assert type(CATALOGUE["afterpulsing"](delay_frames=np.int8(3)).delay_frames) is int
    assert type(CATALOGUE["afterpulsing"](delay_frames=3.0).delay_frames) is int
    assert math.copysign(1.0, CATALOGUE["dead_time"](tau_us=-0.0).tau_us) == 1.0
    model = with_effects("scsim", CATALOGUE["dead_time"](tau_us=np.float32(0.5)))
    assert "tau_us = 0.5" in model.toml()


@pytest.mark.parametrize("rate", [True, "40000", None, 0, -1.0, 0.999, 1e-300, 1.01e6, 10**400, math.nan, math.inf])
def test_a_frame_rate_out_of_range_is_refused(rate: Any) -> None:
    with pytest.raises(InputError, match=r"^frame_rate_hz = .* it must be a number from 1 to 1e\+06 Hz"):
        replace(SensorModel.preset("scsim"), frame_rate_hz=rate)


def test_a_reset_below_the_reference_and_a_swing_of_millivolts_are_refused(tmp_path) -> None:
    """In whatever way the circuit is made."""
    with pytest.raises(InputError, match=r"the swing reset_V - reference_V \+ bias_V = 2 - 2\.2 .* is outside 0\.05"):
        Circuit(reset_V=2.0)
    for swing_mV in (0.0, 1.0, 42.0, 49.9):
        with pytest.raises(InputError, match=r"is outside 0\.05 \.\. 20 V"):
            replace(Circuit(), reset_V=2.2 + 0.0076 + 1e-3 * swing_mV)
    text = SensorModel.preset("scsim").toml().replace("reset_V = 3.3", "reset_V = 2.0")
    (tmp_path / "low.toml").write_text(text)
    (tmp_path / "true.toml").write_text(SensorModel.preset("scsim").toml().replace("40000.0", "true"))
    with pytest.raises(InputError, match="frame_rate_hz = True; it must be a finite number above 0"):
        SensorModel.from_toml(tmp_path / "true.toml")
    with pytest.raises(InputError, match="swing"):
        SensorModel.from_toml(tmp_path / "low.toml")


def of_swing(model: SensorModel, swing_V: float) -> SensorModel:
    c = model.circuit
    return replace(model, circuit=replace(c, reset_V=c.reference_V - c.bias_V + swing_V))


def test_effects_that_together_leave_no_sensor_are_refused() -> None:
    scsim = SensorModel.preset("scsim")
    with pytest.raises(InputError, match=r"spread of swings .*bias_voltage_spread.* is 0\.0497 V; at most 0\.03 V"):
        of_swing(scsim, 0.06)
    rows = CATALOGUE["row_fixed_pattern"](sigma_mV=45.0)
    with pytest.raises(InputError, match="spread of swings"):
        of_swing(scsim, 0.12).with_effect(rows)
    with pytest.raises(InputError, match=r"noise of a reset .* is 141\.421 mV; at most 100 mV, 0\.25 of the swing"):
        strong = [CATALOGUE[name](sigma_mV=100.0) for name in ("reset_noise", "excess_threshold_noise")]
        replace(of_swing(SensorModel.preset("ideal"), 0.4), effects=strong)
    with pytest.raises(InputError, match=r"spread of capacitances .* is 1 fF; at most 0\.5 fF"):
        replace(scsim, circuit=Circuit(capacitance_fF=1.0), effects=(CATALOGUE["capacitor_spread"](sigma_fF=1.0),))


def test_what_is_no_model_is_refused_by_name() -> None:
    ideal, dead_time = SensorModel.preset("ideal"), CATALOGUE["dead_time"]
    for field, bad in (("name", 5), ("circuit", {}), ("effects", (dead_time,)), ("effects", "ab"), ("effects", None)):
        with pytest.raises(InputError, match=field):
            replace(ideal, **{field: bad})
    with pytest.raises(InputError, match="listed more than once"):
        replace(ideal, effects=(dead_time(), dead_time(tau_us=0.2)))


SHAPE, FRAMES = (6, 8), 16


def check_engines_agree(model: SensorModel, seed: int = 0) -> None:
    """Bit for bit without noise; with it, in the mean rate of pixels whose noise is independent, within 5 errors."""
    rng = np.random.default_rng(seed)
    light = np.exp(rng.uniform(np.log(1e-3), np.log(3.0), SHAPE)).astype(np.float32)
    light[rng.random(SHAPE) < 0.2] = 0.0
    chosen = SpikeSensor(model, SHAPE, seed, "auto").step(light, FRAMES)
    reference = SpikeSensor(model, SHAPE, seed, "reference").step(light, FRAMES)
    if not NOISE & {e.name for e in model.effects}:
        np.testing.assert_array_equal(chosen, reference, err_msg=str(model))
        return
    off = chosen.mean(axis=0) - reference.mean(axis=0)
    error = max(off.std() / np.sqrt(off.size), 2e-3)
    assert abs(off.mean()) < 5.0 * error, f"rates differ by {off.mean():.2g} +- {error:.2g}: {model}"


def ends(f: Field[Any]) -> list[Any]:
    if f.metadata["choices"]:
        return list(f.metadata["choices"])
    if f.metadata["bounds"] is None:
        return [False, True]
    return [*f.metadata["bounds"], *([] if f.metadata["largest"] is None else [f.metadata["largest"]])]


@pytest.mark.parametrize("base", ["ideal", "scsim"])
@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_engines_agree_at_the_ends_of_every_range(name: str, base: str) -> None:
    for f in fields(CATALOGUE[name]):
        for end in ends(f):
            check_engines_agree(with_effects(base, CATALOGUE[name](**{f.name: end})))


def drawn(rng: np.random.Generator, name: str) -> Effect:
    """An effect with every parameter at an end of its range or anywhere inside."""
    values: dict[str, Any] = {}
    for f in fields(CATALOGUE[name]):
        if f.metadata["choices"]:
            values[f.name] = str(rng.choice(f.metadata["choices"]))
            continue
        low, *others = ends(f)
        high = min(others[-1], 1e15)
        inside = low + (high - low) * rng.random() ** 4
        values[f.name] = (low, others[0], inside, inside)[rng.integers(4)]
        if isinstance(f.default, (bool, int)):
            values[f.name] = type(f.default)(values[f.name])
    return CATALOGUE[name](**values)


def test_models_drawn_at_random_agree_or_are_refused() -> None:
    """Circuits, frame rates and one to six effects; each is a sensor in both engines, or an InputError."""
    rng = np.random.default_rng(41)
    agreed = refused = 0
    for number in range(80):
        try:
            circuit = Circuit(
                reset_V=rng.uniform(2.0, 4.0),
                capacitance_fF=np.exp(rng.uniform(np.log(0.01), np.log(1e5))),
                temperature_K=rng.choice([1.0, 300.0, 1000.0]),
            )
            rate = rng.choice([1.0, 40_000.0, 1e6])
            base = replace(SensorModel.preset(rng.choice(["ideal", "scsim"])), circuit=circuit, frame_rate_hz=rate)
            effects = [drawn(rng, name) for name in rng.choice(list(CATALOGUE), rng.integers(1, 7), replace=False)]
            model = with_effects_on(base, effects)
        except InputError:
            refused += 1
            continue
        check_engines_agree(model, number)
        agreed += 1
    print(f"{agreed} models agree, {refused} are refused")
    assert agreed > 40 and refused > 0


def with_effects_on(model: SensorModel, effects: list[Effect]) -> SensorModel:
    for effect in effects:
        model = model.with_effect(effect)
    return model


def check_rates(model: SensorModel, level: float = 0.3) -> None:
    """Of 6000 pixels over 100 frames, of one unit, within 4.5 standard errors."""
    shape = (60, 100)
    light = np.full(shape, level, dtype=np.float32)
    fast, reference = (SpikeSensor(model, shape, 3, engine).step(light, 100) for engine in ("fast", "reference"))
    off = fast.mean(axis=0) - reference.mean(axis=0)
    error = max(off.std() / np.sqrt(off.size), 1e-5)
    print(f"{fast.mean():.5f}, reference {reference.mean():.5f}: {off.mean():+.1e} +- {error:.1e}")
    assert abs(off.mean()) < 4.5 * error


@pytest.mark.parametrize("preset", ["scsim", "physical"])
@pytest.mark.parametrize("swing_V", [0.1, 0.12, 0.15, 0.2])
def test_engines_agree_at_small_swings(preset: str, swing_V: float) -> None:
    """At 0.1 V half the swing is the pixels' spread: one in forty is left with a hundredth of it."""
    check_rates(of_swing(SensorModel.preset(preset), swing_V))


@pytest.mark.parametrize("level", [0.05, 0.3, 0.9])
def test_engines_agree_at_the_largest_noise_of_a_spike(level: float) -> None:
    """Reset noise of a quarter of the swing, and the fewest electrons that the fast engine carries."""
    noisy = CATALOGUE["reset_noise"](sigma_mV=100.0)
    model = of_swing(SensorModel.preset("ideal"), 0.4).with_effect(noisy)
    check_rates(model, level)
    check_rates(model.with_effect(CATALOGUE["shot_noise"](quanta=20.0)), level)


LOOPED_FOR_EVER = """
import numpy as np
from dataclasses import replace
from spikecam_env.sensor import CATALOGUE as E, SensorModel, SpikeSensor
ideal = SensorModel.preset("ideal")
wide = ideal.with_effect(E["bias_voltage_spread"](sigma_V=0.5))
for model in (
    ideal.with_effect(E["threshold_flicker_noise"](sigma_mV=50.0, octaves=24)),
    wide.with_effect(E["common_threshold_noise"](sigma_mV=100.0)),
    wide.with_effect(E["frame_threshold_noise"](sigma_mV=100.0)),
    wide.with_effect(E["common_threshold_noise"](sigma_mV=100.0)).with_effect(
        E["incomplete_reset"](fraction=0.5, tau_us=0.1)
    ),
    replace(ideal.with_effect(E["random_telegraph_noise"](amplitude_pA=1e4, fraction=1.0)), frame_rate_hz=1.0),
):
    streams = [SpikeSensor(model, (20, 25), 1, e).step(np.full((20, 25), 0.3), 100) for e in ("fast", "reference")]
    assert np.array_equal(*streams)
    print(model.effects[-1].name, streams[0].mean())
"""


def test_no_reference_that_falls_below_the_reset_makes_a_loop_without_end() -> None:
    """Noise of comparators larger than a pixel's swing, also where a reset leaves more than such a reference takes, and
    a dark current of two million thresholds a frame."""
    done = subprocess.run([sys.executable, "-c", LOOPED_FOR_EVER], timeout=300, capture_output=True, text=True)
    print(done.stdout)
    assert done.returncode == 0, done.stderr
