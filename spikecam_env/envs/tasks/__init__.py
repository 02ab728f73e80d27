"""The tasks by name, a file each: `spikecam_env/NAME-v1` at 64 x 64, `spikecam_env/NAME-Full-v1` at 250 x 400.

A task is a frozen dataclass (`base.Task`) whose `draw` gives an episode; `env.TaskEnv` plays it.
"""

from __future__ import annotations

from dataclasses import fields

from spikecam_env.envs.tasks.base import Task
from spikecam_env.envs.tasks.catch import Catch
from spikecam_env.envs.tasks.exposure import Exposure
from spikecam_env.envs.tasks.low_light import LowLight
from spikecam_env.envs.tasks.read_digit import ReadDigit
from spikecam_env.envs.tasks.read_spin import ReadSpin
from spikecam_env.envs.tasks.saccade import Saccade
from spikecam_env.envs.tasks.track import Track

__all__ = ["TASKS", "Catch", "Exposure", "LowLight", "ReadDigit", "ReadSpin", "Saccade", "Task", "Track"]

TASKS: dict[str, type[Task]] = {
    "Track": Track,
    "Saccade": Saccade,
    "Catch": Catch,
    "ReadSpin": ReadSpin,
    "ReadDigit": ReadDigit,
    "LowLight": LowLight,
    "Exposure": Exposure,
}


def whose_number(name: str) -> str:
    """A hint for a keyword that is a number of tasks; nothing for others."""
    of = [task for task, kind in TASKS.items() if name in (field.name for field in fields(kind))]
    if not of:
        return ""
    return f"it is a number of tasks ({', '.join(of)}): TaskEnv({of[0]}({name}=...)), or make(id, task={of[0]}(...))"
