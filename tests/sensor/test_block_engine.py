"""The block kernel: the reference in distribution with noise, the same bits by any number of threads, units and takes.

Bit for bit without noise, effect by effect: tests/sensor/effects/test_every_effect.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from laws import jittered, with_effects

from benchmarks.agreement import compare, observe
from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, Effect, SensorModel, SpikeSensor, Stage, Unit
from spikecam_env.sensor.effects.base import Charge, ExposureBlock, parameter
from spikecam_env.sensor.engines.compiled import block
from spikecam_env.sensor.engines.compiled.bands.events import SPARSE
from spikecam_env.sensor.ground.random_fields import white_field, words
from spikecam_env.sensor.light import Segment
from spikecam_env.sensor.model import generator
from spikecam_env.types import Floats, Masks

pytestmark = pytest.mark.slow

SHAPE = (30, 400)
BY_EVENTS = {"clock_feedthrough", "crosstalk", "supply_ripple"}
"""Of these the reference takes the events within a frame one by one, in Python: a third of the pixels."""
FRAME_EFFECTS = sorted(name for name, effect in CATALOGUE.items() if not effect.is_fixed())

MODERATE: dict[str, dict[str, float]] = {
    "dead_time": {"tau_us": 10.0},
    "comparator_delay": {"delay_us": 5.0},
    "synchronous_reset": {"fraction": 0.5},
    "incomplete_reset": {"fraction": 0.2},
    "crosstalk": {"kick": 0.01},
    "ir_drop": {"droop": 0.02},
    "supply_ripple": {"ripple": 0.05, "frequency_hz": 1000.0},
    "light_flicker": {"modulation": 0.3, "frequency_hz": 1000.0},
    "threshold_flicker_noise": {"sigma_mV": 3.0},
}
"""Strengths that show in a few intervals; for the others the default."""


@pytest.mark.parametrize("interval", [1.7, 9.3])
@pytest.mark.parametrize("name", FRAME_EFFECTS)
def test_with_noise_it_agrees_with_the_reference_in_distribution(name: str, interval: float) -> None:
    """Intervals, pairs of them, counts, 16-bit words, first spikes of 12 000 or 4000 pixels, N = 500; Bonferroni, .001.

    The effect's own waveform is drawn alike by both engines: the test compares the pixels' noise, in frames enough
    for five spikes and a word.
    """
    model = jittered(500.0, 0.01).with_effect(CATALOGUE["dark_current"](mean_pA=5.0))
    model = model.with_effect(CATALOGUE[name](**MODERATE.get(name, {})))
    shape = (SHAPE[0] // 3, SHAPE[1]) if name in BY_EVENTS else SHAPE
    light = np.full(shape, 1 / interval - 0.01, dtype=np.float32)
    frames = int(8 * interval) + 24
    phase = generator(0, "phases of this test").random(shape)
    p = compare(*(observe(started(model, engine, phase), light, frames) for engine in ("fast", "reference")))
    worst = min(p, key=lambda test: p[test])
    limit = 0.001 / len(p) / len(FRAME_EFFECTS) / 2
    print(f"{name}, T = {interval:g}: smallest of {len(p)} p is {p[worst]:.2g} ({worst}), limit {limit:.2g}")
    assert p[worst] > limit


def started(model: SensorModel, engine: str, phase: Floats) -> SpikeSensor:
    """A camera at given phases; its noise is its engine's own."""
    sensor = SpikeSensor(model, phase.shape, 1, engine)
    sensor._start(1, phase)
    return sensor


