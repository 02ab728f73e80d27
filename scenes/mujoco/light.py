"""Light of a MuJoCo simulation between two steps of its environment: so many keys that nothing jumps from key to key.

    begin(frame) -> the environment steps -> step(frame): replay, ways in pixels, keys, pictures

Keys lie on whole frames where the fastest thing moves less than `motion_per_key` a frame, else between them too.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from scenes.mujoco.cameras import camera_of
from scenes.mujoco.importing import import_mujoco
from scenes.mujoco.motion import Boxes, path_lengths
from scenes.mujoco.pictures import MujocoPictures, checked_data
from scenes.mujoco.replay import Course, State, pose_at, posed, replay
from scenes.protocol import FRAME_RATES_HZ, MOST_LIGHT
from spikecam_env.checked import checked_memory, checked_number
from spikecam_env.errors import NotReadyError
from spikecam_env.sensor import Keyframes
from spikecam_env.types import Floats, Pictures

MOTION_PER_KEY = 0.5
"""[pixels] from key to key; between them light is blended."""
_WHOLE = 1e-6
"""Frames by which a step's end, computed from seconds, may miss a whole number."""


class CameraSize(Protocol):
    """A camera's size and rate, as `spikecam_env.envs.observations.CameraView`."""

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        ...

    @property
    def frame_rate_hz(self) -> float:
        """Frames a second."""
        ...


class MujocoLight:
    """Keyed light of a simulation, from its poses; the simulation itself is only read.

    Args:
        model: mujoco.MjModel, of an environment of Gymnasium `env.unwrapped.model`.
        data: mujoco.MjData in which the simulation goes on, `env.unwrapped.data`.
        shape: (rows, columns) of the sensor.
        frame_rate_hz: of the sensor.
        camera: as of `MujocoPictures`; `camera_of(env)` is that of an environment.
        scale: radiance of MuJoCo's white; 1.0 makes the nominal pixel fire once a frame.
        motion_per_key: farthest that anything moves between two keys [pixels].
        pictures: further arguments of `MujocoPictures`: supersample, transfer, renderer.

    Raises:
        InputError: MuJoCo or OpenGL is missing, or an argument is out of range.

    Example:
        >>> mujoco = import_mujoco()
        >>> ball = "<body><freejoint/><geom type='sphere' size='.2'/></body>"
        >>> model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{ball}</worldbody></mujoco>")
        >>> data = mujoco.MjData(model)
        >>> light = MujocoLight(model, data, (32, 32), frame_rate_hz=20_000.0)
        >>> still = light.begin()
        >>> mujoco.mj_step(model, data)
        >>> keys = light.step()
        >>> keys.frame.tolist(), keys.radiance.shape, light.exact
        ([0.0, 40.0], (2, 32, 32), True)
    """

    exact = True
    """Whether the last step's replay ended where the simulation did, bit for bit; if not, poses between are a guess."""

    def __init__(
        self,
        model: Any,
        data: Any,
        shape: tuple[int, int],
        frame_rate_hz: float = 40_000.0,
        camera: Any = None,
        *,
        scale: float = 1.0,
        motion_per_key: float = MOTION_PER_KEY,
        **pictures: Any,
    ) -> None:
        mujoco = import_mujoco()
        self.pictures = MujocoPictures(model, shape, camera, **pictures)
        self.model, self.data, self.shape = model, checked_data(model, data), self.pictures.shape
        self.frame_rate_hz = checked_number(frame_rate_hz, "frame_rate_hz", *FRAME_RATES_HZ, unit="Hz")
        self.scale = checked_number(scale, "scale", 0.0, MOST_LIGHT, above=True)
        self.motion_per_key = checked_number(motion_per_key, "motion_per_key", 1e-3, 1e3, unit="pixels")
        self._scratch = mujoco.MjData(model)
        self._boxes = Boxes(model)
        self._before: State | None = None

    @classmethod
    def of_env(cls, env: Any, view: CameraSize, **options: Any) -> MujocoLight:
        """The light of an environment on a camera, for `SpikeCamera(env, make_light=MujocoLight.of_env)`.

        Args:
            env: gymnasium.Env whose unwrapped one has `model` and `data`; it is seen as it draws itself.
            view: the camera's shape and frame rate.
            options: further arguments of MujocoLight.

        Raises:
            InputError: the environment has no model of MuJoCo.
        """
        bare = getattr(env, "unwrapped", env)
        options = {"camera": camera_of(env), **options}
        return cls(bare.model, getattr(bare, "data", None), view.shape, view.frame_rate_hz, **options)

    def begin(self, frame: float = 0.0) -> Keyframes:
        """Take the simulation as it is now, after a reset, as the start.

        Args:
            frame: of the camera, from which light goes on.

        Returns:
            One key, on this frame: the light before.
        """
        mujoco = import_mujoco()
        self._before, self._frame = State.of(self.model, self.data), checked_number(frame, "frame")
        mujoco.mj_setState(self.model, self._scratch, self._before.values, mujoco.mjtState.mjSTATE_INTEGRATION)
        posed(self.model, self._scratch)
        self._last = self._radiance()
        return Keyframes.known(np.array([self._frame]), self._last[None])

    def step(self, frame: float | None = None) -> Keyframes:
        """The light since the last call, up to the simulation's time.

        Args:
            frame: of the camera, on which the step ends; default: the last one and the step's time.

        Returns:
            Keys, the first on the frame where the last call's ended, the last on this step's end.

        Raises:
            NotReadyError: `begin` was not called, or not after a reset.
            InputError: the frame is not after the last one.
        """
        if self._before is None:
            raise NotReadyError("the light has no start; call begin() after every reset of the simulation")
        course = replay(self.model, self._scratch, self._before, self.data)
        first = self._frame
        end = first + self._frames(course) if frame is None else checked_number(frame, "frame", first, above=True)
        times, length = path_lengths(
            self.model, self._scratch, course, self._boxes, self.pictures.projection, self.shape
        )
        frame_of = np.interp(times, (times[0], times[-1]), (first, end))
        at = key_frames(frame_of, length, self.motion_per_key)
        keys = self._drawn(course, at, np.interp(at, frame_of, times))
        self._before, self._frame, self.exact = State.of(self.model, self.data), end, course.exact
        return keys

    def _frames(self, course: Course) -> float:
        """Frames of a course; whole where they are so but for the rounding of its times."""
        frames = float(course.time_s[-1] - course.time_s[0]) * self.frame_rate_hz
        return float(round(frames)) if abs(frames - round(frames)) < _WHOLE * max(1.0, frames) else frames

    def close(self) -> None:
        """Give OpenGL's context back; may be called again."""
        self.pictures.close()

    def _drawn(self, course: Course, frame: Floats, time_s: Floats) -> Keyframes:
        """Keys on these frames; the first picture is the last of the step before."""
        checked_memory(4 * len(frame) * self.shape[0] * self.shape[1], f"light of {len(frame)} keys")
        light = np.empty((len(frame), *self.shape), np.float32)
        light[0] = self._last
        for key in range(1, len(frame)):
            pose_at(self.model, self._scratch, course, float(time_s[key]))
            light[key] = self._radiance()
        self._last = light[-1].copy()
        return Keyframes.known(frame, light)

    def _radiance(self) -> Pictures:
        return np.asarray(self.pictures.light(self._scratch) * np.float32(self.scale))


