"""A spike camera before any Gymnasium environment that renders itself.

    env = SpikeCamera(gymnasium.make("CartPole-v1", render_mode="rgb_array"), "tfp")

    step of the simulator ──picture──▶ light of step_s ──▶ sensor, frame by frame ──▶ last block ──▶ observation

The camera never pauses: it exposes every frame of a step, 800 of them where a step takes 20 ms.  Agents observe the
last block of these frames, `block_frames`; laws with a memory, such as intervals and denoised rates, see all of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from math import floor
from os import PathLike
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from scenes.exposure import checked_interval
from scenes.protocol import MOST_LIGHT
from spikecam_env.checked import (
    checked_count,
    checked_memory,
    checked_number,
    checked_seed,
    checked_shape,
    checked_switch,
)
from spikecam_env.envs.light_between import MakeLight, RenderedLight, usual_light
from spikecam_env.envs.observations import Blocks, CameraView, Observation, ObservedStream, observation
from spikecam_env.envs.reset_options import camera_options, loaded_model
from spikecam_env.envs.spike_camera import SpikeCameraEnv
from spikecam_env.errors import InputError, NotReadyError, OwnCodeError, shown
from spikecam_env.numbers import as_number
from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor
from spikecam_env.sensor.model import generator

SCALE = 0.6
"""[spikes/frame] of white where nothing else is said, as for films (`scenes.film.video`)."""
USUAL_BLOCK = 40
"""[frames] As `frames_per_step` of the environments: 1 ms at 40 kHz."""
LONGEST_STEP_S = 10.0
"""[s] Longest step: 400 000 frames at 40 kHz, which take a second of a core at 64 x 64."""
PIECE_FRAMES = 1024
"""[frames] Exposed at a time at most, so that a long step takes no more memory than a short one."""
CLOSE = 6
"""Decimals of a frame to which ends of steps are rounded: whole frames but for how they were computed."""


class SpikeCamera(gymnasium.Wrapper[Any, Any, Any, Any], gymnasium.utils.RecordConstructorArgs):
    """A spike camera sees the rendered pictures of an environment, and the agent observes its spikes by a law.

    Actions, rewards and ends are the environment's.  Same seed of `reset`, same actions: same bits, and the states of
    the environment without a camera.  `sensor`, `blocks` and `light` are open to look at.

    Observation:
        The law's, of the last `block_frames` frames of a step.  With `obs_state` or `obs_inner` a Dict: "picture";
        with `obs_state` "age" (1,) float32 [frames], see `observations.with_state_space`; with `obs_inner` "inner",
        the environment's own observation.
    Reset:
        Another unit of the camera (fixed pattern, phases, noise); it sees the first picture for the time of a step.
    Options:
        For this episode `model`, of the same frame rate, and `light`, a factor; the others are the environment's.
    Info:
        The environment's, with time_s, frame (end of the block), age [frames] of the picture and camera_bits that the
        observation's camera sent in the step in place of its own of these names.

    Args:
        env: with render mode "rgb_array", unless MuJoCo is inside or `make_light` needs no pictures.
        obs: a name of `observations.OBSERVATIONS`, or an `Observation`.
        obs_state: whether the age of the picture is observed too.
        obs_inner: whether the environment's own observation is observed too.
        shape: (rows, columns) of pixels; the whole picture falls on them, averaged over area.
        model: a preset's name, a TOML path or a SensorModel; it has the frame rate.
        block_frames: of the block that is observed, at most those of a step; default 40, or a whole shorter step.
        step_s: time of a step [s]; default `env.unwrapped.dt`, or 1 / `render_fps` of its metadata.
        scale: spikes a frame of white; default 0.6.
        mean_interval: expose in every episode so that pixels fire every so many frames on average over the first
            picture, in place of `scale`.
        transfer: from values of rendered pictures to linear light: "srgb" (default), "bt709", "linear", or a power,
            e.g. 2.2; whoever gives it has these pictures, of MuJoCo too.
        make_light: makes the light between two steps, see `light_between.MakeLight`; default: that of MuJoCo's poses
            where it is inside the environment, else pictures at their ends, blended.
        engine: of the sensor, "auto", "fast" or "reference".
        threads: of the sensor.

    Raises:
        InputError: for a value out of range or unknown, by name; where no time of a step is known; and for an
            environment that renders no pictures.
        NotReadyError: for a step before the first reset, and after `close`.

    Example:
        >>> import gymnasium
        >>> env = SpikeCamera(gymnasium.make("CartPole-v1", render_mode="rgb_array"), "tfp", shape=(32, 48))
        >>> picture, info = env.reset(seed=0)
        >>> picture.shape, env.frames_per_step, info["frame"]
        ((1, 32, 48), 800.0, 800)
        >>> env.close()
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        obs: str | Observation = "tfp",
        *,
        obs_state: bool = False,
        obs_inner: bool = False,
        shape: tuple[int, int] = (64, 64),
        model: SensorModel | str | PathLike[str] = "scsim",
        block_frames: int | None = None,
        step_s: float | None = None,
        scale: float | None = None,
        mean_interval: float | None = None,
        transfer: str | float | None = None,
        make_light: MakeLight | None = None,
        engine: str = "auto",
        threads: int | None = 1,
    ) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(
            self,
            obs=obs,
            obs_state=obs_state,
            obs_inner=obs_inner,
            shape=shape,
            model=model,
            block_frames=block_frames,
            step_s=step_s,
            scale=scale,
            mean_interval=mean_interval,
            transfer=transfer,
            make_light=make_light,
            engine=engine,
            threads=threads,
        )
        if not isinstance(env, gymnasium.Env):
            raise InputError(f"env = {shown(env)}; give one environment, and for vectors make_vec(..., wrappers=[...])")
        super().__init__(env)
        self.shape, self.model = checked_shape(shape), loaded_model(model)
        self.step_s = (
            step_time_s(env) if step_s is None else checked_number(step_s, "step_s", 0.0, above=True, unit="s")
        )
        self.frames_per_step = _checked_frames(self.step_s, self.model.frame_rate_hz)
        frames = _checked_block(block_frames, floor(round(self.frames_per_step, CLOSE)), self.shape)
        self.view = CameraView(self.shape, frames, self.model.frame_rate_hz)
        self._scale, self._mean_interval = _checked_exposure(scale, mean_interval)
        self._light_between = _light_maker(transfer, make_light)(env, self.view)
        if isinstance(self._light_between, RenderedLight):
            self.metadata = {**env.metadata, "render_modes": ["rgb_array"]}
        self._engine, self._threads = engine, threads
        self._sensor: SpikeSensor | None = self._unit_of(self.model, 0)
        self._rng = np.random.default_rng()
        self._gain = self._light_factor = 1.0
        self._steps = 0
        self._camera_seed = 0  # of this episode
        self._blocks: Blocks | None = None
        self._obs_inner = checked_switch(obs_inner, "obs_inner")
        self.observation = observation(obs)
        self._observed = ObservedStream(
            self.observation, self.view, obs_state=checked_switch(obs_state, "obs_state"), has_gaze=False
        )
        self.observation_space = self._space()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """A new episode, and another unit of the camera."""
        self._open()
        self._blocks = None  # after a reset that fails nothing can be stepped
        model, self._light_factor, others = camera_options(options, self.model)
        if seed is not None:
            seed = checked_seed(seed)
            self._rng = generator(seed, "spike camera of a simulator")
        inner, info = self.env.reset(seed=seed, options=others or None)
        self._camera_seed = int(self._rng.integers(2**31))
        self._sensor = self._unit_of(model, self._camera_seed)
        self._observed.begin()
        self._steps = 1
        light = _checked_light(self._light_between.begin(self._end))
        self._gain = self._light_factor * self._exposure(light)
        return self._seen(light, inner, info)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step the environment; the camera exposes the frames of that time."""
        self._check_begun()
        inner, reward, terminated, truncated, info = self.env.step(action)
        self._steps += 1
        observation, info = self._seen(_checked_light(self._light_between.step(self._end)), inner, info)
        return observation, reward, terminated, truncated, info

    def close(self) -> None:
        """Close the environment, and give back the sensor; may be called again."""
        self._sensor = self._blocks = None
        self._observed.end()
        self._light_between.close()
        super().close()

    @property
    def sensor(self) -> SpikeSensor:
        """The camera; NotReadyError after `close`."""
        return self._open()

    @property
    def blocks(self) -> Blocks:
        """The observed block and its light, a batch of one; NotReadyError before the first reset and after `close`."""
        self._check_begun()
        assert self._blocks is not None
        return self._blocks

    @property
    def light(self) -> Keyframes:
        """Light on the pixels in the last step; 1.0 makes the nominal pixel fire once a frame."""
        (light,) = self.blocks.light
        assert isinstance(light, Keyframes)
        return light

    @property
    def _end(self) -> float:
        """Of this step [frames]; the camera exposes the whole frames until then."""
        return round(self._steps * self.frames_per_step, CLOSE)

    def _seen(self, light: Keyframes, inner: Any, info: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
        """The observation and info after the exposure of all frames of a step."""
        sensor, scaled = self._open(), Keyframes.known(light.frame, light.radiance * np.float32(self._gain))
        for frames in _pieces(floor(self._end) - sensor.frame - self.view.frames_per_step):
            self._observed.skip(self._exposed(scaled, frames))
        self._blocks = self._exposed(scaled, self.view.frames_per_step)
        seen, own = self._observed.step(self._blocks)
        when = {"time_s": sensor.frame / self.view.frame_rate_hz, "frame": sensor.frame}
        return self._with_inner(seen, inner), info | own | when

    def _exposed(self, light: Keyframes, frames: int) -> Blocks:
        """The next frames, a batch of one."""
        spikes = self.sensor.step(light, frames)[None]
        return Blocks(spikes, (light,), self.view.frame_rate_hz, (self._camera_seed,))

    def _with_inner(self, seen: Any, inner: Any) -> Any:
        if not self._obs_inner:
            return seen
        return (seen if isinstance(seen, dict) else {"picture": seen}) | {"inner": inner}

    def _space(self) -> spaces.Space[Any]:
        own, inner = self._observed.space, self.env.observation_space
        if not self._obs_inner:
            return own
        return spaces.Dict({**(own if self._observed.obs_state else {"picture": own}), "inner": inner})  # type: ignore[dict-item]

    def _exposure(self, light: Keyframes) -> float:
        """By which light of which 1 is white is multiplied."""
        if self._mean_interval is None:
            return self._scale
        mean = float(light.radiance[-1].mean(dtype=np.float64))
        if not mean > 0:
            raise InputError("the first picture is black, so no light makes mean_interval; give scale instead")
        return 1.0 / (self._mean_interval * mean)

    def _unit_of(self, model: SensorModel, seed: int) -> SpikeSensor:
        return SpikeSensor(model, self.shape, seed, self._engine, threads=self._threads)

    def _open(self) -> SpikeSensor:
        if self._sensor is None:
            raise NotReadyError("the environment is closed; make a new one")
        return self._sensor

    def _check_begun(self) -> None:
        self._open()
        if self._blocks is None:
            raise NotReadyError("the environment has not begun; call reset first")


def spike_camera_of(env: Any) -> SpikeCameraEnv | SpikeCamera | None:
    """The spike camera of an environment: a wrapper's, or its own; None where it has none."""
    while isinstance(env, gymnasium.Wrapper) and not isinstance(env, SpikeCamera):
        env = env.env
    return env if isinstance(env, SpikeCameraEnv | SpikeCamera) else None


