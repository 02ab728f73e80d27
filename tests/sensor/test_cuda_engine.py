"""The cuda engine's law and its batches, on the processor: each camera gives the bits of the fast engine."""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Sequence

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, Keyframes, SensorModel, SpikeSensor, SpikeSensorBatch
from spikecam_env.sensor.engines import gpu
from spikecam_env.sensor.engines.compiled import fast
from spikecam_env.sensor.light import Segment
from spikecam_env.sensor.model import generator

SHAPE = (7, 19)
SEEDS = (3, 11, 2**40)
FRAMES = 200
CPU = torch.device("cpu")


def wild_film(step: int, seed: int, shape: tuple[int, int] = SHAPE) -> Keyframes:
    """Keys every `step` frames: dark, dim, bright, over two thresholds a frame; constant beyond frame 150."""
    rng = np.random.default_rng(seed)
    keys = np.arange(0, 151, step)
    light = np.exp(rng.uniform(np.log(0.002), np.log(2.5), (keys.size, *shape)))
    light[:, 0] = 0.0
    light[::2, 1] = 5.0
    return Keyframes(keys, light)


def fast_films(light: Sequence[object], models: Sequence[SensorModel | str], frames: int = FRAMES) -> NDArray[np.uint8]:
    """Spikes by SpikeSensor(engine="fast") for each camera's light and model."""
    cameras = [SpikeSensor(model, SHAPE, seed) for model, seed in zip(models, SEEDS, strict=True)]
    return np.stack([camera.step(film, frames) for camera, film in zip(cameras, light, strict=True)])


def batch(models: object = "scsim", **changed: object) -> SpikeSensorBatch:
    return SpikeSensorBatch(models, **{"shape": SHAPE, "seeds": SEEDS, "device": "cpu", **changed})


def equal(spikes: torch.Tensor, expected: NDArray[np.uint8]) -> None:
    assert spikes.dtype == torch.uint8
    print(
        f"{expected.size} bits, {expected.mean():.3f} spikes a frame, {int((spikes.numpy() != expected).sum())} differ"
    )
    np.testing.assert_array_equal(spikes.numpy(), expected)


@pytest.mark.parametrize("preset", ["ideal", "scsim", "physical"])
@pytest.mark.parametrize("pixels", [1, 257, 1009])
def test_pixels_and_their_state_are_those_of_the_fast_engine(preset: str, pixels: int) -> None:
    """Ramps of every steepness, cut in the middle; light from none to eight crossings in a few frames."""
    model = SensorModel.preset(preset)
    units = [model.draw_unit((1, pixels), seed) for seed in SEEDS]
    phases = [generator(seed, "phase").random(pixels) for seed in SEEDS]
    ours = gpu.start(units, phases, SEEDS, CPU)
    theirs = [fast.start(*one) for one in zip(units, phases, SEEDS, strict=True)]
    for key, (length, first, count) in enumerate([(64, 0, 64), (64, 5, 1), (7, 3, 4), (50, 17, 33), (1, 0, 1)]):
        light = wild_film(150, key, (3, pixels)).radiance
        segments = [Segment(light[0, b], light[1, b], length, first, count) for b in range(3)]
        spikes = gpu.run(ours, gpu.BatchSegment.of(segments, CPU))
        equal(spikes, np.stack([fast.run(state, segment) for state, segment in zip(theirs, segments, strict=True)]))
    for b, state in enumerate(theirs):
        np.testing.assert_array_equal(ours.remaining[b], state.remaining[:pixels])
        np.testing.assert_array_equal(ours.fired[b].numpy().view(np.uint32), state.fired[:pixels])


