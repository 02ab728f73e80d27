"""The camera as a stream: same bits however it is cut, saved and restored; bad input named."""

from __future__ import annotations

import pickle
import subprocess
import sys
import warnings
from dataclasses import replace

import numpy as np
import pytest

from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, Circuit, Keyframes, SensorModel, SpikeSensor
from spikecam_env.sensor.engines.compiled import queue
from spikecam_env.threads import together

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
    for shape in ((4,), "ab"):
        with pytest.raises(InputError, match="shape"):
            SpikeSensor("scsim", shape)
    for message, argument in (
        ("seed", {"seed": -1}),
        ("unknown engine 'gpu'; choose one of", {"engine": "gpu"}),
        ("bent_light", {"bent_light": "maybe"}),
    ):
        with pytest.raises(InputError, match=message):
            SpikeSensor("scsim", SHAPE, **argument)
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
    monkeypatch.setattr(queue, "together", lambda parts, **k: (taken.append(len(parts)), together(parts, **k)))
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


SCSIM = SensorModel.preset("scsim")
OTHERS = {
    r"frame effects \(none\); this one has dead_time": SCSIM.with_effect(CATALOGUE["dead_time"]()),
    r"reset_noise\.sigma_mV: 6\.36, 3\.0": SCSIM.with_effect(CATALOGUE["reset_noise"](sigma_mV=3.0)),
    r"frame_rate_hz: 40000\.0, 20000\.0": replace(SCSIM, frame_rate_hz=20_000.0),
    r"circuit\.reset_V: 3\.3, 3\.5": replace(SCSIM, circuit=Circuit(reset_V=3.5)),
    r"shot_noise\.quanta: 50000\.0, none": SCSIM.without("shot_noise"),
}


@pytest.mark.parametrize("message", OTHERS)
def test_state_of_another_model_is_refused(message: str) -> None:
    state = SpikeSensor(SCSIM, SHAPE, 1).state()
    other = SpikeSensor(OTHERS[message], SHAPE, 1)
    with pytest.raises(InputError, match=message):
        other.restore(state)
    SpikeSensor(replace(SCSIM, name="the same, renamed"), SHAPE, 1).restore(state)
    with pytest.raises(InputError, match="state is a dict"):
        other.restore({"frame": 0})  # type: ignore[arg-type]


def test_state_of_another_unit_is_refused() -> None:
    unit = SCSIM.draw_unit(SHAPE, 5)
    warmer = replace(unit, dark=2.0 * unit.dark)
    state = SpikeSensor(SCSIM, SHAPE, 1, unit=unit).state()
    for other in (SpikeSensor(SCSIM, SHAPE, 1), SpikeSensor(SCSIM, SHAPE, 1, unit=warmer)):
        with pytest.raises(InputError, match="state is of another unit"):
            other.restore(state)
    with pytest.raises(InputError, match="state is of another unit"):
        SpikeSensor(SCSIM, SHAPE, 1, unit=unit).restore(SpikeSensor(SCSIM, SHAPE, 1).state())
    SpikeSensor(SCSIM, SHAPE, 1, unit=pickle.loads(pickle.dumps(unit))).restore(state)


GOES_ON = """
import pickle, sys
import numpy as np
from spikecam_env.sensor import SpikeSensor
sensor = SpikeSensor("scsim", (9, 13), 1, sys.argv[2])
sensor.restore(pickle.load(open(sys.argv[1], "rb")))
print(sensor.step(np.full((9, 13), 0.3, np.float32), 50).tobytes().hex())
"""


def test_state_goes_on_in_another_process(tmp_path) -> None:
    light, sensor = np.full(SHAPE, 0.3, np.float32), SpikeSensor("scsim", SHAPE, 1)
    sensor.step(light, 30)
    (tmp_path / "state").write_bytes(pickle.dumps(sensor.state()))
    done = subprocess.run(
        [sys.executable, "-c", GOES_ON, str(tmp_path / "state"), "fast"], capture_output=True, text=True, check=True
    )
    assert bytes.fromhex(done.stdout.strip()) == sensor.step(light, 50).tobytes()


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("blurred", [False, True], ids=["bare", "through optics"])
def test_keys_changed_in_place_between_steps_are_seen(engine: str, blurred: bool) -> None:
    model = SCSIM.with_effect(CATALOGUE["optical_blur"](sigma_pixels=1.0)) if blurred else SCSIM
    first, second = (moving_light(16, seed).radiance for seed in (1, 2))
    frame = moving_light().frame
    changed = Keyframes(frame, first.copy())
    one, two = (SpikeSensor(model, SHAPE, 1, engine) for _ in range(2))
    for cut in (5, 3, 30):
        for light in (first, second):
            changed.radiance[:] = light
            np.testing.assert_array_equal(one.step(changed, cut), two.step(Keyframes(frame, light), cut))


