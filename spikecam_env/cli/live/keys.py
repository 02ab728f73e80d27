"""Keys that steer: those held down become an action.

left a, right d      pan by the top rate
up w, down s         tilt by it
1 2 3 ...            the first, second, third answer, said; of ten answers, 0 to 9 are the digits
1 2 3 ..., e         where a task asks nothing, its first, second, third further number, up; q: the first, down
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
"""Key -> (which of the numbers after the axes, sign), where a task asks nothing."""
ANSWERS = tuple("0123456789")
STEERING = (*TURNS, *FURTHER, *ANSWERS)


def action_of(held: Iterable[str], axes: int, further: int, answers: int = 0) -> NDArray[np.float32]:
    """The action of the keys that are held down.

    Args:
        held: Keys; those that mean nothing here are left out, opposite ones cancel.
        axes: Numbers of the action that turn the camera.
        further: Numbers after those.
        answers: How many of the last ones are answers; the number before them says one.

    Returns:
        (axes + further,) in [-1, 1].
    """
    action = np.zeros(axes + further)
    for key in held:
        answer = answer_of(key, answers)
        if answer is not None:
            action[axes] = action[axes + 1 + answer] = 1.0
        for table, first, count in ((TURNS, 0, axes), (FURTHER, axes, 0 if answers else further)):
            number, sign = table.get(key, (count, 0.0))
            if number < count:
                action[first + number] += sign
    return np.clip(action, -1.0, 1.0).astype(np.float32)


def answer_of(key: str, answers: int) -> int | None:
    """Number of the answer that a key gives: of ten the digit itself, else 1 is the first.

    Example:
        >>> answer_of("1", 4), answer_of("5", 4), answer_of("1", 10)
        (0, None, 1)
    """
    if key not in ANSWERS:
        return None
    number = int(key) - (answers != len(ANSWERS))
    return number if 0 <= number < answers else None


def explained(axes: int, further: int, answers: int = 0) -> str:
    """Which keys there are, in a line; numbers as of `action_of`."""
    turn = "arrows or WASD: turn" if axes > 1 else "left, right or A, D: turn"
    iris = "; E, Q: iris" if further else ""
    own = iris if not answers else "; 0 to 9: answer" if answers == len(ANSWERS) else f"; 1 to {answers}: answer"
    return f"{turn}{own}; space: pause; N: next; Esc: end"
