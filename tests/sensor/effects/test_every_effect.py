"""Duties of every effect of the catalogue, by its declaration alone."""

from __future__ import annotations

import importlib
import math
import pickle
import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from laws import camera, population, with_effects

from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, Keyframes, SensorModel, SpikeSensor
from spikecam_env.sensor.effect_sheet import SECTIONS, Sheet
from spikecam_env.sensor.effects.base import Charge, Few
from spikecam_env.sensor.engines.compiled import block
from tools import effects_page

SHAPE = (10, 12)
FRAMES = 64
"""Enough for every effect to show at a strong level."""
FEW_PIXELS = (4, 5)
"""For the effects of which the reference takes the events within a frame one by one, in Python."""
BY_EVENTS = {"clock_feedthrough", "crosstalk", "supply_ripple"}
EVERY = sorted(CATALOGUE)


def moving_light(brightest: float = 1.2, shape: tuple[int, int] = SHAPE) -> Keyframes:
    """Light of all levels that moves, some of it dark, some saturated."""
    keys = np.arange(0, FRAMES + 1, 16)
    light = np.random.default_rng(0).uniform(-0.1, brightest, (keys.size, *shape))
    return Keyframes(keys, np.maximum(light, 0.0))


def stream(model: SensorModel, engine: str = "reference") -> np.ndarray:
    return SpikeSensor(model, SHAPE, 4, engine).step(moving_light(), FRAMES)


@pytest.mark.parametrize("base", ["ideal", "scsim"])
@pytest.mark.parametrize("name", EVERY)
def test_strength_zero_changes_no_bit(name: str, base: str) -> None:
    model = SensorModel.preset(base)
    if base == "scsim" and name in {e.name for e in model.effects}:
        model = model.without(name)
    neutral = model.with_effect(CATALOGUE[name].neutralised())
    np.testing.assert_array_equal(stream(neutral), stream(model))
    if CATALOGUE[name].is_fixed():
        np.testing.assert_array_equal(stream(neutral, "fast"), stream(model, "fast"))
    elif base == "ideal":
        np.testing.assert_array_equal(stream(neutral, "fast"), stream(model))


def test_all_effects_at_strength_zero_together_change_no_bit() -> None:
    """Nor do they draw from the base model's noise, which each has a generator of its own to spare."""
    scsim = SensorModel.preset("scsim")
    others = [e.neutralised() for e in CATALOGUE.values() if e.name not in {own.name for own in scsim.effects}]
    np.testing.assert_array_equal(stream(with_effects("scsim", *others)), stream(scsim))


def strong(name: str):
    """The effect at a strength that shows in a few frames: 400 times the default, up to half its bound."""
    effect = CATALOGUE[name]
    bounds = {f.name: f.metadata["bounds"] for f in fields(effect)}[effect.strength]
    if math.isinf(effect.neutral):
        return effect(**{effect.strength: 50.0})
    default = getattr(effect(), effect.strength)
    return effect(**{effect.strength: min(400 * abs(default), bounds[1] / 2)})


