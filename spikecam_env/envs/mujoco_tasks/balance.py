"""Balance: a rod of 30 to 3 cm on a cart, hit by puffs of air; the shorter the rod, the sooner help is too late.

With T and u of `upright`, a puff that changes u by a share p of what the cart can hold has to be answered within
T log(1 / p): 51 ms for the largest puff and a rod of 30 cm, 16 ms for one of 3 cm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from spikecam_env.envs.mujoco_tasks.task import STEP_S, MujocoTask, Verdict
from spikecam_env.envs.mujoco_tasks.upright import GRAVITY, fall_time, held_up
from spikecam_env.types import Floats

STRONGEST = 0.5
"""Largest acceleration of the cart [GRAVITY]: it holds a rod that leans by 27 degrees."""
FALLEN = float(np.radians(30.0))
"""Lean at which a rod counts as fallen [rad]: little more than the cart can hold."""
TRACK = 0.4
"""Farthest that the cart moves from the middle of its track [heights of the picture], so that all is seen."""
HOLD_STEPS = 300
"""For which the rod must be held [ms]: 2.1 T of the longest rod, 6.6 T of the shortest."""
CART_MASS, ROD_MASS = 0.5, 0.02
"""[kg], [kg/m]: the carriage of a small linear motor; a dowel of pine, 6 mm thick."""
BEGIN = (0.45, 0.65)
"""Least and largest u at the start [STRONGEST], to either side: without help every rod falls in time."""
REST = (2.5, 3.5)
"""Least and longest time from puff to puff [T]: u may decay, and most of the cart's way with it."""
PUFF_STEPS = 4
"""That a puff lasts [ms]."""
STATION = 4.0
"""Distance between the tracks of two levels [m]; the camera stands before one."""
FOVY = 40.0
"""[degrees]"""


@dataclass(frozen=True)
class BalanceLevel:
    """Numbers of a level."""

    length: float
    """Of the rod [m]."""
    view: float
    """Height of the picture [rods]: the nearer the camera, the nearer to a picture of the same size."""
    brightness: float
    """Of the lamps; 1 is full."""
    decoys: int
    """Rods that look the same and swing behind the track."""
    puff: float
    """Largest change of u by a puff [STRONGEST]; the least is half of it."""

    @property
    def reach(self) -> float:
        """Of the cart from the middle of its track [m]."""
        return TRACK * self.view * self.length


LEVEL = {
    1: BalanceLevel(0.30, 3.0, 1.0, 0, 0.7),
    2: BalanceLevel(0.20, 3.5, 0.6, 1, 0.7),
    3: BalanceLevel(0.10, 4.25, 0.3, 3, 0.7),
    4: BalanceLevel(0.05, 5.5, 0.2, 4, 0.7),
    5: BalanceLevel(0.03, 7.0, 0.15, 5, 0.7),
}


class Balance(MujocoTask):
    """Hold a rod upright on a cart.

    Scene:
        The camera looks across the track at a cart that carries a rod on a hinge, 30 cm long at level 1, 3 cm at level
        5, where the camera stands nearer. It leans at the start, and puffs of air hit it. From level 2 on rods of the
        same look swing behind the track.
    Action:
        One number in [-1, 1]: the motor's force to the right; the largest accelerates the cart by half of gravity. A
        step is 1 ms.
    Encoders:
        Place of the cart over its reach, and speed over sqrt(gravity * rod).
    Reward:
        20 times the decrease of |u|, the part of the lean that grows, as a share of what the cart can hold; 10 more for
        a success.
    End:
        Terminated when the rod leans by 30 degrees, when the cart leaves its track, and after 300 steps.
    Success:
        The rod is up and the cart on its track for 0.3 s. Performance: 1 for a success.
    """

    most_steps: ClassVar[int] = HOLD_STEPS
    actions: ClassVar[int] = 1
    sensed_numbers: ClassVar[int] = 2
    stream: ClassVar[int] = 22

    def xml(self) -> str:
        """See `MujocoTask.xml`; x is along the track, to the right, y away from the camera, z up."""
        stations = "\n".join(_station(level) for level in LEVEL)
        motors = "".join(f'<motor joint="cart{level}"/>' for level in LEVEL)
        return f"""<mujoco model="balance">
<option timestep="0.0005" integrator="Euler" gravity="0 0 {-GRAVITY}"/><statistic extent="1"/>
<visual><quality shadowsize="0" numslices="8" numstacks="4"/><map znear=".02" zfar="20"/>
<headlight ambient=".45 .45 .45" diffuse=".3 .3 .3" specular="0 0 0"/></visual>
<asset><texture name="wall" type="2d" builtin="checker" rgb1=".16 .2 .22" rgb2=".22 .26 .28" width="64" height="64"/>
<material name="wall" texture="wall" texrepeat="14 14"/></asset><default><geom contype="0" conaffinity="0"/></default>
<worldbody><camera name="eye" xyaxes="1 0 0 0 0 1" fovy="{FOVY}"/>{stations}</worldbody>
<actuator>{motors}</actuator></mujoco>"""

    def arrange(self, rng: np.random.Generator, level: int) -> float:
        """See `MujocoTask.arrange`."""
        numbers = LEVEL[level]
        self.length, self._reach, self._time = numbers.length, numbers.reach, fall_time(numbers.length)
        self._joints = tuple(self.data.joint(f"{name}{level}") for name in ("cart", "rod"))
        away = numbers.view * numbers.length / 2 / np.tan(np.radians(FOVY) / 2)
        self.model.camera("eye").pos[:] = STATION * level, -away, numbers.length / 2
        for other in LEVEL:
            self.data.joint(f"rod{other}").qpos[0] = np.pi  # the others hang at rest
        grown, share = STRONGEST * rng.choice((-1, 1)) * rng.uniform(*BEGIN), rng.random()
        rod = self._joints[1]
        rod.qpos[0], rod.qvel[0] = share * grown, (1 - share) * grown / self._time
        for n in range(numbers.decoys):
            self._swing(f"decoy{level}{n}", rng)
        self._rod = self.data.body(f"rod{level}")
        self._push = puffs(rng, numbers)
        return numbers.brightness

    def _swing(self, decoy: str, rng: np.random.Generator) -> None:
        """Hang a rod somewhere behind the track, on its way from side to side."""
        place = self.model.body(decoy).pos
        place[[0, 2]] = rng.uniform(-self._reach, self._reach), self.length * rng.uniform(0.9, 1.4)
        swing, phase = rng.uniform(0.2, 0.6), rng.uniform(0, 2 * np.pi)
        joint = self.data.joint(decoy)
        joint.qpos[0], joint.qvel[0] = swing * np.cos(phase), swing * np.sin(phase) / self._time

    def drive(self, action: list[float]) -> None:
        """See `MujocoTask.drive`."""
        self.data.ctrl[self.level - 1] = action[0] * STRONGEST * GRAVITY * CART_MASS
        self._rod.xfrc_applied[0] = self._push[self._steps]

    def verdict(self) -> Verdict:
        """See `MujocoTask.verdict`."""
        place, _, angle, rate = self._state()
        grown = abs(angle + self._time * rate) / STRONGEST
        end = None
        if abs(angle) > FALLEN or abs(place) > self._reach:
            end = False
        elif self.data.time > (HOLD_STEPS - 0.5) * STEP_S:
            end = True
        return Verdict(end, float(end is True), 1.0 - min(grown, 1.0))

    def best_action(self) -> NDArray[np.float32]:
        """See `upright.held_up`."""
        return motor(held_up(*self._state(), self.length))

    def target(self) -> tuple[Floats, Floats]:
        """The rod's end, and where it would be if the rod stood upright, in the world [m]."""
        place, _, angle, _ = self._state()
        hinge = STATION * self.level + place
        lean = self.length * np.array([np.sin(angle), np.cos(angle)])
        return np.array([hinge + lean[0], 0.0, lean[1]]), np.array([hinge, 0.0, self.length])

    def sensed(self) -> Floats:
        """See `MujocoTask.sensed`."""
        place, speed, _, _ = self._state()
        return np.array([place / self._reach, speed / np.sqrt(GRAVITY * self.length)])

    def _state(self) -> tuple[float, float, float, float]:
        """Place [m] and speed [m/s] of the cart, angle [rad] and rate [rad/s] of the rod, all to the right."""
        cart, rod = self._joints
        return float(cart.qpos[0]), float(cart.qvel[0]), float(rod.qpos[0]), float(rod.qvel[0])