def step_time_s(env: gymnasium.Env[Any, Any]) -> float:
    """The time that a step of an environment takes [s]: its `dt`, else 1 / `render_fps`.

    Raises:
        InputError: it has neither, or it is no positive number.

    Example:
        >>> step_time_s(gymnasium.make("CartPole-v1"))
        0.02
    """
    bare = env.unwrapped
    dt, fps = getattr(bare, "dt", None), bare.metadata.get("render_fps")
    if dt is None and fps is None:
        raise InputError(
            "the environment has no dt and no render_fps, so the time of a step is not known; give step_s [s]"
        )
    name, value = ("dt", dt) if dt is not None else ("render_fps", fps)
    number = as_number(value)
    if not 0 < number < np.inf:
        raise InputError(f"the environment's {name} is {shown(value)}, which is no time of a step; give step_s [s]")
    return number if dt is not None else 1.0 / number


def _checked_frames(step_s: float, frame_rate_hz: float) -> float:
    """Frames of a step; InputError for less than one, and for more than those of LONGEST_STEP_S."""
    frames = step_s * frame_rate_hz
    if round(frames, CLOSE) < 1 or step_s > LONGEST_STEP_S:
        raise InputError(
            f"a step takes {step_s:g} s, {frames:g} frames of the camera; give step_s from {1 / frame_rate_hz:g} to "
            f"{LONGEST_STEP_S:g} s"
        )
    return frames


