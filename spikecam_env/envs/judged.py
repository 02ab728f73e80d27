"""Environments whose agents can be scored: their episodes have a performance, and an action that knows the true state.

Scores (`envs.score`), learning from the oracle and the study of agents need no more than this.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class JudgedEnv(Protocol):
    """A bare environment, below all wrappers (`env.unwrapped`).

    Infos have `performance`, of the episode if it ended here, 1 at best; `is_success`, whether the task is done as
    things stand; `target` (2,), the place in the picture that matters [pixels]; and `distance_px`, how far from it the
    agent is.
    """

    @property
    def steps_played(self) -> int:
        """Steps of this episode; 0 after reset."""
        ...

    def best_action(self) -> NDArray[np.float32]:
        """The oracle's action in the next step, (A,) in [-1, 1]."""
        ...

    def ends_of(self, seed: int, most: int | None = None) -> tuple[float, float]:
        """Performance at the end of the episode that `reset(seed=seed)` begins; no camera is exposed.

        Args:
            seed: of the episode.
            most: steps at most; default: the episode's own.

        Returns:
            (of doing nothing, of the oracle).
        """
        ...


def is_judged(kind: type) -> bool:
    """Whether a class is a `JudgedEnv`; nothing of an environment is called, which may not have begun.

    Example:
        >>> from spikecam_env.envs.tasks.env import TaskEnv
        >>> is_judged(TaskEnv), is_judged(object)
        (True, False)
    """
    return hasattr(kind, "best_action")
