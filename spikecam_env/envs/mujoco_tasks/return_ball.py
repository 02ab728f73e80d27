"""Return: a ball comes at 5 to 25 m/s, its way bent by spin; a paddle must be where it comes and send it over the net.

Anchor: SpikePingpong (arXiv 2506.06690), a real spike camera before a robot's arm: 92 % of balls within 30 cm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from spikecam_env.envs.mujoco_tasks.servo import Servo
from spikecam_env.envs.mujoco_tasks.task import BOUNCE, STEP_S, MujocoTask, Verdict
from spikecam_env.types import Floats

AWAY = 1.5
"""Distance from which a ball comes [m]."""
RADIUS, MASS = 0.03, 0.01
"""Of a ball [m, kg]: a soft practice ball."""
REACH = 0.15
"""Farthest that the paddle's middle moves from its rest, along each axis [m]."""
HALF = 0.05
"""Half the side of the paddle [m]."""
STARTS = 0.4
"""Farthest that a ball begins beside the paddle's rest, along each axis [m]."""
BEND = 0.1
"""Largest curvature of a ball's way by spin [1/m]: 11 cm over AWAY, as of a table tennis ball whose lift coefficient is
0.2 (density of air 1.2 kg/m^3, cross-section 12.6 cm^2, 2.7 g: 0.06 1/m) to 0.3."""
CAN = Servo(acceleration=300.0, top=8.0, mass=0.2)
"""Motors of the paddle: 30 g, as fast delta robots and linear motors reach."""
NET, NET_TOP = 0.7, -0.26
"""Distance and height of the net's upper edge, from the paddle's rest [m]."""
TILT_DEGREES = 16.0
"""The paddle faces up by this angle, so that balls rise on their way back."""
TABLE_HALF = 0.75
"""Half the width of the table [m]."""
DECOYS = 6
"""Other balls of the model."""
PASSED = 0.1
"""Distance behind the paddle at which a ball is lost [m]."""


@dataclass(frozen=True)
class ReturnLevel:
    """Numbers of a level."""

    speed: float
    """Of the ball towards the paddle [m/s]."""
    brightness: float
    """Of the lamps; 1 is full."""
    decoys: int
    """Balls that look the same and fly by beyond the reach."""


LEVEL = {
    1: ReturnLevel(5.0, 1.0, 0),
    2: ReturnLevel(10.0, 0.6, 1),
    3: ReturnLevel(15.0, 0.4, 2),
    4: ReturnLevel(20.0, 0.25, 4),
    5: ReturnLevel(25.0, 0.15, 6),
}