@pytest.mark.parametrize("cuts", [[FRAMES], [1] * FRAMES, [5, 17, 1, 40, 137]])
@pytest.mark.parametrize("steps", [(16, 16, 16), (10, 25, 150)])
def test_each_camera_of_a_batch_is_the_fast_camera_of_its_seed(steps: tuple[int, ...], cuts: list[int]) -> None:
    films = [wild_film(step, seed) for seed, step in enumerate(steps)]
    cameras = batch()
    spikes = torch.cat([cameras.step(films, frames) for frames in cuts], dim=1)
    equal(spikes, fast_films(films, ["scsim"] * 3))
    assert cameras.frame.tolist() == [FRAMES] * 3


def test_light_is_shared_or_a_camera_s_own_still_or_moving() -> None:
    film = wild_film(25, 0)
    equal(batch().step(film, FRAMES), fast_films([film] * 3, ["scsim"] * 3))
    picture = film.radiance[0]
    equal(batch().step(picture, FRAMES), fast_films([picture] * 3, ["scsim"] * 3))
    pictures = film.radiance[:3]
    for given in (pictures, list(pictures), torch.from_numpy(pictures), torch.from_numpy(pictures).double()):
        equal(batch().step(given, FRAMES), fast_films(pictures, ["scsim"] * 3))
    between = Keyframes(np.array([0.0, 10.25, 33.5]), film.radiance[:3])
    equal(batch().step([between, film, between], FRAMES), fast_films([between, film, between], ["scsim"] * 3))


def test_cameras_of_other_models_and_optics_share_a_batch() -> None:
    optics = [name for name, effect in CATALOGUE.items() if effect().overrides("image")]
    assert optics
    blurred = SensorModel.preset("physical").with_effect(CATALOGUE[optics[0]]())
    models = ["ideal", "scsim", blurred]
    film = wild_film(25, 0)
    equal(batch(models).step(film, FRAMES), fast_films([film] * 3, models))
    equal(batch(models).step(film.radiance[0], 70), fast_films([film.radiance[0]] * 3, models, 70))
    equal(batch(blurred).step(film, 70), fast_films([film] * 3, [blurred] * 3, 70))
    equal(batch(blurred).step(film.radiance[0], 70), fast_films([film.radiance[0]] * 3, [blurred] * 3, 70))


def test_save_and_restore_mid_stream_changes_nothing() -> None:
    film = wild_film(25, 0)
    cameras = batch()
    cameras.step(film, 77)
    state = pickle.loads(pickle.dumps(cameras.state()))
    rest = cameras.step(film, 100)
    other = batch(seeds=(7, 8, 9))
    other.restore(state)
    assert other.seeds == SEEDS
    equal(other.step(film, 100), rest.numpy())
    cameras.restore(state)
    equal(cameras.step(film, 100), rest.numpy())


def test_reset_starts_some_cameras_anew_and_leaves_the_others_their_stream() -> None:
    film = wild_film(25, 0)
    whole = fast_films([film] * 3, ["scsim"] * 3)
    cameras = batch()
    cameras.step(film, 77)
    cameras.reset(seeds=(0, 5, 0), mask=[False, True, False])
    assert cameras.seeds == (3, 5, 2**40) and cameras.frame.tolist() == [77, 0, 77]
    spikes = cameras.step(film, 100)
    equal(spikes[[0, 2]], whole[[0, 2], 77:177])
    equal(spikes[1], SpikeSensor("scsim", SHAPE, 5).step(film, 100))
    cameras.reset(seeds=SEEDS)
    equal(cameras.step(film, FRAMES), whole)
    cameras.reset()
    equal(cameras.step(film, FRAMES), whole)
    cameras.reset(mask=np.zeros(3, dtype=bool))
    assert cameras.frame.tolist() == [FRAMES] * 3