def _checked_block(block_frames: int | None, most: int, shape: tuple[int, int]) -> int:
    """Frames of the observed block."""
    frames = min(USUAL_BLOCK, most) if block_frames is None else checked_count(block_frames, "block_frames", most)
    checked_memory(max(frames, min(PIECE_FRAMES, most)) * shape[0] * shape[1], f"a block of {frames} frames")
    return frames


def _checked_exposure(scale: float | None, mean_interval: float | None) -> tuple[float, float | None]:
    if scale is not None and mean_interval is not None:
        raise InputError(f"scale is {shown(scale)} and mean_interval {shown(mean_interval)}; give one of the two")
    interval = None if mean_interval is None else checked_interval(mean_interval)
    return SCALE if scale is None else checked_number(scale, "scale", 0.0, MOST_LIGHT, above=True), interval


def _light_maker(transfer: str | float | None, make_light: MakeLight | None) -> MakeLight:
    if make_light is None:
        return usual_light if transfer is None else partial(RenderedLight, transfer=transfer)
    if transfer is not None:
        raise InputError(
            f"transfer is {shown(transfer)} and make_light is given, which has its own; give one of the two"
        )
    if not callable(make_light):
        raise InputError(f"make_light = {shown(make_light)}; give a function (env, view) -> LightBetween")
    return make_light


def _checked_light(light: Any) -> Keyframes:
    if not isinstance(light, Keyframes):
        raise OwnCodeError(f"the light between two steps is {shown(light)}; begin and step must return Keyframes")
    return light


def _pieces(frames: int) -> Iterator[int]:
    """Lengths of pieces of so many frames, PIECE_FRAMES at most."""
    for first in range(0, frames, PIECE_FRAMES):
        yield min(PIECE_FRAMES, frames - first)
