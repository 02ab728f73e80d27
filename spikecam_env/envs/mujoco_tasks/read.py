"""Read: a number on a plate passes at 16 to 156 m/s, 5 to 50 pixels a millisecond of a picture of 64; say it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any, ClassVar

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.textures import TEXTURES, Texture
from spikecam_env.envs.mujoco_tasks.task import MujocoTask, Verdict
from spikecam_env.envs.task import OUTCOME, PROGRESS
from spikecam_env.envs.tasks.digits import DIGITS, HEIGHT, digit
from spikecam_env.types import Floats

VIEW = 0.2
"""Height of the view at the plates [m]."""
EYE_AWAY = 1.2
"""Distance of the camera from the plates [m]."""
CHARACTER = 0.08
"""Height of a digit or letter [m], that which the Vienna Convention on Road Traffic (1968), annex 3, asks for at least
of the letters on a vehicle; it asks for strokes of 0.01 m, and `digits.STROKE` is 0.0096 to 0.016 m."""
PLATE = (0.08, 0.11)
"""Width and height of a plate [m]."""
SLOTS = (-0.11, 0.0, 0.11)
"""Places of plates along the sled, from its middle [m]."""
SLED = (0.36, 0.15)
"""Length and height of the sled [m]."""
MASS = 20.0
"""Of the sled [kg]."""
BOUNCE_HZ, DAMPING = 10.0, 0.1
"""Undamped frequency of both springs of the sled, for rise and pitch, as of a bogie's on its primary springs; share of
the critical damping."""
RISE, PITCH = 0.01, np.radians(2.0)
"""Largest amplitude of the sled's bounce [m], and of its pitch [rad]."""
SPEEDS_APART = 0.1
"""Most that an episode's speed differs from its level's [share]."""
BEFORE_S = (0.001, 0.006)
"""Time until the sled comes into view: least, most [s]."""
AFTER_S = 0.005
"""Time to answer after the sled has left the view [s]."""
LETTERS = "AEFHKLNPTX"
"""Letters, without those that could be digits (B, I, O, S, Z)."""
VARIANTS = 4
"""Fonts, strokes and slants in which every character is there."""
TEXTURE_SIDE = 128
"""Of the picture of which a plate's texture is the middle [pixels]; 0.16 m."""
BLOCK_FRAMES = 8
"""Last frames of a step that are observed: 0.2 ms, in which a picture of 64 smears by 1 to 10 pixels, at level 3 by 4;
a whole step smears by 5 to 50, a digit's height is 26."""
SURFACES = {"wall": "dead_leaves", "paint": "fractal_noise"}
"""What is behind the plates, and its texture."""


@dataclass(frozen=True)
class ReadLevel:
    """Numbers of a level."""

    speed: float
    """Of the sled [m/s]; 3.125 are a pixel a millisecond where the picture has 64 rows."""
    brightness: float
    """Of the lamps; 1 is full."""
    letters: int
    """Plates with a letter beside the number's."""


LEVEL = {
    1: ReadLevel(15.625, 1.0, 0),
    2: ReadLevel(31.25, 0.6, 0),
    3: ReadLevel(62.5, 0.4, 1),
    4: ReadLevel(109.375, 0.2, 2),
    5: ReadLevel(156.25, 0.1, 2),
}
"""5, 10, 20, 35 and 50 pixels a millisecond; the last is just below the record on rails (TGV, 2007: 160 m/s)."""