def test_exchanged_cameras_go_on_in_another_batch_and_the_others_keep_their_stream() -> None:
    light = np.random.default_rng(0).random((4, 6), dtype=np.float32)
    batch, others, alone = (SpikeSensorBatch("scsim", (4, 6), seeds, "cpu") for seeds in ([1, 2, 3], [8], [8]))
    whole = SpikeSensorBatch("scsim", (4, 6), [1, 2, 3], "cpu")
    for cameras, frames in ((batch, 30), (whole, 30), (others, 12), (alone, 12)):
        cameras.step(light, frames)
    batch.exchange([1], others)
    assert batch.seeds == (1, 8, 3) and batch.frame.tolist() == [30, 12, 30]
    spikes = batch.step(light, 40).numpy()
    np.testing.assert_array_equal(spikes[[0, 2]], whole.step(light, 40).numpy()[[0, 2]])
    np.testing.assert_array_equal(spikes[1], alone.step(light, 40).numpy()[0])


def test_cameras_that_do_not_fit_are_not_exchanged() -> None:
    batch = SpikeSensorBatch("scsim", (4, 6), [1, 2], "cpu")
    for numbers, others, message in (
        ([2], SpikeSensorBatch("scsim", (4, 6), [8], "cpu"), "camera = 2"),
        ([0, 0], SpikeSensorBatch("scsim", (4, 6), [8, 9], "cpu"), "give each number once"),
        ([0], SpikeSensorBatch("scsim", (4, 6), [8, 9], "cpu"), "it must have 1 of"),
        ([0], SpikeSensorBatch("scsim", (6, 4), [8], "cpu"), "it must have 1 of"),
        ([0], SpikeSensorBatch("ideal", (4, 6), [8], "cpu"), "of the models of those that go"),
    ):
        with pytest.raises(InputError, match=message):
            batch.exchange(numbers, others)
    assert batch.seeds == (1, 2)


def test_clean_twins_are_those_of_the_fast_cameras() -> None:
    film = wild_film(25, 0)
    clean = [SpikeSensor("scsim", SHAPE, seed).clean_twin().step(film, FRAMES) for seed in SEEDS]
    equal(batch().clean_twin().step(film, FRAMES), np.stack(clean))


def test_one_camera_by_the_cuda_engine_is_the_fast_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    """SpikeSensor's own face; the processor stands in for the GPU."""
    monkeypatch.setattr(gpu, "checked_device", lambda device: CPU)
    film = wild_film(25, 0)
    sensor = SpikeSensor("scsim", SHAPE, 3, engine="cuda", take=2)
    other = SpikeSensor("scsim", SHAPE, 3, engine="fast", take=2)
    np.testing.assert_array_equal(sensor.step(film, 77), other.step(film, 77))
    state = pickle.loads(pickle.dumps(sensor.state()))
    rest = other.step(film, 100)
    np.testing.assert_array_equal(sensor.step(film, 100), rest)
    again = SpikeSensor("scsim", SHAPE, 99, engine="cuda")
    again.restore(state)
    np.testing.assert_array_equal(again.step(film, 100), rest)
    np.testing.assert_array_equal(sensor.clean_twin().step(film, 64), other.clean_twin().step(film, 64))
    with pytest.raises(InputError, match="of a cuda sensor"):
        other.restore(state)


@pytest.mark.skipif(torch.cuda.is_available(), reason="this machine has a CUDA device")
def test_without_a_gpu_the_engine_refuses_and_says_what_to_do() -> None:
    for build in (lambda: SpikeSensor("scsim", SHAPE, engine="cuda"), lambda: batch(device="cuda")):
        with pytest.raises(InputError, match=r"sees 0 CUDA devices; use engine='fast', or .*device='cpu'"):
            build()


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device on this machine")
def test_on_a_gpu_each_camera_is_the_fast_camera_of_its_seed() -> None:
    films = [wild_film(step, seed) for seed, step in enumerate((10, 25, 150))]
    equal(batch(device="cuda").step(films, FRAMES).cpu(), fast_films(films, ["scsim"] * 3))


