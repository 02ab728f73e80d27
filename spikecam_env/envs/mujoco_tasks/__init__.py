"""Tasks of real dynamics and contact, by MuJoCo: `pip install 'spikecam-env[mujoco]'`; a file each.

`spikecam_env/NAME-v1` at 64 x 64, `spikecam_env/NAME-Full-v1` at 250 x 400.  A task is a Gymnasium environment of
physics, motors and verdicts (`task.MujocoTask`); `make` puts a spike camera before it.
"""

from spikecam_env.envs.mujoco_tasks.make import MUJOCO_TASKS, make_task
from spikecam_env.envs.mujoco_tasks.task import MujocoTask, Verdict

__all__ = ["MUJOCO_TASKS", "MujocoTask", "Verdict", "make_task"]
