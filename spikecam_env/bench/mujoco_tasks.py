"""Steps a second of a task by MuJoCo, and the processor's time of its parts: physics, drawing, camera.

spikecam bench env

Parts are of one environment: its task alone (physics), the light between the same steps (drawing), the camera on that
light, and the rest.
"""

from __future__ import annotations

from contextlib import closing
from importlib.util import find_spec
from typing import Any

import numpy as np

from spikecam_env.bench.environments import Contestant, cpu_seconds, measured, single, vector

TASK, LEVEL = "Return-v1", 3
COUNT = 16
"""Environments of a vector, each in a process of its own."""
STEPS = 60
"""Steps of an episode whose parts are measured: a ball of the middle level flies for 100."""


def bench_mujoco(seconds: float = 0.8, rounds: int = 5, count: int = COUNT) -> list[dict[str, Any]]:
    """Steps of 40 frames of 64 x 64 pixels.

    Args:
        seconds: time for each row in a round.
        rounds: number of rounds.
        count: environments of the vector.

    Returns:
        Rows as of `environments.bench_vectors`, with physics, drawing, camera and rest [% of a step's processor time];
        none where MuJoCo is not installed.
    """
    if find_spec("mujoco") is None:
        return []
    options = {"shape": (64, 64), "level": LEVEL}
    contestants: list[Contestant] = []
    try:
        contestants += [single(TASK, "tfp", options), vector(TASK, "tfp", "async", count, options)]
        rows = measured(TASK, "tfp", contestants, seconds, rounds, with_single=True)
    finally:
        for one in contestants:
            one.close()
    return [row | (simulator_shares(rounds) if row["how"] == "single" else {}) for row in rows]


def simulator_shares(rounds: int) -> dict[str, float]:
    """Parts of the processor's time of a step [%], medians over rounds of an episode's sums."""
    from spikecam_env.envs.mujoco_tasks import make_task

    with closing(make_task("Return", level=LEVEL, split="test")) as env:
        parts = np.array([_parts(env) for _ in range(rounds + 1)])[1:]
    names = ("physics, %", "drawing, %", "camera, %", "rest, %")
    return dict(zip(names, np.median(100 * parts / parts.sum(axis=1, keepdims=True), axis=0).tolist(), strict=True))


def _parts(env: Any) -> tuple[float, float, float, float]:
    """Seconds of the processor in an episode's steps: physics, drawing, camera, rest."""
    from spikecam_env.envs.mujoco_tasks.make import EyeLight

    task, still = env.unwrapped, np.zeros(env.action_space.shape, np.float32)
    task.reset(seed=0)
    light = EyeLight()(task, env.view)
    light.begin()
    physics = drawing = camera = 0.0
    for _ in range(STEPS):
        begin = cpu_seconds()
        task.step(still)
        stepped = cpu_seconds()
        keys = light.step()
        drawn = cpu_seconds()
        env.sensor.step(keys, round(keys.frame[-1] - keys.frame[0]))
        physics, drawing, camera = physics + stepped - begin, drawing + drawn - stepped, camera + cpu_seconds() - drawn
    light.close()
    env.reset(seed=0)
    begin = cpu_seconds()
    for _ in range(STEPS):
        env.step(still)
    rest = cpu_seconds() - begin - physics - drawing - camera
    return physics, drawing, camera, max(rest, 0.0)