@pytest.mark.parametrize("name", ["optical_blur", "dead_time"])
def test_ramps_that_stand_still_are_light_that_stays(name: str) -> None:
    """Through optics and without, whole and a frame at a time, on both engines where nothing is drawn."""
    model = SensorModel.preset("ideal").with_effect(CATALOGUE["optical_blur"](sigma_pixels=1.0))
    model = model.with_effect(CATALOGUE[name]())
    one, two = moving_light().radiance[:2]
    light = Keyframes([0, 16, 40, 70, 90], np.stack([one, one, two, two, one]))
    whole = SpikeSensor(model, SHAPE, 1, "reference").step(light, 120)
    for cuts in ([120], [1] * 90 + [30], [7] * 15 + [15]):
        np.testing.assert_array_equal(stream(SpikeSensor(model, SHAPE, 1), light, cuts), whole)


@pytest.mark.parametrize("engine", ENGINES)
def test_nobody_changes_a_sensor_through_an_array(engine: str) -> None:
    drawn = SCSIM.draw_unit(SHAPE, 5)
    given = replace(drawn, gain=drawn.gain.copy(), dark=drawn.dark.copy())
    light = np.full(SHAPE, 0.3, np.float32)
    expected = SpikeSensor(SCSIM, SHAPE, 1, engine, unit=drawn).step(light, 60)
    sensor = SpikeSensor(SCSIM, SHAPE, 1, engine, unit=given)
    state, twin = sensor.state(), sensor.clean_twin()
    given.gain[:] = 0.0
    for owned in (sensor.phase, sensor.unit.gain, sensor.unit.kappa, state.phase, twin.phase, drawn.gain):
        with pytest.raises(ValueError, match="read-only"):
            owned[...] = 0.0
    np.testing.assert_array_equal(sensor.step(light, 60), expected)
    other = SpikeSensor(SCSIM, SHAPE, 2, engine, unit=drawn)
    other.restore(pickle.loads(pickle.dumps(state)))
    kept = other.state()
    other.step(light, 7)
    other.restore(kept)
    np.testing.assert_array_equal(other.step(light, 60), expected)


def test_out_of_the_lights_own_memory_is_refused() -> None:
    memory = np.full(np.prod(SHAPE) * 4, 7, dtype=np.uint8)
    light = memory.view(np.float32).reshape(SHAPE)
    light[:] = 0.3
    with pytest.raises(InputError, match="out and radiance share memory"):
        SpikeSensor("ideal", SHAPE).step(light, 4, out=memory.reshape(4, *SHAPE))
    with pytest.raises(InputError, match="out is a list"):
        SpikeSensor("ideal", SHAPE).step(light.copy(), 1, out=[1])  # type: ignore[arg-type]


PLAIN = np.random.default_rng(3).uniform(0, 1, SHAPE).astype(np.float16).astype(np.float32)
NO_LIGHT = {
    "uint8": (200 * PLAIN).astype(np.uint8),
    "int64": (200 * PLAIN).astype(int),
    "a list of whole numbers": [[1] * SHAPE[1]] * SHAPE[0],
    "bool": PLAIN > 0.5,
    "complex": PLAIN + 0j,
    "objects": PLAIN.astype(object),
    "text": PLAIN.astype(str),
    "dates": np.full(SHAPE, np.datetime64("2026-01-01")),
    "masked": np.ma.masked_less(PLAIN, 0.5),
    "masked rows": list(np.ma.masked_less(PLAIN, 0.5)),
    "ragged": [[0.5] * 13, [0.5]],
    "nothing": None,
    "infinite in float32": np.full(SHAPE, 1e300),
    "too large for any float": [[10**400] * SHAPE[1]] * SHAPE[0],
}


@pytest.mark.parametrize("kind", NO_LIGHT)
def test_what_is_no_light_is_refused(kind: str) -> None:
    with pytest.raises(InputError, match="radiance"):
        SpikeSensor("ideal", SHAPE).step(NO_LIGHT[kind])
    with pytest.raises(InputError, match=r"radiance|Keyframes need"):
        Keyframes([0.0], [NO_LIGHT[kind]])


