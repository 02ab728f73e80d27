"""Dodge: balls are shot at a puck on a table, four at a time; it must stand in the one gap between them.

    volley, at its throw:   x   O   (gap)   O   x      across the puck's column; one O is aimed at the puck

Everything glides, as on an air table: balls go straight.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from spikecam_env.envs.mujoco_tasks.servo import Servo
from spikecam_env.envs.mujoco_tasks.task import BOUNCE, STEP_S, MujocoTask, Verdict
from spikecam_env.types import Floats

RADIUS, MASS = 0.0213, 0.0459
"""Of a ball [m, kg]: a golf ball (R&A: at least 42.67 mm wide, at most 45.93 g), which air slows by 0.1 m/s on its way
at 30 m/s (drag coefficient 0.25)."""
PUCK = 0.041
"""Radius of the puck [m]: as in air hockey (3.25 inches wide)."""
TOUCH = RADIUS + PUCK
"""Distance between middles at which a ball touches the puck [m]."""
REACH = 0.12
"""Farthest that the puck's middle moves from its rest, along each axis [m]."""
CAN = Servo(acceleration=150.0, top=8.0, mass=0.2)
"""Motors of the puck: 15 g, as fast delta robots reach."""
HATCH = 0.97
"""Distance from the puck's rest at which balls wait below a roof [m]."""
ROOF = 0.92
"""Distance of the roof's edge [m]."""
VIEW = 1.2
"""Height of the picture on the table [m]."""
EYE_X, EYE_HEIGHT = 0.42, 1.45
"""Of the camera, from the puck's rest and above the table [m]."""
VOLLEYS, BALLS = 2, 4
"""Of an episode, and of a volley."""
SLACK = 0.02
"""By which the puck's middle may miss the middle of a gap, to either side [m]: a pixel of 64."""
LANES = np.array([-1.0, -1.0, 1.0, 1.0]) * (TOUCH + SLACK) + np.array([-0.12, 0.0, 0.0, 0.12])
"""Places of a volley's balls beside its gap [m]; the outer ones shut what the inner ones leave free."""
BESIDE = (0.045, 0.065)
"""Least and greatest distance of a gap from the puck at the throw [m]; the ball between them hits the puck."""
SHEAR, JITTER = 0.2, 0.03
"""Farthest that a volley, and a ball in it, begins beside its lane [m]: lines are inclined by up to 22 degrees."""
DECOYS = 6
"""Other balls of the model."""
WIDE = (0.25, 0.5)
"""Least and greatest distance from the puck's rest at which other balls pass [m]; they never touch it."""
THREATS = VOLLEYS * BALLS
"""Balls of volleys; they are the first of the model."""
SLOWEST, SLOWEST_DECOY = 0.95, 0.2
"""Speed of the slowest ball of a volley, and of the slowest other one, over that of the level."""
EARLIEST, LATEST, PAUSE = 5, 20, 15
"""Steps before the first volley, and most from the time when it has passed to the second."""
PITCH = 0.01
"""Of the oracle's grid of places [m]."""


@dataclass(frozen=True)
class DodgeLevel:
    """Numbers of a level."""

    speed: float
    """Of the balls [m/s]; each draws 95 to 100 % of it."""
    brightness: float
    """Of the lamps; 1 is full."""
    decoys: int
    """Balls that look the same and pass beyond the reach, at 20 to 100 % of the speed."""


LEVEL = {
    1: DodgeLevel(10.0, 1.0, 0),
    2: DodgeLevel(15.0, 0.5, 1),
    3: DodgeLevel(20.0, 0.25, 2),
    4: DodgeLevel(25.0, 0.12, 4),
    5: DodgeLevel(30.0, 0.06, 6),
}


@dataclass(frozen=True)
class Throws:
    """How the balls of an episode are thrown, (n,) each; the balls of volleys come first."""

    step: NDArray[np.int64]
    """In which the ball is shot; -1 for never."""
    start: Floats
    """Place along the hatch at which it waits [m]."""
    beside: Floats
    """Of the gap from the puck, of a volley; the sign is turned where the reach ends [m]."""
    lane: Floats
    """Place beside the gap, or beside the rest, at which it passes [m]."""
    speed: Floats
    """[m/s]"""


