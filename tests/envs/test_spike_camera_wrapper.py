"""A spike camera before environments of other people: CartPole, and a small one whose pictures are known."""

from __future__ import annotations

import pickle
import warnings
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env

from denoiser import DenoiseObservation
from spikecam_env.envs.observations import TFP
from spikecam_env.envs.registration import register
from spikecam_env.envs.wrappers import ObserveSpikes, RandomizeLight, RandomizeSensor, SpikeCamera
from spikecam_env.errors import InputError, NotReadyError, OwnCodeError
from spikecam_env.sensor import Keyframes

register()
SIZE, SHAPE = (12, 16), (6, 8)
FRAMES = 100
"""Of a step of `Bar`."""


class Bar(gymnasium.Env[Any, Any]):
    """A white bar that starts at a drawn column and goes to the right by a column a step; over at the edge."""

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(self, dt: Any = FRAMES / 40_000, render_mode: str | None = "rgb_array", show: Any = None) -> None:
        if dt is not None:
            self.dt = dt
        self.render_mode, self._show = render_mode, show
        self.observation_space, self.action_space = spaces.Discrete(SIZE[1]), spaces.Discrete(2)
        self._column, self._rng = 0, np.random.default_rng()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self._column = (options or {}).get("column", int(self.np_random.integers(4)))
        return np.int64(self._column), {"column": self._column}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self._column += 1
        over = self._column == SIZE[1] - 1
        return np.int64(self._column), float(action), over, self._column == 10, {"column": self._column}

    def render(self) -> Any:
        if self._show is not None:
            return self._show(self._column) if callable(self._show) else self._show
        picture = np.full((*SIZE, 3), 51, np.uint8)
        picture[:, self._column] = 255
        return picture


def camera(obs: Any = "tfp", bar: dict[str, Any] | None = None, **options: Any) -> SpikeCamera:
    return SpikeCamera(Bar(**(bar or {})), obs, **{"shape": SHAPE, **options})


def cart(**options: Any) -> SpikeCamera:
    return SpikeCamera(gymnasium.make("CartPole-v1", render_mode="rgb_array"), **{"shape": (16, 24), **options})


def played(env: Any, steps: int = 4, seed: int = 0) -> list[Any]:
    """The observations of an episode."""
    seen = [env.reset(seed=seed)[0]]
    return seen + [env.step(1)[0] for _ in range(steps)]


