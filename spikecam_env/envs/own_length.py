"""Environments whose episodes end by themselves: their specification says after how many steps, which learners need."""

from __future__ import annotations

from copy import copy
from typing import Any

import gymnasium
from gymnasium.envs.registration import EnvSpec


class OwnLength(gymnasium.Env[Any, Any]):
    """A base of environments with `most_steps`, steps of an episode at most."""

    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """Specification by `gymnasium.make`, with the environment's own number of steps."""
        return self._spec

    @spec.setter
    def spec(self, made_of: EnvSpec | None) -> None:
        self._spec = copy(made_of)
        if self._spec is not None:
            self._spec.max_episode_steps = getattr(self, "most_steps")  # noqa: B009