class Return(MujocoTask):
    """Return a ball over the net.

    Scene:
        The camera looks over the paddle, which is a frame, along the way of the ball. A ball comes from 1.5 m away at 5
        (level 1) to 25 m/s (level 5); spin bends its way by up to 11 cm. From level 2 on other balls fly by.
    Action:
        Two numbers in [-1, 1]: the wanted place of the paddle, to the right and up, over its reach of 15 cm. Motors of
        30 g and 8 m/s bring it there. A step is 1 ms.
    Encoders:
        Place over the reach and speed over the top speed, of both axes.
    Reward:
        20 times how much closer the paddle has come to where the ball crosses its plane, as a share of twice its reach;
        10 more for a return.
    End:
        Terminated when the ball has left the paddle or is lost behind it; 400 steps at most.
    Success:
        The ball flies back over the net. Performance: 1 for a success.
    """

    most_steps: ClassVar[int] = 400
    actions: ClassVar[int] = 2
    sensed_numbers: ClassVar[int] = 4
    stream: ClassVar[int] = 20

    def xml(self) -> str:
        """See `MujocoTask.xml`; x is along the ball's way, y to the left, z up."""
        ball = f'<geom type="sphere" size="{RADIUS}" mass="{MASS}" rgba=".95 .95 .9 1" condim="1"'
        through = 'contype="0" conaffinity="0"'
        decoys = "\n".join(
            f'<body name="decoy{n}" pos="-5 {n} 0"><freejoint name="decoy{n}"/>{ball} {through}/></body>'
            for n in range(DECOYS)
        )
        bars = "\n".join(
            f'<geom type="box" size=".008 {y} {z}" pos="0 {at_y} {at_z}" rgba=".9 .6 .1 1" mass="0" {through}/>'
            for y, z, at_y, at_z in (
                (HALF, 0.009, 0, HALF),
                (HALF, 0.009, 0, -HALF),
                (0.009, HALF, HALF, 0),
                (0.009, HALF, -HALF, 0),
            )
        )
        return f"""<mujoco model="return">
<option timestep="0.00025" integrator="Euler"/><visual><quality shadowsize="0"/><map znear=".01" zfar="20"/>
<headlight ambient=".45 .45 .45" diffuse=".3 .3 .3" specular="0 0 0"/></visual>
<asset><texture name="wall" type="2d" builtin="checker" rgb1=".16 .2 .22" rgb2=".22 .26 .28" width="64" height="64"/>
<material name="wall" texture="wall" texrepeat="6 6"/>
<texture name="table" type="2d" builtin="flat" rgb1=".1 .22 .3" width="8" height="8" mark="edge" markrgb=".8 .8 .8"/>
<material name="table" texture="table"/></asset>
<worldbody><light pos="0 0 3" dir=".3 0 -1" diffuse=".4 .4 .4" specular="0 0 0" castshadow="false"/>
<camera name="eye" pos="-.55 0 0" xyaxes="0 -1 0 0 0 1" fovy="46"/>
<geom type="box" size=".01 3 2" pos="2.6 0 0" material="wall" {through}/>
<geom type="box" size=".7 {TABLE_HALF} .01" pos=".8 0 -.38" material="table" {through}/>
<geom type="box" size=".005 {TABLE_HALF} {(NET_TOP + 0.38) / 2}" pos="{NET} 0 {(NET_TOP - 0.38) / 2}"
 rgba=".35 .35 .35 1" {through}/>
<body name="ball" pos="{AWAY} 0 0"><freejoint name="ball"/>{ball} {BOUNCE}/></body>
{decoys}
<body name="paddle" gravcomp="1"><inertial pos="0 0 0" mass="{CAN.mass}" diaginertia="1e-3 1e-3 1e-3"/>
<joint name="across" type="slide" axis="0 1 0"/><joint name="up" type="slide" axis="0 0 1"/>
<geom name="face" type="box" size=".01 {HALF} {HALF}" euler="0 {-TILT_DEGREES} 0" group="3" mass="0" condim="1"
 {BOUNCE}/>
{bars}</body></worldbody>
<actuator><motor joint="across"/><motor joint="up"/></actuator></mujoco>"""

    def arrange(self, rng: np.random.Generator, level: int) -> float:
        """See `MujocoTask.arrange`."""
        numbers = LEVEL[level]
        self._crossing = beside_paddle(rng)
        self._throw("ball", rng, numbers.speed, self._crossing)
        for n in range(DECOYS):
            side, beside, above = rng.choice((-1, 1)), rng.uniform(2 * REACH, 4 * REACH), rng.uniform(-REACH, REACH)
            if n < numbers.decoys:
                self._throw(f"decoy{n}", rng, numbers.speed, np.array([side * beside, above]))
        self._touches = self._touched = False
        return numbers.brightness

    def _throw(self, ball: str, rng: np.random.Generator, speed: float, end: Floats) -> None:
        """Let a ball begin AWAY, to cross the paddle's plane at a place; its spin bends its way evenly."""
        seconds = AWAY / speed
        start = rng.uniform(-STARTS, STARTS, 2)
        angle, bend = rng.uniform(0, 2 * np.pi), BEND * np.sqrt(rng.random())
        lift = bend * speed**2 * np.array([np.cos(angle), np.sin(angle)])
        bent = lift + np.array([0.0, self.model.opt.gravity[2]])
        across = (end - start) / seconds - bent * seconds / 2
        joint = self.data.joint(ball)
        joint.qpos[:3], joint.qvel[:3] = (AWAY, *start), (-speed, *across)
        self.data.body(ball).xfrc_applied[1:3] = MASS * lift

    def drive(self, action: list[float]) -> None:
        """See `MujocoTask.drive`."""
        place, speed = self._paddle()
        right, up = action
        wanted = REACH * np.array([-right, up])
        self.data.ctrl[:] = CAN.force(wanted, place, speed, STEP_S)
        if self._touched:  # spin ends at the paddle
            self.data.body("ball").xfrc_applied[:] = 0.0

    def watch(self) -> None:
        """See `MujocoTask.watch`."""
        self._touches = self.data.ncon > 0
        self._touched |= self._touches

    def verdict(self) -> Verdict:
        """See `MujocoTask.verdict`."""
        place, _ = self._paddle()
        away = float(np.hypot(*(place - self._crossing))) / (2 * REACH)
        end = None
        if self._touched and not self._touches:
            end = self._clears_the_net()
        elif self.data.joint("ball").qpos[0] < -PASSED:
            end = False
        return Verdict(end, float(end is True), 1.0 - away)

    def best_action(self) -> NDArray[np.float32]:
        """The place at which the ball will cross."""
        left, up = self._crossing / REACH
        return np.array([-left, up], np.float32)

    def target(self) -> tuple[Floats, Floats]:
        """See `MujocoTask.target`."""
        place, _ = self._paddle()
        return np.array([0.0, *self._crossing]), np.array([0.0, *place])

    def sensed(self) -> Floats:
        """See `MujocoTask.sensed`."""
        place, speed = self._paddle()
        return np.concatenate([place / REACH, speed / CAN.top])

    def _paddle(self) -> tuple[Floats, Floats]:
        """Place (left, up) [m] and speed [m/s]."""
        joints = [self.data.joint(name) for name in ("across", "up")]
        return np.array([j.qpos[0] for j in joints]), np.array([j.qvel[0] for j in joints])

    def _clears_the_net(self) -> bool:
        """Whether the ball, which flies freely from now on, passes above the net and within the table's width."""
        (x, y, z), (back, across, up) = self.data.joint("ball").qpos[:3], self.data.joint("ball").qvel[:3]
        if back <= 0:
            return False
        seconds = (NET - x) / back
        height = z + up * seconds + self.model.opt.gravity[2] * seconds**2 / 2
        return bool(height > NET_TOP + RADIUS and abs(y + across * seconds) < TABLE_HALF)


def beside_paddle(rng: np.random.Generator) -> Floats:
    """A place (left, up) within reach that a paddle at rest does not cover [m].

    Example:
        >>> bool(np.abs(beside_paddle(np.random.default_rng(0))).max() >= HALF + RADIUS)
        True
    """
    far, near = rng.choice((-1, 1)) * rng.uniform(HALF + RADIUS, REACH), rng.uniform(-REACH, REACH)
    return np.array([far, near] if rng.random() < 0.5 else [near, far])