class Read(MujocoTask):
    """Say the number on a sled that passes.

    Scene:
        The camera looks at a rail from the side. A sled passes from the left or the right at 16 (level 1) to 156 m/s
        (level 5); it bounces and pitches on its springs. On one of three places is a plate with a digit from 0 to 9;
        from level 3 on there are plates with letters, which are not asked for.
    Action:
        11 numbers in [-1, 1]: say, and one for each digit. A say above 0 gives the answer: the digit with the largest
        number. A step is 1 ms.
    Encoders:
        The share of the longest episode's time that is over.
    Reward:
        10 for the right answer; 10 / 9 less for a wrong one, so that a guess is worth nothing on average.
    End:
        Terminated by an answer, or 5 ms after the sled has left the view; 60 steps at most.
    Success:
        The right answer. Performance: 1 for a success.
    """

    most_steps: ClassVar[int] = 60
    answers: ClassVar[int] = len(DIGITS)
    actions: ClassVar[int] = 1 + answers
    sensed_numbers: ClassVar[int] = 1
    stream: ClassVar[int] = 23
    camera_defaults: ClassVar[Mapping[str, Any]] = MappingProxyType(
        {"block_frames": BLOCK_FRAMES, "motion_per_key": 1.5}
    )

    def xml(self) -> str:
        """See `MujocoTask.xml`; x is along the rail, y away from the camera, z up."""
        through = 'contype="0" conaffinity="0"'
        plates = "\n".join(
            f'<geom name="plate{n}" type="box" size="{PLATE[0] / 2} {PLATE[1] / 2} .001" pos="{x} .002 0"'
            f' xyaxes="1 0 0 0 0 1" rgba="1 1 1 0" mass="0" {through}/>'
            for n, x in enumerate(SLOTS)
        )
        textures = "\n".join(
            f'<texture name="{name}" type="2d" file="{name}.png"/><material name="{name}" texture="{name}"/>'
            for name in _textures()
        )
        length, height = SLED
        spring = (2 * np.pi * BOUNCE_HZ) ** 2
        damping = 2 * DAMPING * 2 * np.pi * BOUNCE_HZ
        inertia = MASS * (length**2 + height**2) / 12
        return f"""<mujoco model="read">
<option timestep="0.00025" integrator="Euler"/><visual><quality shadowsize="0"/><map znear=".01" zfar="20"/>
<headlight ambient=".6 .6 .6" diffuse=".35 .35 .35" specular="0 0 0"/></visual>
<asset>{textures}</asset>
<worldbody><camera name="eye" pos="0 {-EYE_AWAY} 0" xyaxes="1 0 0 0 0 1"
 fovy="{2 * np.degrees(np.arctan(VIEW / 2 / EYE_AWAY))}"/>
<geom type="box" size="1 1 .01" pos="0 1 0" xyaxes="1 0 0 0 0 1" material="wall" {through}/>
<geom type="box" size="1 .02 .01" pos="0 .1 -.09" rgba=".5 .5 .5 1" {through}/>
<body name="sled" gravcomp="1">
<inertial pos="0 0 0" mass="{MASS}" diaginertia="{inertia} {inertia} {inertia}"/>
<joint name="way" type="slide" axis="1 0 0"/>
<joint name="rise" type="slide" axis="0 0 1" stiffness="{MASS * spring}" damping="{MASS * damping}"/>
<joint name="pitch" type="hinge" axis="0 1 0" stiffness="{inertia * spring}" damping="{inertia * damping}"/>
<geom type="box" size="{length / 2} {height / 2} .02" pos="0 .03 0" xyaxes="1 0 0 0 0 1" material="paint" mass="0"
 {through}/>
{plates}</body></worldbody></mujoco>"""

    def assets(self) -> dict[str, bytes]:
        """See `MujocoTask.assets`."""
        return {f"{name}.png": picture for name, picture in _textures().items()}

    def arrange(self, rng: np.random.Generator, level: int) -> float:
        """See `MujocoTask.arrange`."""
        numbers = LEVEL[level]
        self._truth, self._said = int(rng.integers(self.answers)), -1
        self._heading = float(rng.choice((-1, 1)))
        order = rng.permutation(len(SLOTS))
        shown = [DIGITS[self._truth], *rng.choice(list(LETTERS), numbers.letters, replace=False)]
        variants = rng.integers(VARIANTS, size=len(SLOTS))
        self._slot = float(SLOTS[order[0]])
        for n, (slot, variant) in enumerate(zip(order, variants, strict=True)):
            geom = self.model.geom(f"plate{slot}")
            geom.rgba[3] = n < len(shown)
            if n < len(shown):
                geom.matid = self.model.material(f"{shown[n]}{variant}").id
        speed = numbers.speed * (1 + rng.uniform(-SPEEDS_APART, SPEEDS_APART))
        start = self._half_view + SLED[0] / 2 + speed * rng.uniform(*BEFORE_S)
        way, *springs = (self.data.joint(name) for name in ("way", "rise", "pitch"))
        way.qpos, way.qvel = -self._heading * start, self._heading * speed
        for joint, most in zip(springs, (RISE, PITCH), strict=True):
            amplitude, phase = most * rng.random(), rng.uniform(0, 2 * np.pi)
            joint.qpos, joint.qvel = amplitude * np.cos(phase), -amplitude * 2 * np.pi * BOUNCE_HZ * np.sin(phase)
        return numbers.brightness

    def drive(self, action: list[float]) -> None:
        """See `MujocoTask.drive`."""
        say, *numbers = action
        if say > 0.0:
            self._said = int(np.argmax(numbers))

    def verdict(self) -> Verdict:
        """See `MujocoTask.verdict`."""
        if self._said >= 0:
            is_right = self._said == self._truth
            cost = 0.0 if is_right else OUTCOME / PROGRESS / (self.answers - 1)
            return Verdict(is_right, float(is_right), -cost)
        way = self.data.joint("way")
        beyond = self._heading * way.qpos[0] - self._half_view - SLED[0] / 2
        return Verdict(False if beyond > abs(way.qvel[0]) * AFTER_S else None, 0.0, 0.0)

    def best_action(self) -> NDArray[np.float32]:
        """The right answer, said once the plate has been wholly in view."""
        has_come = self._heading * (self.data.joint("way").qpos[0] + self._slot) > PLATE[0] / 2 - self._half_view
        numbers = np.arange(self.answers) == self._truth
        return np.array([1.0 if has_come else -1.0, *numbers], np.float32)

    def target(self) -> tuple[Floats, Floats]:
        """The plate, and the middle of the view; see `MujocoTask.target`."""
        place = [self.data.joint("way").qpos[0] + self._slot, 0.0, self.data.joint("rise").qpos[0]]
        return np.array(place), np.zeros(3)

    def sensed(self) -> Floats:
        """See `MujocoTask.sensed`."""
        return np.array([self.steps_played / self.most_steps])

    @property
    def _half_view(self) -> float:
        """Half the width of the view at the plates [m]."""
        rows, columns = self.shape
        return VIEW / 2 * columns / rows