@pytest.mark.parametrize("engine", ENGINES)
def test_light_of_any_layout_and_precision_gives_the_same_bits(engine: str) -> None:
    expected = SpikeSensor("scsim", SHAPE, 1, engine).step(PLAIN, 40)
    strided = np.repeat(PLAIN, 2, axis=1)[:, ::2]
    layouts = (
        PLAIN.astype(np.float16), PLAIN.astype(float), PLAIN.astype(np.longdouble), PLAIN.astype(">f4"),
        np.asfortranarray(PLAIN), strided, PLAIN[::-1, ::-1].copy()[::-1, ::-1], PLAIN.tolist(),
        np.ma.masked_array(PLAIN), np.frombuffer(PLAIN.tobytes(), np.float32).reshape(SHAPE),
    )  # fmt: skip
    for light in layouts:
        np.testing.assert_array_equal(SpikeSensor("scsim", SHAPE, 1, engine).step(light, 40), expected)
        keys = Keyframes(np.array([0], ">i4"), [light])
        np.testing.assert_array_equal(SpikeSensor("scsim", SHAPE, 1, engine).step(keys, 40), expected)


@pytest.mark.parametrize(
    "frame",
    [[3, 1], [1, 1], [0, np.nan], [0, np.inf], [0, 2.0**63], [0, 10**400], [False, True], ["0", "1"], [0, 1j],
     np.array([0, 1], object), np.ma.masked_equal([0, 1], 1), [[0, 1]], np.array([0, 1], "M8[s]")],
    ids=str,
)  # fmt: skip
def test_frames_of_keys_that_are_no_times_are_refused(frame) -> None:
    with pytest.raises(InputError, match="Keyframes"):
        Keyframes(frame, np.stack([PLAIN, PLAIN]))


@pytest.mark.parametrize("last", [64, 100])
def test_keys_relative_to_a_call_are_doubted_aloud(last: int) -> None:
    """Keys that begin at 0 in every call hold their last picture from the call on that begins after them."""
    sensor, pictures = SpikeSensor("scsim", SHAPE, 1), np.stack([PLAIN, 0.5 * PLAIN])
    with pytest.warns(UserWarning, match=rf"keys of frames 0 \.\. {last} lie beside .* the stream's absolute frames"):
        for _ in range(3):
            sensor.step(Keyframes([0, last], pictures), 64)
    with pytest.warns(UserWarning, match="lie beside"):
        sensor.step(Keyframes([1000, 1064], pictures), 8)


def test_a_film_that_ends_and_light_that_is_held_are_not_doubted() -> None:
    sensor, pictures = SpikeSensor("scsim", SHAPE, 1), np.stack([PLAIN, 0.5 * PLAIN])
    film = Keyframes([0, 64], pictures)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(3):
            sensor.step(film, 64)
        sensor.step(Keyframes([0], PLAIN[None]), 8)
        sensor.step(Keyframes([200, 208], pictures), 16)
        sensor.step(PLAIN, 8)


@pytest.mark.parametrize("name", ["gain", "dark", "electrons", "kappa", "swing_V", "threshold_fC"])
def test_units_that_are_no_law_are_refused(name: str) -> None:
    unit = SCSIM.draw_unit(SHAPE, 0)
    for bad in (-1.0, np.nan, np.inf, 1e300, *([] if name in ("gain", "dark", "kappa") else [1e-300])):
        with pytest.raises(InputError, match=rf"unit\.{name} is .* at pixel 0"):
            SpikeSensor("scsim", SHAPE, unit=replace(unit, **{name: np.full(unit.gain.size, bad)}))
    with pytest.raises(InputError, match=r"unit\.shot = 'no'"):
        SpikeSensor("scsim", SHAPE, unit=replace(unit, shot="no"))


@pytest.mark.parametrize("bad", [True, 0, -1, 1.0, 1.5, "4", None, 10**5000], ids=lambda bad: type(bad).__name__)
def test_counts_and_shapes_are_whole_numbers_that_fit(bad) -> None:
    for call in (
        lambda: SpikeSensor("ideal", SHAPE).step(PLAIN, bad),
        lambda: SpikeSensor("ideal", (bad, 4)),
    ):
        with pytest.raises(InputError, match=r"frames|shape"):
            call()