def motor(acceleration: float) -> NDArray[np.float32]:
    """(1,) the action that accelerates the cart so [GRAVITY], or as far as it can.

    Example:
        >>> motor(0.25).tolist(), motor(-3.0).tolist()
        ([0.5], [-1.0])
    """
    return np.clip([acceleration / STRONGEST], -1.0, 1.0).astype(np.float32)


def puffs(rng: np.random.Generator, numbers: BalanceLevel) -> Floats:
    """(HOLD_STEPS,) force of the air on the rod's middle in each step [N].

    A force F for a time t changes u by 1.5 F t T / (m l).

    Args:
        rng: of the episode.
        numbers: of the level.

    Example:
        >>> force = puffs(np.random.default_rng(0), LEVEL[5])
        >>> force.shape, int((force != 0).sum())
        ((300,), 8)
    """
    time, mass = fall_time(numbers.length), ROD_MASS * numbers.length
    force = np.zeros(HOLD_STEPS)
    step = rng.uniform(*REST) * time / STEP_S
    while step < HOLD_STEPS:
        change = rng.choice((-1, 1)) * rng.uniform(0.5, 1.0) * numbers.puff * STRONGEST
        lasts = slice(int(step), int(step) + PUFF_STEPS)
        force[lasts] = change * mass * numbers.length / (1.5 * PUFF_STEPS * STEP_S * time)
        step += rng.uniform(*REST) * time / STEP_S
    return force


def _station(level: int) -> str:
    """The track of a level, with its cart, rod and decoys (MJCF)."""
    numbers = LEVEL[level]
    rod = numbers.length
    thin = f'size="{rod / 25} {rod / 2}" type="cylinder" rgba=".95 .95 .9 1" mass="{ROD_MASS * rod}"'
    decoys = "".join(
        f'<body name="decoy{level}{n}" pos="0 {rod * (0.3 + 0.1 * n):.4f} 0">'
        f'<joint name="decoy{level}{n}" axis="0 1 0"/><geom {thin} pos="0 0 {-rod / 2}"/></body>'
        for n in range(numbers.decoys)
    )
    return f"""<body pos="{STATION * level} 0 0">
<geom type="box" size="{7 * rod} .002 {7 * rod}" pos="0 {rod} 0" material="wall"/>
<geom type="box" size="{numbers.reach} {rod / 20} {rod / 40}" pos="0 0 {-rod / 5}" rgba=".5 .5 .5 1"/>{decoys}
<body><joint name="cart{level}" type="slide" axis="1 0 0"/>
<geom type="box" size="{rod / 8} {rod / 10} {rod / 14}" pos="0 0 {-rod / 10}" rgba=".9 .6 .1 1" mass="{CART_MASS}"/>
<body name="rod{level}"><joint name="rod{level}" axis="0 1 0"/><geom {thin} pos="0 0 {rod / 2}"/></body>
</body></body>"""