@pytest.mark.parametrize("options", [{}, {"obs": "spikes"}, {"obs_state": True, "obs_inner": True}], ids=str)
def test_the_checker_of_gymnasium_passes(options: dict[str, Any]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that the environment has a wrapper, and CartPole's space no end
        check_env(cart(**options))
        check_env(camera(**options))


def test_a_white_pixel_fires_at_the_scale_and_grey_at_its_linear_light() -> None:
    env = camera("spikes", {"show": np.full((*SIZE, 3), (255, 255, 255), np.uint8)}, model="ideal", scale=0.25)
    spikes, _ = env.reset(seed=0)
    assert (spikes.sum(axis=0) == 10).all()
    grey = camera("spikes", {"show": np.full(SIZE, 0.5)}, model="ideal", scale=0.25, transfer=2.0)
    assert (grey.reset(seed=0)[0].sum(axis=0) * 4 // 10).max() <= 1 and float(grey.light.radiance[0, 0, 0]) == 0.0625


def test_pixels_average_linear_light_over_their_area_and_colour_is_luminance() -> None:
    picture = np.zeros((*SIZE, 3), np.uint8)
    picture[:, ::2, 1] = 255  # of the two columns of every pixel one is green
    env = camera(bar={"show": picture}, scale=1.0)
    env.reset(seed=0)
    np.testing.assert_allclose(env.light.radiance[-1], 0.7152 / 2, rtol=1e-6)


def test_light_is_linear_in_time_between_two_pictures() -> None:
    env = camera(scale=1.0)
    env.reset(seed=0, options={"column": 0})
    first = env.light.at(FRAMES)
    env.step(0)
    env.step(0)
    light, last = env.light, np.roll(first, 1, axis=1)
    np.testing.assert_allclose(light.at(3 * FRAMES), last, rtol=1e-6)
    middle = light.at(2.5 * FRAMES)
    np.testing.assert_allclose(middle, 0.5 * (light.at(2 * FRAMES) + last), rtol=1e-6)
    assert env.blocks.spikes.shape == (1, 40, *SHAPE) and env.sensor.frame == 3 * FRAMES


def test_the_mean_interval_is_that_of_the_first_picture() -> None:
    env = camera("spikes", mean_interval=10.0, block_frames=FRAMES, model="ideal")
    rate = float(env.reset(seed=0)[0].mean())
    print(f"mean rate {rate:.4f}")
    assert rate == pytest.approx(0.1, abs=1 / FRAMES)  # a pixel counts its spikes to one
    assert 1 / float(env.light.radiance[-1].mean()) == pytest.approx(10.0)


@pytest.mark.parametrize("obs", ["spikes", TFP(window=70), "tfi", "isi", "frame1000"], ids=str)
def test_the_length_of_the_block_changes_nothing_else(obs: Any) -> None:
    """Laws with a memory see all frames, and a shorter block is the end of a longer one."""
    short, long = played(camera(obs)), played(camera(obs, block_frames=FRAMES))
    for a, b in zip(short, long, strict=True):
        np.testing.assert_array_equal(a, b[-40:] if obs == "spikes" else b)


def test_long_steps_are_exposed_in_pieces_with_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = played(camera("tfi"))
    monkeypatch.setattr("spikecam_env.envs.wrappers.any_env.PIECE_FRAMES", 7)
    np.testing.assert_array_equal(whole, played(camera("tfi")))


def test_steps_of_no_whole_number_of_frames_keep_time() -> None:
    env = camera(step_s=1 / 60)
    ends = [env.reset(seed=0)[1]["frame"]] + [env.step(0)[4]["frame"] for _ in range(5)]
    assert ends == [666, 1333, 2000, 2666, 3333, 4000]


@pytest.mark.parametrize(
    "given, step_s",
    [({"dt": 0.001}, 0.001), ({"dt": np.float32(0.5)}, 0.5)],
)
def test_the_time_of_a_step_is_dt(given: dict[str, Any], step_s: float) -> None:
    assert camera(bar=given).step_s == step_s


def test_without_dt_the_time_of_a_step_is_that_of_the_rate_of_pictures() -> None:
    assert cart().step_s == 1 / 50 and cart(step_s=0.004).step_s == 0.004


def test_the_simulator_does_what_it_does_without_a_camera() -> None:
    bare, seen = gymnasium.make("CartPole-v1"), cart(obs_inner=True)
    for seed in (3, None):
        expected, observed = bare.reset(seed=seed)[0], seen.reset(seed=seed)[0]["inner"]
        np.testing.assert_array_equal(expected, observed)
        for action in (0, 1, 1):
            (a, *ends, _), (b, *same, _) = bare.step(action), seen.step(action)
            np.testing.assert_array_equal(a, b["inner"])
            assert ends == same


def test_rewards_ends_infos_and_pictures_are_the_simulators() -> None:
    env = camera(obs_state=True)
    seen, info = env.reset(seed=0, options={"column": 8})
    assert set(seen) == {"picture", "age"} and seen["age"] == 0
    bits = float(FRAMES * SHAPE[0] * SHAPE[1])
    assert info == {"column": 8, "time_s": FRAMES / 40_000, "frame": FRAMES, "age": 0.0, "camera_bits": bits}
    outcomes = [env.step(action)[1:4] for action in (1, 0, 1)]
    assert outcomes == [(1.0, False, False), (0.0, False, True), (1.0, False, False)]
    np.testing.assert_array_equal(env.render(), env.unwrapped.render())  # type: ignore[arg-type]


def test_a_seed_is_an_episode_and_a_camera_to_the_bit() -> None:
    env = camera("spikes")
    first, again, other = played(env), played(env), played(env, seed=1)
    np.testing.assert_array_equal(first, again)
    assert (first[0] != other[0]).any()
    env.reset(seed=0)
    drawn = env.reset()[0]
    assert (drawn != first[0]).any(), "without a seed another unit"


def test_a_pickled_environment_goes_on_with_the_same_bits() -> None:
    env = camera("tfi")
    played(env)
    copied = pickle.loads(pickle.dumps(env))
    np.testing.assert_array_equal(env.step(0)[0], copied.step(0)[0])


def test_options_change_model_and_light_of_an_episode() -> None:
    env = camera("spikes", model="ideal", bar={"show": np.ones(SIZE)}, scale=0.5, block_frames=FRAMES)
    assert env.reset(seed=0)[0].mean() == 0.5 and env.reset(seed=0, options={"light": 0.5})[0].mean() == 0.25
    env.reset(seed=0, options={"model": "scsim"})
    assert env.sensor.model.effects
    env.reset(seed=0)
    assert not env.sensor.model.effects


def test_our_other_wrappers_take_it() -> None:
    lights = RandomizeLight(camera(model="ideal"), (0.1, 0.5))
    lights.reset(seed=0)
    assert 0.06 <= float(lights.env.light.radiance.max()) <= 0.3  # type: ignore[attr-defined]  # of white, 0.6
    sensors = RandomizeSensor(camera(model="ideal"), {"dead_time.tau_us": (0.5, 2.0)})
    sensors.reset(seed=0)
    assert [effect.name for effect in sensors.env.sensor.model.effects] == ["dead_time"]  # type: ignore[attr-defined]


@pytest.mark.parametrize("obs", ["tfp", "tfi", "frame1000"])
def test_whole_steps_of_spikes_may_be_observed_by_another_wrapper(obs: str) -> None:
    whole = {"block_frames": FRAMES}
    for a, b in zip(played(ObserveSpikes(camera("spikes", **whole), obs)), played(camera(obs, **whole)), strict=True):
        np.testing.assert_array_equal(a, b)
    for wrapped in (partial(ObserveSpikes, obs=obs), DenoiseObservation):
        with pytest.raises(InputError, match=r"shows 40 of the 100 frames of a step.*give obs= to SpikeCamera itself"):
            wrapped(camera("spikes"))


class Lamp:
    """Light of a user's own: brighter with every frame, whatever is rendered."""

    def __init__(self, env: Any, view: Any) -> None:
        self.shape = view.shape

    def begin(self, frame: float) -> Keyframes:
        return self.step(frame)

    def step(self, frame: float) -> Keyframes:
        keys = np.array([max(0, frame - FRAMES), frame], np.float64)
        return Keyframes(keys, np.broadcast_to(keys[:, None, None] / 1e3, (2, *self.shape)).astype(np.float32))

    def close(self) -> None:
        self.shape = (0, 0)


def test_a_light_of_one_s_own_needs_no_pictures() -> None:
    env = camera(make_light=Lamp, bar={"render_mode": None}, scale=1.0)
    env.reset(seed=0)
    env.step(0)
    assert env.light.at(150.0)[0, 0] == pytest.approx(0.15)


def test_a_light_that_is_none_is_named() -> None:
    class Dark(Lamp):
        def begin(self, frame: float) -> Any:
            return None

    with pytest.raises(OwnCodeError, match="the light between two steps is None; begin and step must return Keyframes"):
        camera(make_light=Dark).reset()


def test_mujoco_inside_is_seen_between_its_steps_without_rendering() -> None:
    pytest.importorskip("mujoco", reason="needs mujoco")
    env = SpikeCamera(gymnasium.make("InvertedPendulum-v5", reset_noise_scale=0.1), "tfp", shape=(64, 64))
    bare = gymnasium.make("InvertedPendulum-v5", reset_noise_scale=0.1)
    bare.reset(seed=0)
    env.reset(seed=0)
    force = np.full(1, 3.0, np.float32)
    for _ in range(2):
        env.step(force)
        bare.step(force)
    np.testing.assert_array_equal(env.unwrapped.data.qpos, bare.unwrapped.data.qpos)  # type: ignore[attr-defined]
    assert env.step_s == 0.04 and env.light.frame[[0, -1]].tolist() == [3200.0, 4800.0]
    print(f"{len(env.light.frame)} keys a step")
    assert len(env.light.frame) > 2 and env.render_mode is None
    assert float(np.ptp(env.light.radiance)) > 0.1
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        check_env(env, skip_render_check=True)
    env.close()


@pytest.mark.parametrize(
    "name, package",
    [("Ant-v5", ""), ("PointMaze_UMaze-v3", "gymnasium_robotics"), ("AdroitHandDoor-v1", "gymnasium_robotics")],
)
def test_robots_of_gymnasium_pass_its_checker_and_their_motion_is_seen(name: str, package: str) -> None:
    """With all that is observed.  Fetch, hands and kitchen of Gymnasium-Robotics 1.4.2 do not start in MuJoCo 4."""
    pytest.importorskip("mujoco", reason="needs mujoco")
    if package:
        gymnasium.register_envs(pytest.importorskip(package, reason=f"needs {package}: pip install gymnasium-robotics"))
    env = SpikeCamera(gymnasium.make(name), "tfp", shape=(32, 32), obs_state=True, obs_inner=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that the environment has a wrapper, and its own space no end
        check_env(env, skip_render_check=True)
    seen, _ = env.reset(seed=0)
    first = env.light.radiance[-1]
    for _ in range(10):
        seen, _, _, _, info = env.step(env.action_space.high)  # type: ignore[attr-defined]
    change = float(np.abs(env.light.radiance[-1] - first).max())
    print(f"{name}: {seen['picture'].mean():.0f} of 255, light changed by up to {change:.2f} of white")
    assert seen["picture"].any() and change > 0.05
    assert (
        info["time_s"] == pytest.approx(11 * env.step_s, abs=1 / 40_000) and seen["inner"] in env.env.observation_space
    )
    env.close()


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_a_vector_is_a_vector_of_single_environments(mode: str) -> None:
    gymnasium.register("tests/Bar-v0", entry_point=lambda **given: Bar(**given), max_episode_steps=8)
    try:
        wrapped = [partial(SpikeCamera, obs="tfi", shape=SHAPE)]
        cameras = gymnasium.make_vec("tests/Bar-v0", 2, mode, wrappers=wrapped, render_mode="rgb_array")
        seen = [cameras.reset(seed=5)[0]] + [cameras.step(np.array([1, 0]))[0] for _ in range(3)]
        np.testing.assert_array_equal(np.stack(seen)[:, 1], played(camera("tfi"), steps=3, seed=6))
        cameras.close()
    finally:
        del gymnasium.registry["tests/Bar-v0"]


def test_learners_of_stable_baselines_train_on_it() -> None:
    ppo = pytest.importorskip("stable_baselines3", reason="needs stable-baselines3").PPO
    model = ppo("CnnPolicy", camera(shape=(36, 36)), n_steps=64, batch_size=64, n_epochs=1, seed=0, device="cpu")
    model.learn(256)
    assert model.num_timesteps == 256 and model.ep_info_buffer


def test_specs_of_torchrl_are_those_of_what_is_returned() -> None:
    torchrl = pytest.importorskip("torchrl.envs", reason="needs torchrl")
    from torchrl.envs.utils import check_env_specs

    check_env_specs(torchrl.GymWrapper(camera(obs_state=True)))


@pytest.mark.parametrize(
    "bar, options, message",
    [
        ({"render_mode": None}, {}, r'render_mode is None; .* make the environment with render_mode="rgb_array"'),
        ({"dt": None}, {}, r"no dt and no render_fps.*; give step_s \[s\]"),
        ({"dt": "fast"}, {}, r"dt is 'fast', which is no time of a step; give step_s"),
        ({"dt": -0.1}, {}, r"dt is -0.1, which is no time of a step; give step_s"),
        ({"dt": 900.0}, {}, r"a step takes 900 s, 3.6e\+07 frames .*give step_s from 2.5e-05 to 10 s"),
        ({}, {"step_s": 1e-6}, "a step takes 1e-06 s, 0.04 frames .*give step_s"),
        ({}, {"step_s": float("nan")}, "step_s = nan"),
        ({}, {"obs": "tpf"}, r"unknown obs 'tpf'.*\(tfp\?\)"),
        ({}, {"obs": 3}, "obs = 3; give a name"),
        ({}, {"block_frames": 101}, "block_frames = 101; it must be a whole number, 1 to 100"),
        ({}, {"scale": 0.0}, "scale = 0.0"),
        ({}, {"scale": 1e300}, r"scale = 1e\+300"),
        ({}, {"scale": 0.5, "mean_interval": 10.0}, "give one of the two"),
        ({}, {"mean_interval": 0.5}, "mean_interval = 0.5"),
        ({}, {"transfer": "rgb"}, r"unknown transfer 'rgb'"),
        ({}, {"transfer": -1}, r"unknown transfer"),
        ({}, {"transfer": ["srgb"]}, r"unknown transfer"),
        ({}, {"transfer": "srgb", "make_light": Lamp}, "give one of the two"),
        ({}, {"make_light": "mujoco"}, "make_light = 'mujoco'; give a function"),
        ({}, {"obs_inner": "yes"}, "obs_inner = 'yes'; it must be True or False"),
        ({}, {"model": "scism"}, "scism"),
        ({}, {"shape": (0, 3)}, "shape = "),
    ],
)  # fmt: skip
def test_wrong_arguments_are_named(bar: dict[str, Any], options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        camera(bar=bar, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "show, message",
    [
        ("a picture", r"render\(\) returned 'a picture'; it must return an array"),
        (np.zeros(3, np.uint8), r"render\(\) returned an array \(3,\)"),
        (np.zeros((0, 3), np.uint8), r"render\(\) returned an array \(0, 3\)"),
        (np.zeros((*SIZE, 4), np.uint8), r"returned a picture that is none: frame has shape \(12, 16, 4\)"),
        (np.zeros(SIZE, np.int64), "returned a picture that is none: frame is int64"),
        (np.full(SIZE, np.nan), "returned a picture that is none: frame: its values run from nan to nan"),
        (np.full(SIZE, 200.0), "returned a picture that is none: frame: its values run from 200 to 200"),
    ],
    ids=str,
)
def test_pictures_that_are_none_are_named(show: Any, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        camera(bar={"show": show}).reset(seed=0)
    assert "\n" not in str(caught.value)


def test_a_picture_that_changes_its_size_and_a_black_one_are_named() -> None:
    env = camera(bar={"show": lambda column: np.ones((4 + column, 4))})
    env.reset(options={"column": 0})
    with pytest.raises(InputError, match=r"a picture \(5, 4\), the one before is \(4, 4\); render one size"):
        env.step(0)
    with pytest.raises(InputError, match=r"the first picture is black.*give scale"):
        camera(bar={"show": np.zeros(SIZE)}, mean_interval=10.0).reset()


def test_other_things_than_one_environment_and_other_seeds_are_named() -> None:
    for env in (None, "CartPole-v1", gymnasium.make_vec("CartPole-v1", 2, "sync", render_mode="rgb_array")):
        with pytest.raises(InputError, match=r"env = .*; give one environment, and for vectors make_vec"):
            SpikeCamera(env)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="seed = -1"):
        camera().reset(seed=-1)


def test_calls_in_the_wrong_order_are_named() -> None:
    env = camera()
    for call in (lambda: env.step(0), lambda: env.blocks):
        with pytest.raises(NotReadyError, match="call reset first"):
            call()
    env.reset()
    env.close()
    env.close()
    for call in (lambda: env.step(0), lambda: env.reset(), lambda: env.sensor):
        with pytest.raises(NotReadyError, match="is closed; make a new one"):
            call()
