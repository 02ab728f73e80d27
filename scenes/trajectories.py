"""Trajectories: where a body is over time, as small frozen values.

    Ballistic((0, 1, 0), (3, 2, 0)) @ Spinning((0, 1, 0), rpm=2000)

A trajectory's pose is a 4 x 4 rigid map from the body's coordinates to the world's; `a @ b` is a's pose after
b's: turn as b says, then move as a says.  Time is in seconds, so that the same motion may be watched at any
frame rate; lengths are in the world's unit (metres in the catalogue); y is up.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Protocol, runtime_checkable

import numpy as np
import scipy
from numpy.typing import ArrayLike

from spikecam_env.errors import InputError
from spikecam_env.types import Floats

Vector = tuple[float, float, float]
Pose = Floats

GRAVITY = 9.81
"""[m/s^2]"""


@runtime_checkable
class Trajectory(Protocol):
    """Anything with a pose over time; no state, so times may come in any order.

    Example:
        >>> isinstance(Still(), Trajectory)
        True
    """

    def pose(self, time_s: ArrayLike) -> Pose:
        """Times of any shape (...) [s] -> rigid maps (..., 4, 4) float64."""
        ...


class Motion:
    """Base of trajectories that chain: `outer @ inner`.

    Example:
        >>> moved = Still((0.0, 1.0, 0.0)) @ Still((2.0, 0.0, 0.0))
        >>> moved.pose(0.0)[:3, 3].tolist()
        [2.0, 1.0, 0.0]
    """

    def pose(self, time_s: ArrayLike) -> Pose:
        raise NotImplementedError

    def __matmul__(self, inner: Trajectory) -> Chain:
        return Chain(self, inner)


@dataclass(frozen=True)
class Chain(Motion):
    """outer after inner.

    Example:
        >>> turned = Still((0.0, 1.0, 0.0)) @ Spinning((0.0, 0.0, 1.0), rpm=60.0)
        >>> type(turned).__name__, turned.pose(0.25)[:2, :2].round(6).tolist()
        ('Chain', [[0.0, -1.0], [1.0, 0.0]])
    """

    outer: Trajectory
    inner: Trajectory

    def pose(self, time_s: ArrayLike) -> Pose:
        return self.outer.pose(time_s) @ self.inner.pose(time_s)


@dataclass(frozen=True)
class Still(Motion):
    """At rest: turned by `turn` about an axis of that direction [degrees along the vector], then put at `position`.

    Still((0, 1, 0), turn=(90, 0, 0)) lies a quarter turn about x at height 1.

    Example:
        >>> Still((0.0, 1.0, 0.0)).pose(0.0)[:3, 3].tolist()
        [0.0, 1.0, 0.0]
    """

    position: Vector = (0.0, 0.0, 0.0)
    turn: Vector = (0.0, 0.0, 0.0)

    def pose(self, time_s: ArrayLike) -> Pose:
        return _pose(np.shape(time_s), self._rotation, self.position)

    @cached_property
    def _rotation(self) -> Floats:
        return _turns(np.radians(self.turn))


@dataclass(frozen=True)
class Ballistic(Motion):
    """position + velocity t + gravity t^2 / 2: thrown at t = 0; without gravity, straight and even.

    Example:
        >>> Ballistic(velocity=(3.0, 2.0, 0.0), gravity=(0.0, -9.81, 0.0)).pose(0.1)[:3, 3].round(3).tolist()
        [0.3, 0.151, 0.0]
    """

    position: Vector = (0.0, 0.0, 0.0)
    velocity: Vector = (0.0, 0.0, 0.0)
    gravity: Vector = (0.0, 0.0, 0.0)

    def pose(self, time_s: ArrayLike) -> Pose:
        t = np.asarray(time_s, np.float64)[..., None]
        where = np.asarray(self.position) + t * np.asarray(self.velocity) + t * t / 2 * np.asarray(self.gravity)
        return _pose(t.shape[:-1], np.eye(3), where)


@dataclass(frozen=True)
class Spinning(Motion):
    """Turning evenly about an axis through the origin: angle = angle_deg + 6 rpm t [degrees].

    Example:
        >>> Spinning((0.0, 0.0, 1.0), rpm=60.0).pose(0.25)[:2, :2].round(6).tolist()
        [[0.0, -1.0], [1.0, 0.0]]
    """

    axis: Vector
    rpm: float
    angle_deg: float = 0.0

    def pose(self, time_s: ArrayLike) -> Pose:
        t = np.asarray(time_s, np.float64)
        return _turned(self.axis, np.radians(self.angle_deg + 6 * self.rpm * t))


@dataclass(frozen=True)
class Swinging(Motion):
    """Turning to and fro about an axis through the origin: angle = amplitude sin(2 pi (frequency t + phase)).

    Example:
        >>> pose = Swinging((0.0, 0.0, 1.0), amplitude_deg=30.0, frequency_hz=1.0).pose(0.25)
        >>> round(float(np.degrees(np.arctan2(pose[1, 0], pose[0, 0]))), 3)
        30.0
    """

    axis: Vector
    amplitude_deg: float
    frequency_hz: float
    phase: float = 0.0

    def pose(self, time_s: ArrayLike) -> Pose:
        swing = np.sin(2 * np.pi * (self.frequency_hz * np.asarray(time_s, np.float64) + self.phase))
        return _turned(self.axis, np.radians(self.amplitude_deg) * swing)


@dataclass(frozen=True)
class Vibrating(Motion):
    """Moving to and fro: amplitude (a vector) times sin(2 pi (frequency t + phase)).

    Example:
        >>> Vibrating((0.1, 0.0, 0.0), frequency_hz=100.0).pose(0.0025)[:3, 3].round(3).tolist()
        [0.1, 0.0, 0.0]
    """

    amplitude: Vector
    frequency_hz: float
    phase: float = 0.0

    def pose(self, time_s: ArrayLike) -> Pose:
        t = np.asarray(time_s, np.float64)[..., None]
        swing = np.sin(2 * np.pi * (self.frequency_hz * t + self.phase))
        return _pose(t.shape[:-1], np.eye(3), swing * np.asarray(self.amplitude))


@dataclass(frozen=True)
class Bouncing(Motion):
    """Up and down between y = 0 and `height`, as under gravity on a perfect floor; at the top when t = 0.

    y = height - g tau^2 / 2,  tau: time to the nearest top;  period 2 sqrt(2 height / g)

    Example:
        >>> Bouncing(height=1.0).pose([0.0, 0.1])[:, 1, 3].round(3).tolist()
        [1.0, 0.951]
    """

    height: float
    gravity: float = GRAVITY
    phase: float = 0.0

    def pose(self, time_s: ArrayLike) -> Pose:
        period = 2 * np.sqrt(2 * self.height / self.gravity)
        turns = np.asarray(time_s, np.float64) / period + self.phase
        tau = (turns - np.round(turns)) * period
        where = np.zeros((*tau.shape, 3))
        where[..., 1] = self.height - self.gravity * tau**2 / 2
        return _pose(tau.shape, np.eye(3), where)


@dataclass(frozen=True)
class Path(Motion):
    """A smooth curve through positions at times (cubic spline); closed, it starts over after the last time.

    A closed path must end where it starts.  Before the first and after the last time an open path stands still.

    Example:
        >>> path = Path((0.0, 1.0, 2.0), ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)))
        >>> path.pose(0.5)[:3, 3].round(3).tolist()
        [0.5, 0.0, 0.0]
    """

    time_s: tuple[float, ...]
    positions: tuple[Vector, ...]
    closed: bool = False

    def __post_init__(self) -> None:
        if len(self.time_s) != len(self.positions) or len(self.time_s) < 2 or not np.all(np.diff(self.time_s) > 0):
            raise InputError(
                f"a path needs as many positions as rising times, two at least; "
                f"got {len(self.time_s)} times and {len(self.positions)} positions"
            )
        if self.closed and not np.allclose(self.positions[0], self.positions[-1]):
            raise InputError(
                f"a closed path must end where it starts; got {self.positions[0]} and {self.positions[-1]}"
            )

    def pose(self, time_s: ArrayLike) -> Pose:
        t = np.asarray(time_s, np.float64)
        first, last = self.time_s[0], self.time_s[-1]
        inside = first + (t - first) % (last - first) if self.closed else np.clip(t, first, last)
        return _pose(t.shape, np.eye(3), self._curve(inside))

    @cached_property
    def _curve(self) -> scipy.interpolate.CubicSpline:
        ends = "periodic" if self.closed else "natural"
        return scipy.interpolate.CubicSpline(self.time_s, self.positions, bc_type=ends)


@dataclass(frozen=True)
class Shake(Motion):
    """A hand-held camera: small turns and shifts, each a sum of sines at random frequencies up to a highest one.

    Example:
        >>> poses = Shake(angle_deg=0.05).pose([0.0, 0.01])
        >>> poses.shape, bool((poses[0] == poses[1]).all())
        ((2, 4, 4), False)
    """

    angle_deg: float = 0.05
    shift: float = 0.0
    """Standard deviation about and along each axis [degrees, world units]."""
    highest_hz: float = 60.0
    seed: int = 0

    def pose(self, time_s: ArrayLike) -> Pose:
        t = np.asarray(time_s, np.float64)[..., None, None]
        rng = np.random.default_rng(self.seed)
        frequency = self.highest_hz * rng.uniform(0.1, 1.0, (6, _SINES))
        wave = np.sin(2 * np.pi * (frequency * t + rng.random((6, _SINES)))).sum(-1) * np.sqrt(2 / _SINES)
        turn = _turns(np.radians(self.angle_deg) * wave[..., :3].reshape(-1, 3))
        return _pose(t.shape[:-2], turn.reshape(*t.shape[:-2], 3, 3), self.shift * wave[..., 3:])


@dataclass(frozen=True)
class Repeating(Motion):
    """Another trajectory, started over after every period; the jump back is best made out of sight.

    Example:
        >>> thrown = Repeating(Ballistic(velocity=(1.0, 0.0, 0.0)), period_s=0.5)
        >>> thrown.pose([0.1, 0.6])[:, 0, 3].round(3).tolist()
        [0.1, 0.1]
    """

    motion: Trajectory
    period_s: float
    start_s: float = 0.0

    def pose(self, time_s: ArrayLike) -> Pose:
        return self.motion.pose((np.asarray(time_s, np.float64) - self.start_s) % self.period_s + self.start_s)


AT_REST = Still()
"""At the origin."""

_SINES = 5


def _turns(rotation_vectors: Floats) -> Floats:
    """Matrices (..., 3, 3) of rotation vectors (..., 3) [radians]."""
    return np.asarray(scipy.spatial.transform.Rotation.from_rotvec(rotation_vectors).as_matrix())


def _turned(axis: Vector, angle: Floats) -> Pose:
    """Rotation by angles (...) [radians] about an axis (Rodrigues' formula)."""
    cross, twice = _crosses(tuple(axis))
    sine, versine = np.sin(angle)[..., None, None], (1 - np.cos(angle))[..., None, None]
    return _pose(np.shape(angle), _UNTURNED + sine * cross + versine * twice, _AT_ORIGIN)


_UNTURNED, _AT_ORIGIN = np.eye(3), np.zeros(3)


@lru_cache(maxsize=256)
def _crosses(axis: Vector) -> tuple[Floats, Floats]:
    """The matrix of the cross product with an axis of length 1, and its square; a scene asks for them in every step."""
    length = float(np.linalg.norm(axis))
    if not length > 0:
        raise InputError(f"the axis of a turn is {axis}; it must have a length")
    x, y, z = np.asarray(axis, np.float64) / length
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return cross, cross @ cross


def _pose(shape: tuple[int, ...], rotation: Floats, position: ArrayLike) -> Pose:
    pose = np.zeros((*shape, 4, 4))
    pose[..., :3, :3], pose[..., :3, 3], pose[..., 3, 3] = rotation, position, 1.0
    return pose
