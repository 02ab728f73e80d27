"""A classical reader: plates of every character, smeared as motion smears them, are correlated with the pictures.

    evidence of a character at a column     -n/2 log(1 - r^2),  r: normalised correlation of n pixels
    evidence of a character on a path       its sum over the steps, along a place that moves evenly
    a path is a number's                    by the evidence of its best digit, less that of its best letter

The answer is given just before the earliest end of an episode; where levels are mixed, and with them ends, when the
best path has left the picture.  Smear is that of the camera's exposure, and a picture that a slow camera shows again is
no evidence.  Frames of spikes are moved to where a plate of the level's speed is at their middle, then added: light of
all of them, and little smear.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, inf
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from spikecam_env.agents.controllers.timing import PictureTiming
from spikecam_env.envs.mujoco_tasks.read import (
    AFTER_S,
    BEFORE_S,
    LETTERS,
    LEVEL,
    PLATE,
    RISE,
    SLED,
    SPEEDS_APART,
    VARIANTS,
    VIEW,
    Read,
    plate,
)
from spikecam_env.envs.mujoco_tasks.task import STEP_S
from spikecam_env.envs.tasks.digits import DIGITS
from spikecam_env.types import Floats, Pictures

SPEEDS = 9
"""Speeds that are tried about each level's."""
TOLERANCE = 2
"""Pixels by which a plate may lie beside its path."""
CHANCE = 1.5
"""Evidence that chance gives, over the most in the first picture, if that was taken before a sled can be in view."""
ROUNDING = 1e-3
"""Of times of pictures [steps]."""
INK, PAINT = (0.05, 0.9), 0.28
"""Light of a plate's darkest place and range up to its brightest, and mean light of the sled's paint beside it."""
BESIDE = 16
"""Pixels beside a plate, at most, over which its smear is compared too: more are often out of view."""
SURE = 60.0
"""Evidence of a digit over that of letters [nats] at which it is believed before the end."""