@pytest.mark.parametrize("engine", ["reference", "fast"])
@pytest.mark.parametrize("name", EVERY)
def test_strong_effect_changes_bits_the_same_however_cut_saved_and_restored(name: str, engine: str) -> None:
    if block.missing([strong(name)]):
        engine = "reference"
    shape = FEW_PIXELS if name in BY_EVENTS and engine == "reference" else SHAPE
    model = with_effects("scsim", strong(name))
    light = moving_light(brightest=3.0, shape=shape)
    whole = SpikeSensor(model, shape, 4, engine).step(light, FRAMES)
    assert not np.array_equal(whole, SpikeSensor("scsim", shape, 4, engine).step(light, FRAMES))
    sensor = SpikeSensor(model, shape, 4, engine)
    parts = [sensor.step(light, n) for n in (1, 1, 10, 5, 15)]
    state = pickle.loads(pickle.dumps(sensor.state()))
    rest = sensor.step(light, FRAMES // 2)
    np.testing.assert_array_equal(np.concatenate([*parts, rest]), whole)
    other = SpikeSensor(model, shape, 99, engine)
    other.restore(state)
    np.testing.assert_array_equal(other.step(light, FRAMES // 2), rest)
    sensor.restore(state)
    np.testing.assert_array_equal(sensor.step(light, FRAMES // 2), rest)
    sensor.reset()
    np.testing.assert_array_equal(sensor.step(light, FRAMES), whole)


def test_charge_of_a_few_pixels_is_as_if_all_were_written_out() -> None:
    """Beside charge that stays it is kept apart; beside charge that moves, or that others get too, it is added."""
    rng, frames = np.random.default_rng(0), 3
    still, moving = rng.random((1, *SHAPE)), rng.random((frames, *SHAPE))
    few = Few(np.array([0, 3, SHAPE[1] + 1]), rng.random((frames, 3)))
    besides = np.zeros((frames, *SHAPE))
    besides.reshape(frames, -1)[:, few.pixels] = few.charge
    factor = rng.random((frames, 1, 1))
    apart = Charge(still).plus(few)
    assert apart.pixels is still and np.array_equal(apart.values, still + besides)
    assert np.array_equal(apart.scaled(factor).values, (still + besides) * factor)
    assert np.array_equal(apart.plus(few).values, still + besides + besides)
    assert np.array_equal(Charge(moving).plus(few).values, moving + besides)
    assert np.array_equal(Charge(still, factor).plus(few).values, still * factor + besides)


def test_all_effects_at_once_are_one_stream_however_cut() -> None:
    model = with_effects("scsim", *(strong(name) for name in EVERY))
    light = moving_light()
    whole = SpikeSensor(model, SHAPE, 4, "auto").step(light, FRAMES)
    sensor = SpikeSensor(model, SHAPE, 4, "auto")
    np.testing.assert_array_equal(np.concatenate([sensor.step(light, n) for n in (7, 1, 40, 16)]), whole)
    assert 0.01 < whole.mean() < 0.99


@pytest.mark.parametrize("lit", ["moving", "steady"])
@pytest.mark.parametrize("name", EVERY)
def test_fast_engine_gives_the_bits_of_the_reference_without_noise(name: str, lit: str) -> None:
    """Every pixel different, in moving light up to saturation and in steady light; strong effects."""
    patterns = ("conversion_gain_spread", "dark_current", "dark_current_spread", "bias_voltage_spread")
    others = [CATALOGUE[other]() for other in patterns if other != name]
    model = with_effects("ideal", *others, strong(name))
    for temporal in {"shot_noise", "reset_noise", "excess_threshold_noise"} & {name}:
        model = model.without(temporal)
    light = moving_light(3.0) if lit == "moving" else np.random.default_rng(2).uniform(0, 1.3, SHAPE)
    fast, reference = (SpikeSensor(model, SHAPE, 4, engine).step(light, FRAMES) for engine in ("auto", "reference"))
    assert SpikeSensor(model, SHAPE, engine="auto").engine == "fast"
    np.testing.assert_array_equal(fast, reference)


@pytest.mark.parametrize("name", EVERY)
def test_is_documented(name: str) -> None:
    effect = CATALOGUE[name]
    sheet = Sheet.of(effect)
    assert {"Stage", "Seen in", "Source"} <= set(sheet.sections) <= set(SECTIONS)
    assert sheet.sections["Stage"].rstrip(".").replace("-", "").upper() == effect.stage.name
    assert all(f.metadata["doc"] and f.metadata["unit"] is not None for f in fields(effect))
    assert effect.acts is not None, f"{name} does not declare how it acts within a frame (`acts`)"
    assert sheet.sections.get("Within a frame", "").startswith(effect.acts.value)
    if "Twins" in sheet.sections:
        assert sheet.twins and name not in sheet.twins


@pytest.mark.parametrize("name, parameter", [("afterpulsing", "delay_frames"), ("threshold_flicker_noise", "octaves")])
def test_whole_numbers_are_asked_for(name: str, parameter: str) -> None:
    with pytest.raises(InputError, match=f"{name}.{parameter} = 2.5; it must be a whole number"):
        CATALOGUE[name](**{parameter: 2.5})


def test_every_effect_has_a_test_of_its_own() -> None:
    text = "".join(p.read_text(encoding="utf-8") for p in Path(__file__).parent.glob("test_*.py"))
    missing = [n for n in EVERY if not re.search(rf"^def test_{n}_", text, flags=re.MULTILINE)]
    assert not missing, f"no test_<name>_... in tests/sensor/effects for {', '.join(missing)}"


def test_pages_of_effects_are_up_to_date() -> None:
    docs = Path(__file__).parents[3] / "docs"
    found = [docs / "effects.md", *(docs / "effects").glob("*.md")]
    shipped = {page.relative_to(docs).as_posix(): page.read_text(encoding="utf-8") for page in found}
    assert shipped == effects_page.pages(), "run: python -m tools.effects_page docs/effects.md"


def test_effect_of_the_page_on_adding_one_works(tmp_path, monkeypatch) -> None:
    """The example of docs/effects.md, run as a file: from frame 0 the light comes on as 1 - exp(-t/tau)."""
    code = re.findall(r"```python\n(.*?)```", effects_page.pages()["effects.md"], flags=re.DOTALL)[-1]
    (tmp_path / "slow_shutter.py").write_text(code, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    slow_shutter = importlib.import_module("slow_shutter").SlowShutter
    monkeypatch.setitem(CATALOGUE, "slow_shutter", slow_shutter)
    assert Sheet.of(slow_shutter).twins == ("lamp_drift",)
    rate = population(camera("slow_shutter", (1, 20_000), tau_us=500.0), 0.5, 40)
    expected = 0.5 * (1 - np.exp(-(np.arange(40) + 0.5) / 20.0))
    assert np.abs(rate - expected).max() < 4.5 * 0.5 / np.sqrt(20_000)
