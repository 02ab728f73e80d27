"""Keys that steer: what is held down becomes an action.

left a, right d      pan by the top rate
up w, down s         tilt by it
1 2 3 ...            the first, second, third of a task's further numbers, up
e, q                 the first of them, up and down
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

TURNS = {
    "left": (0, -1.0),
    "a": (0, -1.0),
    "right": (0, 1.0),
    "d": (0, 1.0),
    "up": (1, -1.0),
    "w": (1, -1.0),
    "down": (1, 1.0),
    "s": (1, 1.0),
}
"""Key -> (axis, sign); pan is to the right, tilt is down."""
FURTHER = {str(number): (number - 1, 1.0) for number in range(1, 10)} | {"e": (0, 1.0), "q": (0, -1.0)}
"""Key -> (which of the numbers after the axes, sign)."""
STEERING = (*TURNS, *FURTHER)


def plain(key: str | None) -> str:
    """A key's name without shift and the like: `shift+LEFT` and `left` steer alike."""
    name = (key or "").rpartition("+")[2].lower()
    return "space" if name == " " else name


def action_of(held: Iterable[str], axes: int, further: int) -> NDArray[np.float32]:
    """(axes + further,) in [-1, 1]; keys that mean nothing here are left out, opposite ones cancel."""
    action = np.zeros(axes + further)
    for key in held:
        for table, first, count in ((TURNS, 0, axes), (FURTHER, axes, further)):
            number, sign = table.get(key, (count, 0.0))
            if number < count:
                action[first + number] += sign
    return np.clip(action, -1.0, 1.0).astype(np.float32)


def explained(axes: int, further: int) -> str:
    """Which keys there are, in a line."""
    turn = "arrows or WASD: turn" if axes > 1 else "left, right or A, D: turn"
    own = {0: "", 1: "; E, Q: iris"}.get(further, f"; 1 to {further}: answer")
    return f"{turn}{own}; space: pause; N: next; Esc: end"