class Dodge(MujocoTask):
    """Let no ball hit the puck.

    Scene:
        The camera looks down on a table, 1.2 m high. Two volleys of four balls come from a hatch on the right, at 10
        (level 1) to 30 m/s (level 5): 86 to 29 ms from the first sight to the touch. In each a ball is aimed at the
        puck where it is then; a gap of 4 cm is left beside it. From level 2 on other balls pass beyond the reach.
    Action:
        Two numbers in [-1, 1]: the wanted place of the puck, to the right and up, over its reach of 12 cm. Motors of
        15 g and 8 m/s bring it there. A step is 1 ms.
    Encoders:
        Place over the reach and speed over the top speed, of both axes.
    Reward:
        20 times the change of how far the puck is from the nearest line on which a ball comes, as a share of the
        distance at which they touch, 1 at most, and 0 after a touch; 10 more at the end of an episode without one.
    End:
        Terminated when a ball touches the puck or all have passed; 300 steps at most.
    Success:
        No ball has touched the puck. Performance: 1 for a success.
    """

    most_steps: ClassVar[int] = 300
    actions: ClassVar[int] = 2
    sensed_numbers: ClassVar[int] = 4
    stream: ClassVar[int] = 21

    def xml(self) -> str:
        """See `MujocoTask.xml`; x is from the puck's rest to the hatch, y up in the picture, z to the camera."""
        balls = "\n".join(
            f'<body name="ball{n}"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>'
            f'<geom type="sphere" size="{RADIUS}" mass="{MASS}" rgba=".95 .95 .9 1" contype="1" conaffinity="0"/>'
            "</body>"
            for n in range(THREATS + DECOYS)
        )
        through = 'contype="0" conaffinity="0"'
        return f"""<mujoco model="dodge">
<option timestep="0.0005" integrator="Euler" gravity="0 0 0"/>
<visual><quality shadowsize="0" numslices="16" numstacks="8"/><map znear=".01" zfar="20"/>
<headlight ambient=".45 .45 .45" diffuse=".3 .3 .3" specular="0 0 0"/></visual>
<asset><texture name="table" type="2d" builtin="checker" rgb1=".1 .18 .24" rgb2=".13 .22 .28" width="64" height="64"/>
<material name="table" texture="table" texrepeat="8 8"/></asset>
<worldbody><light pos="{EYE_X} 0 2" dir="0 0 -1" diffuse=".4 .4 .4" specular="0 0 0" castshadow="false"/>
<camera name="eye" pos="{EYE_X} 0 {EYE_HEIGHT}" fovy="{2 * np.degrees(np.arctan(VIEW / 2 / EYE_HEIGHT))}"/>
<geom type="box" size="1.2 1.2 .01" pos="{EYE_X} 0 -.05" material="table" {through}/>
<geom type="box" size=".4 1.2 .01" pos="{ROOF + 0.4} 0 .05" rgba=".3 .3 .32 1" {through}/>
<body name="puck"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
<geom type="cylinder" size="{PUCK} .03" mass="{CAN.mass}" rgba=".9 .45 .1 1" contype="0" conaffinity="1"
 priority="1" condim="1" {BOUNCE}/></body>
{balls}</worldbody>
</mujoco>"""

    def arrange(self, rng: np.random.Generator, level: int) -> float:
        """See `MujocoTask.arrange`."""
        self._throws = drawn_throws(rng, LEVEL[level])
        self._velocity = np.zeros((len(self._throws.step), 2))
        self._balls()[:] = np.stack([np.full(len(self._velocity), HATCH), self._throws.start], axis=1)
        self._hit = False
        return LEVEL[level].brightness

    def drive(self, action: list[float]) -> None:
        """See `MujocoTask.drive`; a ball is shot by an even force for one step."""
        place, speed = self._puck()
        force = self.data.xfrc_applied[1:]
        force[0, :2] = CAN.force(REACH * np.array(action), place, speed, STEP_S)
        force[1:] = 0.0
        for ball in np.flatnonzero(self._throws.step == self.steps_played).tolist():
            self._velocity[ball] = self._shot(ball, place)
            force[1 + ball, :2] = MASS * self._velocity[ball] / STEP_S

    def _shot(self, ball: int, puck: Floats) -> Floats:
        """(2,) velocity of a ball that is shot now [m/s]."""
        throws = self._throws
        aimed = ball < THREATS
        column, row = (puck[0], beside(puck[1], throws.beside[ball])) if aimed else (0.0, 0.0)
        way = np.array([column - HATCH, row + throws.lane[ball] - throws.start[ball]])
        return np.asarray(throws.speed[ball] * way / np.hypot(*way))

    def watch(self) -> None:
        """See `MujocoTask.watch`."""
        self._hit |= self.data.ncon > 0

    def verdict(self) -> Verdict:
        """See `MujocoTask.verdict`."""
        if self._hit:
            return Verdict(False, 0.0, 0.0)
        place, _ = self._puck()
        worth = min(1.0, float(clearance(place[None], *self._coming())[0]) / TOUCH)
        end = True if self._passed()[:THREATS].all() else None
        return Verdict(end, float(end is True), worth)

    def best_action(self) -> NDArray[np.float32]:
        """The nearest place that lies off all lines on which balls come."""
        place, _ = self._puck()
        return np.asarray(safe_place(place, *self._coming()) / REACH, np.float32)

    def target(self) -> tuple[Floats, Floats]:
        """See `MujocoTask.target`; the place on a coming ball's line that is nearest to the puck."""
        place, _ = self._puck()
        feet = nearest_points(place[None], *self._coming())[0]
        nearest = min(feet, key=lambda foot: float(np.hypot(*(foot - place))), default=place)
        return np.array([*nearest, 0.0]), np.array([*place, 0.0])

    def sensed(self) -> Floats:
        """See `MujocoTask.sensed`."""
        place, speed = self._puck()
        return np.concatenate([place / REACH, speed / CAN.top])

    def _puck(self) -> tuple[Floats, Floats]:
        """Place (right, up) [m] and speed [m/s]."""
        return self.data.qpos[:2].copy(), self.data.qvel[:2].copy()

    def _balls(self) -> Floats:
        """(n, 2) places of the balls [m], a view of the state."""
        return np.asarray(self.data.qpos[2:].reshape(-1, 2))

    def _passed(self) -> NDArray[np.bool_]:
        """(n,) whether a ball is past the puck."""
        return np.asarray(self._balls()[:, 0] < self.data.qpos[0] - TOUCH)

    def _coming(self) -> tuple[Floats, Floats]:
        """(n, 2) places [m] and (n, 2) velocities [m/s] of the balls that come."""
        coming = (self._velocity != 0).any(axis=1) & ~self._passed()
        coming[THREATS:] = False
        return self._balls()[coming], self._velocity[coming]