def key_frames(frame: Floats, length: Floats, motion_per_key: float) -> Floats:
    """Frames of keys between which nothing moves farther than motion_per_key.

    Args:
        frame: (N,) rising, from the first key to the last.
        length: (N,) of the fastest thing's way until then [pixels], never falling, linear between.
        motion_per_key: [pixels].

    Returns:
        (K,) float64: both ends, whole frames as far apart as can be, and shares of a frame where one alone is too much.

    Example:
        >>> key_frames(np.array([0.0, 40.0]), np.array([0.0, 2.0]), 0.5).tolist()
        [0.0, 10.0, 20.0, 30.0, 40.0]
        >>> key_frames(np.array([0.0, 1.0]), np.array([0.0, 2.0]), 0.5).tolist()
        [0.0, 0.25, 0.5, 0.75, 1.0]
    """
    inner = np.arange(np.floor(frame[0]) + 1, np.ceil(frame[-1]))
    grid = np.concatenate([frame[:1], inner, frame[-1:]])
    way = np.interp(grid, frame, length)
    slack = 1e-9 * motion_per_key
    keys, at = [float(grid[0])], 0
    while at < len(grid) - 1:
        farthest = int(np.searchsorted(way, way[at] + motion_per_key + slack, side="right")) - 1
        if farthest == at:  # one frame alone is too much
            parts = int(np.ceil((way[at + 1] - way[at]) / motion_per_key - 1e-9))
            shares = np.linspace(way[at], way[at + 1], parts + 1)[1:-1]
            inside = (frame > grid[at]) & (frame < grid[at + 1])
            ways = np.concatenate([way[at : at + 1], length[inside], way[at + 1 : at + 2]])
            keys.extend(
                np.interp(shares, ways, np.concatenate([grid[at : at + 1], frame[inside], grid[at + 1 : at + 2]]))
            )
            farthest = at + 1
        keys.append(float(grid[farthest]))
        at = farthest
    return np.unique(keys)
