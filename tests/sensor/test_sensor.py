"""The camera as a stream: same bits however it is cut, saved and restored; bad input named."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, Keyframes, SensorModel, SpikeSensor
from spikecam_env.sensor.kernels import block, fast
from spikecam_env.sensor.kernels.threads import together

ENGINES = ("reference", "fast")
SHAPE = (9, 13)


def moving_light(step: int = 16, seed: int = 0) -> Keyframes:
    rng = np.random.default_rng(seed)
    keys = np.arange(0, 321, step)
    return Keyframes(keys, rng.uniform(0, 1.1, (keys.size, *SHAPE)))


def stream(sensor: SpikeSensor, light, cuts) -> np.ndarray:
    return np.concatenate([sensor.step(light, k) for k in cuts])


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("light", [moving_light(), moving_light(7), moving_light(100), 0.3 * np.ones(SHAPE)])
def test_cutting_the_stream_changes_no_bit(engine: str, light) -> None:
    whole = SpikeSensor("scsim", SHAPE, 1, engine=engine).step(light, 320)
    for cuts in ([1] * 320, [5, 17, 1, 40, 257], [64] * 5):
        np.testing.assert_array_equal(stream(SpikeSensor("scsim", SHAPE, 1, engine=engine), light, cuts), whole)


@pytest.mark.parametrize("engine", ENGINES)
def test_keys_between_frames_are_served_and_cut_alike(engine: str) -> None:
    light = Keyframes(np.array([0.0, 10.25, 33.5]), moving_light().radiance[:3])
    whole = SpikeSensor("scsim", SHAPE, 1, engine=engine).step(light, 50)
    cut = stream(SpikeSensor("scsim", SHAPE, 1, engine=engine), light, [3, 30, 17])
    np.testing.assert_array_equal(cut, whole)


@pytest.mark.parametrize("engine", ENGINES)
def test_save_and_restore_mid_stream_changes_nothing(engine: str) -> None:
    light = moving_light()
    sensor = SpikeSensor("scsim", SHAPE, 1, engine=engine)
    sensor.step(light, 100)
    state = pickle.loads(pickle.dumps(sensor.state()))
    rest = sensor.step(light, 100)
    other = SpikeSensor("scsim", SHAPE, 99, engine=engine)
    other.restore(state)
    np.testing.assert_array_equal(other.step(light, 100), rest)
    sensor.restore(state)
    np.testing.assert_array_equal(sensor.step(light, 100), rest)


@pytest.mark.parametrize("engine", ENGINES)
def test_seeds_and_resets(engine: str) -> None:
    light = moving_light()
    sensor = SpikeSensor("scsim", SHAPE, 1, engine=engine)
    first = sensor.step(light, 64)
    sensor.reset()
    np.testing.assert_array_equal(sensor.step(light, 64), first)
    sensor.reset(seed=2)
    assert not np.array_equal(sensor.step(light, 64), first)
    np.testing.assert_array_equal(
        SpikeSensor("scsim", SHAPE, 2, engine=engine).step(light, 64),
        SpikeSensor("scsim", SHAPE, np.int64(2), engine=engine).step(light, 64),
    )


@pytest.mark.parametrize("engine", ENGINES)
def test_clean_twin_starts_at_the_same_phase_without_noise(engine: str) -> None:
    sensor = SpikeSensor("scsim", SHAPE, 1, engine=engine)
    twin = sensor.clean_twin()
    np.testing.assert_array_equal(twin.phase, sensor.phase)
    assert not twin.model.effects
    light = np.full(SHAPE, 0.25, np.float32)
    clean = twin.step(light, 400)
    gaps = [np.diff(np.flatnonzero(clean[:, y, x])) for y in range(SHAPE[0]) for x in range(SHAPE[1])]
    assert all(np.all(g == 4) for g in gaps)
    np.testing.assert_array_equal(sensor.clean_twin().step(light, 400), clean)


def test_moving_light_is_linear_between_keys_and_constant_outside() -> None:
    light = Keyframes(np.array([10, 20]), np.stack([np.zeros(SHAPE), np.ones(SHAPE)]))
    assert light.at(15.0).mean() == pytest.approx(0.5)
    assert light.at(0.0).mean() == 0.0 and light.at(99.0).mean() == 1.0
    sensor = SpikeSensor("ideal", (1, 50_000), 0, engine="reference")
    wide = Keyframes(np.array([10, 20]), np.stack([np.zeros((1, 50_000)), np.ones((1, 50_000))]))
    rate = sensor.step(wide, 30).mean(axis=(1, 2))
    expected = np.clip((np.arange(30) + 0.5 - 10) / 10, 0, 1)
    np.testing.assert_allclose(rate, expected, atol=4.5 * 0.5 / np.sqrt(50_000))


def test_auto_takes_the_fast_engine_where_it_carries_the_model() -> None:
    assert SpikeSensor("scsim", SHAPE, engine="auto").engine == "fast"
    lossy = SensorModel.preset("scsim").with_effect(CATALOGUE["dead_time"]())
    assert SpikeSensor(lossy, SHAPE, engine="auto").engine == "fast"
    with pytest.raises(InputError, match="cuda engine does not carry dead_time"):
        SpikeSensor(lossy, SHAPE, engine="cuda")
    with pytest.raises(InputError, match="dark_is_noisy"):
        SpikeSensor(
            SensorModel.preset("ideal").with_effect(CATALOGUE["shot_noise"](dark_is_noisy=False)), SHAPE, engine="fast"
        )


@pytest.mark.parametrize(
    "radiance, message",
    [
        (np.full(SHAPE, np.nan), "radiance holds NaN"),
        (np.full(SHAPE, np.inf), "radiance holds infinity"),
        (np.full(SHAPE, -0.1), "negative values"),
        (np.ones((3, 3)), "the sensor is"),
        (Keyframes(np.array([0.0]), np.ones((1, 3, 3))), "the sensor is"),
    ],
)
def test_bad_light_is_named_and_steps_nothing(radiance, message: str) -> None:
    sensor = SpikeSensor("scsim", SHAPE)
    with pytest.raises(InputError, match=message):
        sensor.step(radiance, 4)
    assert sensor.frame == 0


def test_bad_arguments_are_named() -> None:
    good = np.ones(SHAPE, np.float32)
    for frames in (0, -1, 1.5):
        with pytest.raises(InputError, match="frames"):
            SpikeSensor("scsim", SHAPE).step(good, frames)
    for shape in ((0, 4), (4,), (2.5, 3), "ab"):
        with pytest.raises(InputError, match="shape"):
            SpikeSensor("scsim", shape)
    with pytest.raises(InputError, match="seed"):
        SpikeSensor("scsim", SHAPE, seed=-1)
    with pytest.raises(InputError, match="unknown engine 'gpu'; choose one of"):
        SpikeSensor("scsim", SHAPE, engine="gpu")
    with pytest.raises(InputError, match="reference sensor"):
        SpikeSensor("scsim", SHAPE).restore(SpikeSensor("scsim", SHAPE, engine="reference").state())
    for frame, radiance in (([1, 0], np.ones((2, 2, 2))), ([0], np.ones((2, 2))), ([0, np.nan], np.ones((2, 2, 2)))):
        with pytest.raises(InputError, match="Keyframes"):
            Keyframes(np.array(frame), radiance)


@pytest.mark.parametrize("effects", [(), ("comparator_delay",)], ids=["pixels alone", "frame by frame"])
def test_a_camera_takes_as_many_threads_as_it_is_given(effects: tuple[str, ...], monkeypatch) -> None:
    model, taken = SensorModel.preset("scsim"), []
    for name in effects:
        model = model.with_effect(CATALOGUE[name]())
    for module in (fast, block):
        monkeypatch.setattr(module, "together", lambda parts, **k: (taken.append(len(parts)), together(parts, **k)))
    light = np.full((200, 200), 0.3, np.float32)
    one, three = (SpikeSensor(model, light.shape, 1, threads=n).step(light, 128) for n in (1, 3))
    assert set(taken) == {1, 3}
    np.testing.assert_array_equal(one, three)
    with pytest.raises(InputError, match="threads = 0"):
        SpikeSensor(model, SHAPE, threads=0)


def test_frames_can_be_written_to_given_memory() -> None:
    light = np.full((5, 7), 0.3, dtype=np.float32)
    fresh, recycled = SpikeSensor("scsim", (5, 7), 3), SpikeSensor("scsim", (5, 7), 3)
    out = np.full((9, 5, 7), 7, dtype=np.uint8)
    assert np.shares_memory(out, recycled.step(light, 9, out=out))
    assert np.array_equal(out, fresh.step(light, 9))
    with pytest.raises(InputError, match=r"it must be uint8 \(8, 5, 7\)"):
        fresh.step(light, 8, out=out)
