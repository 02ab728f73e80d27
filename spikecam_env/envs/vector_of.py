"""Entry points of vector environments: `spikecam_env.envs.vector_of:MODULE.CLASS` is the vector of `MODULE:CLASS`.

gymnasium looks a vector environment up as an attribute of a module, by text, so that specifications can be written to
files; every class of environments thus has one, and none has to be declared.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from spikecam_env.envs.vector import SpikeCameraVectorEnv


def __getattr__(name: str) -> Any:
    module, dot, single = name.rpartition(".")
    if not dot:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return partial(SpikeCameraVectorEnv, f"{module}:{single}")
