"""A step of an environment again, in data of our own: the poses between its ends, which the environment does not show.

    before -> mj_step, as many times as the environment called it, with its inputs -> after

The state before holds all on which MuJoCo's step depends; inputs (control, applied forces, mocap poses) are those that
the environment's data holds afterwards.  Where it changed them within the step, or moved things by hand, the replay
ends elsewhere; poses are then taken on the straight way from before to after, and `exact` is false.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from scenes.mujoco.importing import import_mujoco
from spikecam_env.errors import InputError, NotReadyError
from spikecam_env.types import Floats

MOST_STEPS = 1_000_000
"""Steps of physics in a step of an environment at most: beyond, the time was set by hand."""


@dataclass(frozen=True)
class State:
    """All on which MuJoCo's next steps depend."""

    values: Floats
    """Of mjSTATE_INTEGRATION."""
    time_s: float
    qpos: Floats
    mocap: tuple[Floats, Floats]
    """Places (nmocap, 3) and quaternions (nmocap, 4) of what is moved by hand."""

    @classmethod
    def of(cls, model: Any, data: Any) -> State:
        """Of data, copied."""
        mujoco = import_mujoco()
        values = _state(model, data, mujoco.mjtState.mjSTATE_INTEGRATION)
        return cls(values, float(data.time), data.qpos.copy(), (data.mocap_pos.copy(), data.mocap_quat.copy()))


@dataclass(frozen=True)
class Course:
    """Poses at rising times, from the state before a step to the state after it."""

    time_s: Floats
    """(N,)"""
    qpos: Floats
    """(N, nq)"""
    mocap: tuple[tuple[Floats, Floats], tuple[Floats, Floats]]
    """Before and after."""
    exact: bool
    """Whether the replay ended in the state after, bit for bit."""


def replay(model: Any, scratch: Any, before: State, after: Any) -> Course:
    """The course of a step.

    Args:
        model: mujoco.MjModel.
        scratch: mujoco.MjData of this model, which is changed.
        before: State.of the environment's data before the step.
        after: the environment's mujoco.MjData after it.

    Returns:
        Poses after every step of physics; those of the two ends alone where the replay ended elsewhere.

    Raises:
        NotReadyError: time has not advanced.
        InputError: there are too many steps of physics between.
    """
    mujoco = import_mujoco()
    span = float(after.time) - before.time_s
    steps = round(span / model.opt.timestep)
    if steps < 1:
        raise NotReadyError(
            f"the simulation's time went from {before.time_s:g} to {after.time:g} s: no step of physics lies between; "
            "call begin() after every reset"
        )
    if steps > MOST_STEPS:
        raise InputError(f"{steps} steps of physics lie between two calls; at most {MOST_STEPS} can be replayed")
    mujoco.mj_setState(model, scratch, before.values, mujoco.mjtState.mjSTATE_INTEGRATION)
    inputs = mujoco.mjtState.mjSTATE_USER
    mujoco.mj_setState(model, scratch, _state(model, after, inputs), inputs)
    qpos, time_s = np.empty((steps + 1, model.nq)), np.empty(steps + 1)
    qpos[0], time_s[0] = before.qpos, before.time_s
    for step in range(1, steps + 1):
        mujoco.mj_step(model, scratch)
        qpos[step], time_s[step] = scratch.qpos, scratch.time
    mocap = (before.mocap, (after.mocap_pos.copy(), after.mocap_quat.copy()))
    if np.array_equal(scratch.qpos, after.qpos) and np.array_equal(scratch.qvel, after.qvel):
        return Course(time_s, qpos, mocap, exact=True)
    return Course(np.array([before.time_s, after.time]), np.stack([before.qpos, after.qpos]), mocap, exact=False)


def pose_at(model: Any, scratch: Any, course: Course, time_s: float) -> None:
    """Put everything where it is at a time of the course: between two poses at even speed, along joints' own paths.

    MuJoCo's Euler integrators move so within a step; what is moved by hand goes evenly from before to after.
    """
    mujoco = import_mujoco()
    step = int(np.clip(np.searchsorted(course.time_s, time_s, side="right") - 1, 0, len(course.time_s) - 2))
    start, end = course.time_s[step], course.time_s[step + 1]
    share = float(np.clip((time_s - start) / (end - start), 0, 1))
    if share == 1:
        scratch.qpos[:] = course.qpos[step + 1]
    else:
        scratch.qpos[:] = course.qpos[step]
        if share > 0:
            speed = np.empty(model.nv)
            mujoco.mj_differentiatePos(model, speed, 1.0, course.qpos[step], course.qpos[step + 1])
            mujoco.mj_integratePos(model, scratch.qpos, speed, share)
    if model.nmocap:
        whole = (time_s - course.time_s[0]) / (course.time_s[-1] - course.time_s[0])
        (old, old_turn), (new, new_turn) = course.mocap
        near = np.where(np.sum(old_turn * new_turn, axis=1, keepdims=True) < 0, -new_turn, new_turn)
        scratch.mocap_pos[:] = old + whole * (new - old)
        scratch.mocap_quat[:] = old_turn + whole * (near - old_turn)  # MuJoCo makes it a unit quaternion
    posed(model, scratch)


def posed(model: Any, data: Any) -> None:
    """Compute all that is drawn, and no more, from qpos: without contacts and forces."""
    mujoco = import_mujoco()
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    if model.nflex:
        mujoco.mj_flex(model, data)
    if model.ntendon:
        mujoco.mj_tendon(model, data)


def _state(model: Any, data: Any, which: Any) -> Floats:
    mujoco = import_mujoco()
    values = np.empty(mujoco.mj_stateSize(model, which))
    mujoco.mj_getState(model, data, values, which)
    return values