class ReadController:
    """Reads the plate: `begin` an episode, then `act(observation)`.

    Args:
        env: the bare task, whose shape and levels it is made for.
        timing: of the pictures, which are grey, or the frames of a block of spikes; default: of the task's own block.

    Example:
        >>> env = Read(level=1)
        >>> controller = ReadController(env)
        >>> controller.begin()
        >>> float(controller.act({"picture": np.zeros((1, 64, 64), np.uint8)})[0])
        -1.0
    """

    def __init__(self, env: Read, timing: PictureTiming | None = None) -> None:
        self._timing = PictureTiming.of(env) if timing is None else timing
        self._scale = env.shape[0] / VIEW
        lowest, highest = env.levels
        pixels = self._scale * STEP_S
        self._levels = [_Speed(LEVEL[n].speed * pixels, self._scale, self._timing) for n in range(lowest, highest + 1)]
        passage = (VIEW * env.shape[1] / env.shape[0] + SLED[0]) / (LEVEL[lowest].speed * (1 + SPEEDS_APART))
        self._is_mixed = lowest < highest
        self._last = ceil((BEFORE_S[0] + passage + AFTER_S) / STEP_S)
        self.begin()

    def begin(self) -> None:
        """Forget all pictures: an episode begins."""
        self._steps, self._middle = 0, -inf
        self._best = (-inf, 0, False)
        for level in self._levels:
            level.begin()

    def act(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """The action, (11,)."""
        middle = self._timing.middle_step(observation, self._steps)
        if middle > self._middle + ROUNDING:
            self._middle = middle
            planes = [self._seen(plane) for plane in observation["picture"].astype(np.float32)]
            self._best = max(level.found(planes, middle, self._is_before(middle)) for level in self._levels)
        margin, number, is_gone = self._best
        self._steps += 1
        action = np.zeros(1 + len(DIGITS), np.float32)
        is_early = self._is_mixed and is_gone and margin > SURE
        action[0] = 1.0 if is_early or self._steps >= self._last else -1.0
        action[1 + number] = 1.0
        return action

    def _is_before(self, middle: float) -> bool:
        """Whether a picture was taken before a sled can be in view."""
        return middle + self._timing.exposure_steps / 2 <= BEFORE_S[0] / STEP_S + ROUNDING

    def _seen(self, picture: Pictures) -> Pictures:
        """The rows in which plates can be, with room at both sides for plates that are partly out of view."""
        half = round((PLATE[1] / 2 + RISE) * self._scale) + TOLERANCE
        rows, beside = picture.shape[0], round(PLATE[0] / 2 * self._scale)
        cut = picture[max(0, rows // 2 - half) : rows // 2 + half]
        return np.pad(cut, ((0, 0), (beside, beside)), constant_values=float(cut.mean()))


class _Speed:
    """Plates and paths of a level."""

    def __init__(self, px_a_step: float, scale: float, timing: PictureTiming) -> None:
        self._px_a_step, self._way = px_a_step, px_a_step * timing.exposure_steps
        share = 1.0 if timing.planes == 1 else SPEEDS_APART + 1.0 / timing.planes
        smear = max(1, round(share * self._way))
        size = round(PLATE[0] * scale), round(PLATE[1] * scale)
        self._plates = [
            [_smeared(plate(name, variant), size, smear) for variant in range(VARIANTS)] for name in (*DIGITS, *LETTERS)
        ]
        self.begin()

    def begin(self) -> None:
        """Forget all pictures."""
        self._chance: Any = 0.0
        self._evidence: list[tuple[float, Floats]] = []  # time [steps], as of `_evidence_of`

    def found(self, planes: Sequence[Pictures], now: float, is_empty: bool) -> tuple[float, int, bool]:
        """Evidence of the best number with this further picture, the number, and whether it has left the picture.

        Args:
            planes: the rows of plates in the picture, or in each frame of a block.
            now: middle of its exposure [steps].
            is_empty: whether no sled can be in it, so that it shows what chance gives.
        """
        seen = self._evidence_of(planes)
        if is_empty and not self._evidence:
            self._chance = CHANCE * seen.max(axis=(0, 2))[:, None]
        self._evidence.append((now, np.maximum(seen - self._chance, 0.0)))
        columns = seen.shape[2]
        room = int(self._px_a_step * (1 + SPEEDS_APART) * (now - self._evidence[0][0]))
        best = (-inf, 0, False)
        for speed in self._px_a_step * np.linspace(1 - SPEEDS_APART, 1 + SPEEDS_APART, SPEEDS):
            for heading in range(2):
                end = np.arange(0, columns + room, TOLERANCE)  # places now, in the direction of motion
                total = np.zeros((len(self._plates), len(end)))
                for time, evidence in self._evidence:
                    then = np.rint(end - speed * (now - time)).astype(int)
                    inside = (then >= 0) & (then < columns)
                    total[:, inside] += evidence[heading][:, then[inside]]
                digits, letters = np.split(total, [len(DIGITS)])
                margin = digits.max(axis=0) - letters.max(axis=0)
                at = int(margin.argmax())
                best = max(best, (float(margin[at]), int(digits[:, at].argmax()), bool(end[at] >= columns)))
        return best

    def _evidence_of(self, planes: Sequence[Pictures]) -> Floats:
        """(2, characters, columns) for motion to the left and to the right; columns are in the direction of motion."""
        pictures = planes if len(planes) == 1 else [_added(planes, heading * self._way) for heading in (-1, 1)]
        seen = [np.stack([_evidence(picture, variants) for variants in self._plates]) for picture in pictures]
        return np.stack([seen[0][:, ::-1], seen[-1]])


def _smeared(picture: Pictures, size: tuple[int, int], smear: int) -> Pictures:
    """A plate of (columns, rows) pixels that moves by `smear` of them, with its smear over BESIDE at both sides."""
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    beside, (dark, light) = min(smear // 2, BESIDE), INK
    wide = cv2.copyMakeBorder(dark + light * small, 0, 0, smear, smear, cv2.BORDER_CONSTANT, value=PAINT)
    moved = cv2.blur(wide, (smear, 1), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(moved[:, smear - beside : smear + size[0] + beside], np.float32)


def _added(frames: Sequence[Pictures], way: float) -> Pictures:
    """The mean of frames, each moved to where that which goes `way` pixels to the right is at their middle."""
    back = way * ((np.arange(len(frames)) + 0.5) / len(frames) - 0.5)
    moved = [
        cv2.warpAffine(frame, np.array([[1, 0, -x], [0, 1, 0]]), frame.shape[::-1], borderValue=float(frame.mean()))
        for frame, x in zip(frames, back, strict=True)
    ]
    return np.asarray(np.mean(moved, axis=0), np.float32)


def _evidence(picture: Pictures, variants: list[Pictures]) -> Floats:
    """(columns,) of a character whose plate begins there."""
    each = [cv2.matchTemplate(picture, one, cv2.TM_CCOEFF_NORMED).max(axis=0) for one in variants]
    near = cv2.dilate(np.max(each, axis=0)[None], np.ones((1, 2 * TOLERANCE + 1), np.uint8))[0]
    return np.asarray(-variants[0].size / 2 * np.log1p(-(np.clip(near, 0.0, 0.99) ** 2)), np.float64)