def plate(character: str, variant: int) -> Texture:
    """(rows, columns) of a plate.

    Args:
        character: a digit or one of LETTERS.
        variant: which of VARIANTS.

    Example:
        >>> plate("7", 0).shape
        (88, 64)
    """
    whole = digit(character, TEXTURE_SIDE, np.random.default_rng([variant, ord(character)]), bar=False)
    columns, rows = (round(size / CHARACTER * HEIGHT * TEXTURE_SIDE) for size in PLATE)
    top, left = (TEXTURE_SIDE - rows) // 2, (TEXTURE_SIDE - columns) // 2
    return whole[top : top + rows, left : left + columns]


@cache
def _textures() -> dict[str, bytes]:
    """PNG files by the names of materials: of every plate, the wall behind, and the sled's paint."""
    plates = {f"{name}{variant}": plate(name, variant) for name in (*DIGITS, *LETTERS) for variant in range(VARIANTS)}
    rng = np.random.default_rng(0)
    surfaces = {name: TEXTURES[kind](rng, TEXTURE_SIDE) for name, kind in SURFACES.items()}
    return {name: _png(0.9 * picture + 0.05) for name, picture in plates.items()} | {
        name: _png(0.35 * picture + 0.1) for name, picture in surfaces.items()
    }


def _png(picture: Texture) -> bytes:
    return bytes(cv2.imencode(".png", np.rint(255 * picture).astype(np.uint8))[1])