def test_what_the_engine_does_not_carry_is_refused_by_name() -> None:
    slow = SensorModel.preset("scsim").with_effect(CATALOGUE["dead_time"]())
    with pytest.raises(InputError, match="cuda engine does not carry dead_time"):
        SpikeSensor(slow, SHAPE, engine="cuda")
    with pytest.raises(InputError, match="cuda engine does not carry dead_time"):
        batch(["scsim", slow, "ideal"])
    with pytest.raises(InputError, match=r"quanta=10 \(below 20\)"):
        batch(SensorModel.preset("scsim").with_effect(CATALOGUE["shot_noise"](quanta=10)))


@pytest.mark.parametrize(
    "light, message",
    [
        (np.full(SHAPE, np.nan), "radiance holds NaN"),
        (torch.full((3, *SHAPE), -0.1), "negative values"),
        (np.ones((2, *SHAPE)), r"radiance has shape \(2, 7, 19\), the batch is \(3, 7, 19\)"),
        ([wild_film(25, 0)] * 2, "2 lights for 3 cameras"),
        ([wild_film(25, 0), wild_film(25, 0), np.ones((3, 3))], "the sensor is"),
        (wild_film(25, 0, (3, 3)), "the sensor is"),
        *((np.ones(SHAPE, kind), "radiance is") for kind in (np.uint8, np.int64, bool, complex, object)),
        *((torch.ones(SHAPE, dtype=kind), "radiance is") for kind in (torch.uint8, torch.bool, torch.complex64)),
        (np.ma.masked_array(np.ones(SHAPE), mask=np.ones(SHAPE, bool)), "masked in part"),
    ],
)
def test_bad_light_is_named_and_steps_nothing(light: object, message: str) -> None:
    cameras = batch()
    with pytest.raises(InputError, match=message):
        cameras.step(light, 4)
    assert cameras.frame.tolist() == [0, 0, 0]


def test_bad_arguments_are_named() -> None:
    for changed, message in (
        ({"device": "tpu"}, "device = 'tpu'"),
        ({"seeds": ()}, "seeds"),
        ({"seeds": 3}, "seeds"),
        ({"seeds": (1, -1)}, "seed = -1"),
        ({"shape": (0, 4)}, "shape"),
        ({"models": ["scsim"]}, "1 models for 3 seeds"),
    ):
        with pytest.raises(InputError, match=message):
            batch(**changed)
    cameras = batch()
    with pytest.raises(InputError, match="frames"):
        cameras.step(np.ones(SHAPE), 0)
    with pytest.raises(InputError, match="2 seeds for 3 cameras"):
        cameras.reset((1, 2))
    with pytest.raises(InputError, match="mask"):
        cameras.reset(mask=[0, 1, 0])
    with pytest.raises(InputError, match=r"this state is of \(cameras, rows, columns\)"):
        cameras.restore(batch(seeds=(1, 2)).state())
    with pytest.raises(InputError, match="other models"):
        cameras.restore(batch("ideal").state())


def test_the_sensor_package_is_imported_without_torch() -> None:
    code = "import sys, spikecam_env.sensor; print('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.strip() == "False"


def test_a_batch_doubts_keys_relative_to_a_call_and_refuses_other_states() -> None:
    cameras, pictures = batch(), np.full((2, *SHAPE), 0.3, np.float32)
    cameras.step(Keyframes([0, 8], pictures), 8)
    with pytest.warns(UserWarning, match="the stream's absolute frames"):
        cameras.step(Keyframes([0, 8], pictures), 8)
    with pytest.raises(InputError, match="state is a dict"):
        cameras.restore({"frame": 0})  # type: ignore[arg-type]


def test_films_changed_in_place_are_seen_by_a_batch_with_optics() -> None:
    model = SensorModel.preset("scsim").with_effect(CATALOGUE["optical_blur"](sigma_pixels=1.0))
    changed, films = wild_film(16, 1), [wild_film(16, seed) for seed in (1, 2)]
    one, two = batch(model), batch(model)
    for film in (*films, *films):
        changed.radiance[:] = film.radiance
        equal(one.step(changed, 20), two.step(film, 20).numpy())