def drawn_throws(rng: np.random.Generator, level: DodgeLevel) -> Throws:
    """The throws of an episode; a volley is shot when the one before has passed.

    Example:
        >>> throws = drawn_throws(np.random.default_rng(0), LEVEL[1])
        >>> throws.step.shape, bool((throws.step[:THREATS] > 0).all()), throws.step[THREATS:].tolist()
        ((14,), True, [-1, -1, -1, -1, -1, -1])
    """
    passing = int(np.ceil((HATCH + REACH + TOUCH) / (SLOWEST * level.speed) / STEP_S)) + 1
    first, pause = rng.integers(EARLIEST, LATEST), rng.integers(0, PAUSE)
    volleys = first + np.arange(VOLLEYS) * (passing + pause)
    beside_puck = rng.choice((-1.0, 1.0), VOLLEYS) * rng.uniform(*BESIDE, VOLLEYS)
    shear = np.append(np.repeat(rng.uniform(-SHEAR, SHEAR, VOLLEYS), BALLS), rng.uniform(-SHEAR, SHEAR, DECOYS))
    lane = np.append(np.tile(LANES, VOLLEYS), rng.choice((-1.0, 1.0), DECOYS) * rng.uniform(*WIDE, DECOYS))
    others = np.where(np.arange(DECOYS) < level.decoys, rng.integers(0, volleys[-1] + passing, DECOYS), -1)
    share = np.append(rng.uniform(SLOWEST, 1.0, THREATS), rng.uniform(SLOWEST_DECOY, 1.0, DECOYS))
    return Throws(
        step=np.append(np.repeat(volleys, BALLS), others),
        start=lane + shear + rng.uniform(-JITTER, JITTER, lane.shape),
        beside=np.append(np.repeat(beside_puck, BALLS), np.zeros(DECOYS)),
        lane=lane,
        speed=level.speed * share,
    )


def beside(place: float, way: float) -> float:
    """The middle of a gap: so far beside a place, or on its other side where the reach ends [m].

    Example:
        >>> beside(0.05, 0.04), round(beside(0.1, 0.04), 2)
        (0.09, 0.06)
    """
    return place - way if abs(place + way) > REACH else place + way


def nearest_points(places: Floats, balls: Floats, velocity: Floats) -> Floats:
    """(places, balls, 2) the point of each ball's line that is nearest to each place [m].

    Args:
        places: (places, 2) [m].
        balls: (balls, 2) where they are [m].
        velocity: (balls, 2); only its direction counts.

    Example:
        >>> nearest_points(np.array([[0.0, 0.1]]), np.array([[0.9, 0.0]]), np.array([[-10.0, 0.0]])).tolist()
        [[[0.0, 0.0]]]
    """
    along = velocity / np.linalg.norm(velocity, axis=-1, keepdims=True)
    share = np.sum((places[:, None] - balls) * along, axis=-1, keepdims=True)
    return np.asarray(balls + share * along)


def clearance(places: Floats, balls: Floats, velocity: Floats) -> Floats:
    """(places,) distance from the nearest line, without end where no ball comes [m]; arguments as `nearest_points`.

    Example:
        >>> clearance(np.array([[0.0, 0.1]]), np.array([[0.9, 0.0]]), np.array([[-10.0, 0.0]])).tolist()
        [0.1]
    """
    points = nearest_points(places, balls, velocity)
    return np.asarray(np.linalg.norm(points - places[:, None], axis=-1).min(axis=1, initial=np.inf))


def safe_place(place: Floats, balls: Floats, velocity: Floats) -> Floats:
    """(2,) the place within reach that is nearest to a place and lies off all lines, or as far off as can be [m].

    Args:
        place: (2,) where the puck is [m].
        balls, velocity: as of `nearest_points`.

    Example:
        >>> ball, velocity = np.array([[0.9, 0.0]]), np.array([[-10.0, 0.0]])
        >>> safe_place(np.array([0.0, 0.01]), ball, velocity).round(3).tolist()
        [0.0, 0.08]
    """
    half = round(REACH / PITCH)
    line = PITCH * np.arange(-half, half + 1)
    places = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    short = np.maximum(TOUCH + SLACK / 2 - clearance(places, balls, velocity), 0.0)
    way = np.linalg.norm(places - place, axis=-1)
    return np.asarray(places[np.argmin(way + 2 * REACH * short / SLACK)])
