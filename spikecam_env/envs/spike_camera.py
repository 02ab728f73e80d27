"""A spike camera in front of a scene, as a Gymnasium environment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import isfinite
from os import PathLike
from typing import Any, ClassVar, TypeVar

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from scenes.exposure import lit
from scenes.flat.painted_disk import Plane
from scenes.flat.planes import PlanarScene, painted_planes
from scenes.protocol import Gaze, Scene
from scenes.renderers.shared import register_user, release_user
from spikecam_env.checked import checked_memory, checked_seed, checked_shape, checked_switch
from spikecam_env.envs.action import checked_action
from spikecam_env.envs.keywords import check_keywords
from spikecam_env.envs.motor import turned
from spikecam_env.envs.observations import Blocks, CameraView, Observation, ObservedStream, observation
from spikecam_env.envs.reset_options import camera_options, loaded_model
from spikecam_env.errors import InputError, NotReadyError, OwnCodeError, shown, unknown_name
from spikecam_env.numbers import as_number
from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor, step_together

MakeScene = Callable[[np.random.Generator, dict[str, Any]], Scene]
"""(generator, options of reset) -> the scene of one episode."""

Judge = Callable[[Any, float, Gaze], tuple[float, bool]]
"""(scene, frame, gaze) at the end of a step -> (reward, terminated)."""

T = TypeVar("T")
ForEach = Callable[[Callable[[int], Any], Sequence[int]], list[Any]]
"""(work, numbers) -> the results of work, one a number."""
Paint = Callable[[list[Plane]], list[Keyframes]]
"""Planes -> the light of each, on the processor or on a device."""


def in_turn(work: Callable[[int], T], numbers: Sequence[int]) -> list[T]:
    """Work of each number, one after another."""
    return [work(number) for number in numbers]


RENDER_FRAMES = 40
"""Frames a rendered picture counts spikes over, at least."""


class SpikeCameraEnv(gymnasium.Env[Any, NDArray[np.float32]]):
    """Each step exposes `frames_per_step` spike frames while the camera turns at the rate the action gives.

    `sensor`, `scene` and `blocks` are open to look at: `env.unwrapped.sensor.clean_twin()`,
    `env.unwrapped.scene.truth(...)`, `env.unwrapped.blocks.spikes`.

    Observation:
        By default "spikes", the step's frames, (K, H, W) int8 of 0 and 1; a fresh array each step. With `obs_state` a
        Dict: picture, gaze, age (`observations.with_state_space`).
    Action:
        (2,) float32, gaze rate (pan, tilt) in [-1, 1] of `max_gaze_rate_px_s`; pan is to the right, tilt is down.
        Values beyond are cut, as a motor saturates.
    Reward:
        From `judge`, as the end of the episode is.
    Reset:
        Draws the scene and the camera's unit (fixed pattern, phases, noise) from `np_random`, then exposes the first K
        frames with the camera at rest. Same seed, same actions: same bits.
    Options:
        For this episode, `model` (as below, of the same frame rate), `light`, a factor on the scene's light; the others
        are the scene's.
    Info:
        time_s, frame (end of the block), gaze (2,) float64 [pixels] there, age [frames] of the picture (-1 before the
        first valid one), camera_bits that the observation's camera sent in the step; with `ground_truth` also radiance,
        flow, object_id at the centre of the block and poses, see `scenes.protocol.Truth`.
    Render:
        `rgb_array`, the share of frames with a spike, over the last blocks of RENDER_FRAMES or more; white is a spike
        every frame, gamma 2.2.

    Args:
        make_scene: see `MakeScene`; its scenes have this `shape` and the model's frame rate.
        judge: see `Judge`.
        shape: (rows, columns).
        model: a preset's name, a TOML path or a SensorModel.
        frames_per_step: K; the control rate is frame rate / K.
        packed: the same as obs="packed".
        obs: a name of `observations.OBSERVATIONS` or an `Observation`; default `usual_obs` of the class.
        obs_state: whether gaze and age of the picture are observed beside it.
        ground_truth: whether infos hold the truth.
        max_gaze_rate_px_s: default 4 of the shorter side a second.
        engine: of the sensor, "auto", "fast" or "reference".
        threads: of the sensor, as of `SpikeSensor`.
        render_mode: "rgb_array" or None.

    Raises:
        InputError: for a value out of range or unknown, by name.
        NotReadyError: before the first reset and after `close`.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 25}  # noqa: RUF012
    usual_obs: ClassVar[str] = "spikes"
    """Name of the observation where none is given."""
    settles: ClassVar[tuple[str, ...]] = ()
    """Keywords of parents that this class sets itself, so that its users cannot."""

    def __init__(
        self,
        make_scene: MakeScene,
        judge: Judge,
        *,
        shape: tuple[int, int] = (250, 400),
        model: SensorModel | str | PathLike[str] = "scsim",
        frames_per_step: int = 40,
        packed: bool = False,
        obs: str | Observation | None = None,
        obs_state: bool = False,
        ground_truth: bool = False,
        max_gaze_rate_px_s: float | None = None,
        engine: str = "auto",
        threads: int | None = None,
        render_mode: str | None = None,
        **unknown: Any,
    ) -> None:
        check_keywords(type(self), unknown)
        self.shape = checked_shape(shape)
        if not (as_number(frames_per_step) >= 1 and as_number(frames_per_step).is_integer()):
            raise InputError(f"frames_per_step is {shown(frames_per_step)}; it must be a whole number, 1 or more")
        self.frames_per_step = int(frames_per_step)
        checked_memory(self.frames_per_step * self.shape[0] * self.shape[1], f"a step of {self.frames_per_step} frames")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise unknown_name("render_mode", render_mode, self.metadata["render_modes"])
        rate = 4.0 * min(self.shape) if max_gaze_rate_px_s is None else max_gaze_rate_px_s
        if not 0 < as_number(rate) < np.inf:
            raise InputError(f"max_gaze_rate_px_s is {shown(rate)}; it must be positive and finite")
        self.max_gaze_rate_px_s = rate
        self.model = loaded_model(model)
        self.ground_truth = checked_switch(ground_truth, "ground_truth")
        self.render_mode = render_mode
        self._make_scene, self._judge = make_scene, judge
        self._engine, self._threads = engine, threads
        self._sensor: SpikeSensor | None = self._unit_of(self.model, seed=0)
        self._scene: Scene | None = None
        self._drawn: Any = None  # the scene as it was drawn, in its own light
        self._blocks: Blocks | None = None
        self._camera_seed = 0  # of this episode
        self._gaze = Gaze.fixed(0.0, 0.0)  # the path of the block that is exposed last, or next
        self._recent: list[NDArray[np.uint8]] = []
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        is_packed = checked_switch(packed, "packed")
        self.observe(_observation(obs, is_packed, self.usual_obs), checked_switch(obs_state, "obs_state"))

    def observe(self, law: Observation, obs_state: bool = False) -> None:
        """Set the observation, and its space.

        Args:
            law: makes pictures of blocks of spikes.
            obs_state: whether gaze and age of the picture are observed beside it.
        """
        self._observed = ObservedStream(law, self.view, obs_state=obs_state)
        self.observation, self.obs_state = law, obs_state
        self.observation_space: spaces.Space[Any] = self._observed.space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """A new episode; `options` but for `model` and `light` go to `make_scene`."""
        self.begin(seed=seed, options=options)
        expose([self])
        return self.begun()

    def step(self, action: ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Turn the camera at the action's rate for K frames.  Never truncates: that is `TimeLimit`'s."""
        self.turn(action)
        expose([self])
        return self.outcome()

    def begin(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Begin an episode, up to the exposure of its first block.

        `reset` calls `begin` and `begun`, `step` calls `turn` and `outcome`; a task overrides these four.  Between the
        two, a vector environment exposes the blocks of all its cameras in one call (`expose`).

        Args:
            seed: as of `reset`.
            options: as of `reset`.
        """
        self._open()
        model, light, given = camera_options(options, self.model)
        super().reset(seed=None if seed is None else checked_seed(seed))
        register_user(self)
        self._drawn = self._checked(self._make_scene(self.np_random, given))
        self._scene = lit(self._drawn, light)
        self._camera_seed = int(self.np_random.integers(2**31))
        self._load(model, self._camera_seed)
        self._observed.begin()
        self._recent = []
        self._gaze = Gaze((0.0, 0.0), (0.0, 0.0), (0.0, float(self.frames_per_step)))

    def begun(self) -> tuple[Any, dict[str, Any]]:
        """The return value of `reset`, from the first block."""
        return self._shown()

    def turn(self, action: ArrayLike) -> None:
        """Set the path of the camera for the next block."""
        rates = checked_action(action, 2, "(pan, tilt)")
        frames = self.sensor.frame, self.sensor.frame + self.frames_per_step
        self._gaze = turned(self._position, rates, self.max_gaze_rate_px_s / self.model.frame_rate_hz, frames)

    def outcome(self) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """The return value of `step`, from the exposed block."""
        observation, info = self._shown()
        reward, terminated = _checked_verdict(self._judge(self._drawn, self.sensor.frame, self._gaze))
        return observation, reward, terminated, False, info

    def render(self) -> NDArray[np.uint8] | None:
        """(H, W, 3) uint8, or None without a render mode."""
        if self.render_mode is None:
            return None
        if not self._recent:
            raise self._not_ready()
        frames = sum(len(block) for block in self._recent)
        rate = sum(block.sum(axis=0, dtype=np.float32) for block in self._recent) / frames
        grey = (255 * rate ** (1 / 2.2) + 0.5).astype(np.uint8)
        return np.repeat(grey[:, :, None], 3, axis=2)

    def close(self) -> None:
        """Give back the sensor, the scene and, with the last environment of the thread, the renderer.

        May be called again; anything else after it raises NotReadyError.
        """
        self._sensor = self._scene = self._drawn = self._blocks = None
        self._recent = []
        self._observed.end()
        release_user(self)

    @property
    def view(self) -> CameraView:
        """The camera, as observations know it."""
        return CameraView(self.shape, self.frames_per_step, self.model.frame_rate_hz)

    @property
    def sensor(self) -> SpikeSensor:
        """The camera; NotReadyError after `close`."""
        return self._open()

    @property
    def blocks(self) -> Blocks:
        """The last block, a batch of one; NotReadyError before the first reset and after `close`."""
        if self._blocks is None:
            raise self._not_ready()
        return self._blocks

    @property
    def scene(self) -> Scene:
        """Of this episode; NotReadyError before the first reset and after `close`."""
        if self._scene is None:
            raise self._not_ready()
        return self._scene

    def _open(self) -> SpikeSensor:
        if self._sensor is None:
            raise self._not_ready()
        return self._sensor

    def _load(self, model: SensorModel, seed: int) -> None:
        """Another unit, of this model, at frame 0."""
        if model == self.sensor.model:
            self.sensor.reset(seed=seed)
        else:
            self._sensor = self._unit_of(model, seed)

    def _unit_of(self, model: SensorModel, seed: int) -> SpikeSensor:
        return SpikeSensor(model, self.shape, seed, self._engine, threads=self._threads)

    def _not_ready(self) -> NotReadyError:
        if self._sensor is None:
            return NotReadyError("the environment is closed; make a new one")
        return NotReadyError("the environment has no scene yet; call reset first")

    @property
    def _position(self) -> tuple[float, float]:
        """Where the camera looks, (pan, tilt) [pixels]."""
        return self._gaze.stop

    @property
    def renders(self) -> bool:
        """Whether the scene is more than a plane: its light and truth belong to the thread that it was made on."""
        return not isinstance(self.scene, PlanarScene)

    @property
    def next_block(self) -> tuple[int, int, Gaze]:
        """First frame, frame after the last, and path of the camera, of the next block."""
        first, stop = self._gaze.frames
        return int(first), int(stop), self._gaze

    def use_sensor(self, sensor: Any) -> None:
        """Set another camera, which has `frame`, `model` and `reset(seed)`: one of a batch on a device."""
        self._sensor = sensor

    def record(self, light: Keyframes, spikes: NDArray[np.uint8]) -> None:
        """Keep the exposed block: spikes (K, H, W)."""
        self._blocks = Blocks(spikes[None], (light,), self.model.frame_rate_hz, (self._camera_seed,))
        if self.render_mode is not None:
            blocks = -(-RENDER_FRAMES // self.frames_per_step)
            self._recent = [*self._recent, spikes.copy()][-blocks:]

    def _shown(self) -> tuple[Any, dict[str, Any]]:
        """The observation of the last block, and its info."""
        observation, own = self._observed.step(self.blocks, self._gaze.stop)
        return observation, self._info() | own

    def _info(self) -> dict[str, Any]:
        gaze = self._gaze
        first, stop = gaze.frames
        info: dict[str, Any] = {
            "time_s": float(stop / self.model.frame_rate_hz),
            "frame": int(stop),
            "gaze": np.array(gaze.stop),
        }
        if self.ground_truth:
            truth = self.scene.truth((first + stop) / 2, gaze)
            info |= {"radiance": truth.radiance, "flow": truth.flow, "object_id": truth.object_id}
            info["poses"] = {name: np.array(pose) for name, pose in truth.poses.items()}
        return info

    def _checked(self, scene: Scene) -> Scene:
        rate = self.model.frame_rate_hz
        if not isinstance(scene, Scene):
            raise OwnCodeError(f"make_scene returned a {type(scene).__name__}; it must return a scene (scenes.Scene)")
        if (scene.shape, scene.frame_rate_hz) != (self.shape, rate):
            raise InputError(
                f"the scene is {scene.shape} at {scene.frame_rate_hz} Hz; the camera {self.shape} at {rate} Hz"
            )
        return scene


def _checked_verdict(verdict: Any) -> tuple[float, bool]:
    """The verdict of a judge; OwnCodeError unless it is a finite reward and whether the episode is over."""
    reward, terminated = verdict if isinstance(verdict, tuple) and len(verdict) == 2 else (None, None)
    number = as_number(reward)
    if not isfinite(number) or not isinstance(terminated, bool | np.bool_ | int):
        raise OwnCodeError(f"judge returned {shown(verdict)}; it must return (reward, terminated): a number and a bool")
    return number, bool(terminated)


def expose(
    envs: Sequence[SpikeCameraEnv],
    *,
    outs: Sequence[NDArray[np.uint8] | None] | None = None,
    threads: int | None = 1,
    each: ForEach = in_turn,
) -> None:
    """Expose the next block of every environment: planes are painted in one call, cameras stepped in one call.

    Args:
        envs: whose cameras expose, each along its path.
        outs: arrays (K, H, W) uint8 for the spikes.
        threads: of these calls.
        each: calls a function of the number of each scene that is no plane.
    """
    lights = lights_of(envs, partial(painted_planes, threads=threads), each)
    spikes = step_together([env.sensor for env in envs], lights, envs[0].frames_per_step, outs=outs, threads=threads)
    for env, own, block in zip(envs, lights, spikes, strict=True):
        env.record(own, block)


def lights_of(envs: Sequence[SpikeCameraEnv], paint: Paint, each: ForEach = in_turn) -> list[Keyframes]:
    """The light of the next block of every environment; `each` as of `expose`."""
    flat = [n for n, env in enumerate(envs) if not env.renders]
    other = [n for n, env in enumerate(envs) if env.renders]
    planes = [envs[n].scene.plane(*envs[n].next_block) for n in flat]  # type: ignore[attr-defined]
    light = dict(zip(flat, paint(planes), strict=True))
    light |= dict(zip(other, each(lambda n: envs[n].scene.radiance(*envs[n].next_block), other), strict=True))
    return [light[n] for n in range(len(envs))]


def _observation(obs: str | Observation | None, packed: bool, usual: str) -> Observation:
    if packed and obs not in (None, "packed"):
        raise InputError(f"packed is True and obs is {shown(obs)}; give one of the two")
    return observation("packed" if packed else usual if obs is None else obs)