@pytest.mark.parametrize(
    "name",
    [
        "dead_time",
        "crosstalk",
        "ir_drop",
        "row_temporal_noise",
        "random_telegraph_noise",
        "readout_skew",
        "clock_feedthrough",
    ],
)
def test_threads_and_block_lengths_change_no_bit(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spikecam_env.threads.PIXEL_STEPS_A_THREAD", 1)
    monkeypatch.setattr(block, "_FEWEST", 1)
    model = with_effects("scsim", CATALOGUE[name]())
    unit = model.draw_unit((33, 50), 0)
    first = ExposureBlock(0, model.frame_rate_hz, (33, 50), unit)
    effects = [e for e in model.effects if not e.is_fixed()]
    light = np.random.default_rng(0).uniform(0, 1.2, (2, unit.gain.size)).astype(np.float32)
    streams = []
    for threads, longest in ((1, 1 << 18), (3, 1 << 18), (2, 1), (1, 5 * unit.gain.size)):
        for most in ("_BLOCK", "_MOVING"):
            monkeypatch.setattr(block, most, longest)
        state = block.start(first, effects, generator(0, "phase").random(unit.gain.size), 7)
        rise, stay = Segment(*light, 64, 0, 40), Segment(light[1], light[1], 64, 0, 30)
        fall, again = Segment(light[1], light[0], 8, 0, 8), Segment(light[1].copy(), light[1].copy(), 64, 0, 30)
        parts = [rise, replace(rise, first=40, count=24), fall, stay, again, Segment(light[0], light[0], 64, 0, 5)]
        spikes = np.empty((sum(part.count for part in parts), unit.gain.size), np.uint8)
        streams.append(block.run(first, effects, state, parts, spikes, threads=threads))
    for other in streams[1:]:
        np.testing.assert_array_equal(other, streams[0])


@pytest.mark.parametrize("shape", [(2, 2500), (3, 1021), (25, 100)])
@pytest.mark.parametrize("name", ["crosstalk", "ir_drop", "incomplete_reset", "dead_time", "clock_feedthrough"])
def test_rows_wider_than_a_band_and_bands_of_rows_have_the_bits_of_the_reference(
    name: str, shape: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In few frames: the reference takes the events within each in Python."""
    monkeypatch.setattr("spikecam_env.threads.PIXEL_STEPS_A_THREAD", 1)
    model = with_effects("ideal", CATALOGUE[name](**MODERATE.get(name, {})))
    light = np.random.default_rng(0).uniform(0.0, 2.5, shape).astype(np.float32)
    expected = SpikeSensor(model, shape, 1, "reference").step(light, 8)
    assert not np.array_equal(expected, SpikeSensor("ideal", shape, 1, "reference").step(light, 8))
    for threads in (1, 2):
        sensor = SpikeSensor(model, shape, 1, "fast", threads=threads)
        np.testing.assert_array_equal(np.concatenate([sensor.step(light, 5), sensor.step(light, 3)]), expected)


@pytest.mark.parametrize("shape", [(2, 2500), (33, 50)])
@pytest.mark.parametrize("name", ["incomplete_reset", "dead_time", "random_telegraph_noise", "synchronous_reset"])
@pytest.mark.parametrize("preset", ["ideal", "scsim"])
def test_from_spike_to_spike_has_the_bits_of_frame_by_frame(preset: str, name: str, shape: tuple[int, int]) -> None:
    """Under steady light, in most of it few spikes: all frames at once, three at a time, and one by one; then the dark,
    in which pixels that got several thresholds a frame are to be as far as they were."""
    model = with_effects(preset, CATALOGUE[name](**MODERATE.get(name, {})))
    rng = np.random.default_rng(0)
    light = (0.6 * rng.random(shape) ** 3).astype(np.float32)
    light.flat[rng.integers(0, light.size, 20)] = [0.0, 3.3] * 10
    assert light.mean() < SPARSE
    spikes = [
        np.concatenate([*(sensor.step(light, n) for n in calls), sensor.step(0 * light, 9)])
        for calls in ([300], [3] * 100, [1] * 300, [250, 50])
        for sensor in [SpikeSensor(model, shape, 1, "fast", threads=1)]
    ]
    for other in spikes[1:]:
        np.testing.assert_array_equal(other, spikes[0])
    if preset == "ideal" and name != "random_telegraph_noise":
        np.testing.assert_array_equal(SpikeSensor(model, shape, 1, "reference").step(light, 300), spikes[0][:300])


@dataclass(frozen=True)
class Blinking(Effect):
    """A user's own effect, of hooks for blocks alone."""

    depth: float = parameter(0.5, unit="relative", bounds=(0.0, 1.0), doc="every second frame is darker")

    stage = Stage.OPTICS
    strength = "depth"

    def collect(self, light: Charge, dark: Charge, now: ExposureBlock, memory: Any) -> tuple[Charge, Charge, Any]:
        odd = (now.number + np.arange(now.frames)) % 2
        return light.scaled(1.0 - self.depth * odd[:, None, None]), dark, memory

    def read_out(self, spikes: Masks, now: ExposureBlock, memory: Any) -> tuple[Masks, Any]:
        return spikes & (np.arange(now.shape[1]) != 3), memory


@dataclass(frozen=True)
class Sticky(Effect):
    """A user's own effect that reacts to spikes, without declaring it."""

    share: float = parameter(0.1, unit="relative", bounds=(0.0, 1.0), doc="share of the residual that is lost")

    stage = Stage.RESET
    strength = "share"

    def after_reset(self, residual: Floats, rate: Floats, now: ExposureBlock) -> Floats:
        return residual * (1.0 - self.share)


@pytest.fixture
def own_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    for effect in (Blinking, Sticky):
        monkeypatch.setitem(CATALOGUE, effect.name, effect)


@pytest.mark.usefixtures("own_effects")
def test_an_effect_of_ones_own_with_block_hooks_alone_just_works() -> None:
    model = with_effects("ideal", Blinking())
    light = np.random.default_rng(0).uniform(0, 1.0, (5, 8))
    assert SpikeSensor(model, (5, 8), engine="auto").engine == "fast"
    fast, reference = (SpikeSensor(model, (5, 8), 0, engine).step(light, 100) for engine in ("fast", "reference"))
    np.testing.assert_array_equal(fast, reference)
    assert fast.any() and not fast[:, :, 3].any()


@pytest.mark.usefixtures("own_effects")
def test_an_effect_of_ones_own_that_reacts_to_spikes_undeclared_is_refused_by_name() -> None:
    model = with_effects("ideal", Sticky())
    with pytest.raises(InputError, match="fast engine does not carry sticky"):
        SpikeSensor(model, (5, 8), engine="fast")
    assert SpikeSensor(model, (5, 8), engine="auto").engine == "reference"


@pytest.mark.parametrize("engine", ["fast", "reference"])
def test_a_given_unit_is_the_camera_and_stays_it(engine: str) -> None:
    """The model's fixed patterns are not imprinted, its effects from frame to frame act, reset keeps the unit."""
    measured = SensorModel.preset("scsim").draw_unit((6, 7), 12)
    light = np.full((6, 7), 0.3, dtype=np.float32)
    sensor = SpikeSensor("scsim", (6, 7), 5, engine, unit=measured)
    assert sensor.unit is measured
    own = SpikeSensor("ideal", (6, 7), 5, engine, unit=measured)
    np.testing.assert_array_equal(sensor.step(light, 100), own.step(light, 100))
    sensor.reset(seed=6)
    assert sensor.unit is measured
    assert not np.array_equal(
        sensor.step(light, 100), SpikeSensor("ideal", (6, 7), 5, engine, unit=measured).step(light, 100)
    )
    lossy = with_effects("ideal", CATALOGUE["dead_time"](tau_us=25.0))
    slower = SpikeSensor(lossy, (6, 7), 5, engine, unit=measured).step(light, 400).mean()
    assert slower < 0.95 * SpikeSensor("ideal", (6, 7), 5, engine, unit=measured).step(light, 400).mean()


def test_a_given_unit_is_checked() -> None:
    unit = SensorModel.preset("scsim").draw_unit((4, 5), 0)
    with pytest.raises(InputError, match=r"unit.gain is \(20,\), the sensor is \(4, 6\)"):
        SpikeSensor("scsim", (4, 6), unit=unit)
    with pytest.raises(InputError, match=r"unit\.dark is nan at pixel 3"):
        SpikeSensor("scsim", (4, 5), unit=replace(unit, dark=np.where(np.arange(20) == 3, np.nan, unit.dark)))
    with pytest.raises(InputError, match="must be a Unit"):
        SpikeSensor("scsim", (4, 5), unit="mine")  # type: ignore[arg-type]
    few: Unit = replace(unit, electrons=np.full(20, 10.0))
    with pytest.raises(InputError, match=r"does not carry unit\.electrons below 20"):
        SpikeSensor("scsim", (4, 5), engine="fast", unit=few)
    assert SpikeSensor("scsim", (4, 5), engine="auto", unit=few).engine == "reference"


@pytest.mark.parametrize("engine", ["fast", "reference"])
def test_another_take_has_the_same_traps_and_other_noise(engine: str) -> None:
    """Random telegraph noise alone, in the dark: the pixels that fire are those with a trap."""
    model = with_effects("ideal", CATALOGUE["random_telegraph_noise"](amplitude_pA=300.0, fraction=0.1, dwell_ms=0.5))
    takes = [SpikeSensor(model, (40, 50), 3, engine, take=take).step(np.zeros((40, 50)), 200) for take in (0, 1)]
    trapped = [take.any(axis=0) for take in takes]
    np.testing.assert_array_equal(*trapped)
    assert not np.array_equal(*takes)
    other = SpikeSensor(model, (40, 50), 4, engine).step(np.zeros((40, 50)), 200).any(axis=0)
    assert not np.array_equal(other, trapped[0])


def test_a_given_units_traps_stay_through_a_reset() -> None:
    model = with_effects("ideal", CATALOGUE["random_telegraph_noise"](amplitude_pA=300.0, fraction=0.1, dwell_ms=0.5))
    sensor = SpikeSensor(model, (40, 50), 3, unit=SensorModel.preset("ideal").draw_unit((40, 50), 0))
    first = sensor.step(np.zeros((40, 50)), 200).any(axis=0)
    sensor.reset(seed=8)
    np.testing.assert_array_equal(sensor.step(np.zeros((40, 50)), 200).any(axis=0), first)


def test_white_field_is_normal_and_independent_from_pixel_to_pixel_and_frame_to_frame() -> None:
    """400 000 numbers: moments within 4.5 standard errors."""
    of = words(np.random.default_rng(0))
    field = white_field(of, 1.0, 5, 40, (100, 100)).astype(np.float64)
    n = field.size
    moments = {"mean": (field.mean(), 0.0, 1.0), "variance": (field.var(), 1.0, 2.0)}
    moments |= {"third": ((field**3).mean(), 0.0, 15.0), "fourth": ((field**4).mean(), 3.0, 96.0)}
    for name, a, b in (("next frame", field[1:], field[:-1]), ("next pixel", field[:, :, 1:], field[:, :, :-1])):
        moments[name] = ((a * b).mean(), 0.0, 1.0)
    for name, (value, expected, variance) in moments.items():
        print(f"{name}: {value:.5f}, expected {expected:g} +- {np.sqrt(variance / n):.5f}")
        assert abs(value - expected) < 4.5 * np.sqrt(variance / n)
    np.testing.assert_array_equal(white_field(of, 1.0, 11, 3, (100, 100)), field[6:9].astype(np.float32))
