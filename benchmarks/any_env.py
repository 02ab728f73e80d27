"""How fast CartPole is with a spike camera before it, and where the time goes.

    python -m benchmarks.any_env          one core; the processor's time, so that other programs count little

A step of CartPole is 20 ms, 800 frames of the camera.  light: from a picture to light on pixels; rest: the rules of
CartPole, its wrappers and the camera's.
"""

from __future__ import annotations

import time
from typing import Any

import gymnasium
from gymnasium.envs.classic_control import CartPoleEnv

from benchmarks.clocked import Clocked
from spikecam_env.bench.machine import machine
from spikecam_env.cli.table import table
from spikecam_env.envs.light_between import RenderedLight
from spikecam_env.envs.observations import ObservedStream
from spikecam_env.envs.wrappers import SpikeCamera
from spikecam_env.sensor import SpikeSensor

STEPS = 50
SHAPE = (64, 64)
CASES = (("tfp", 40), ("tfi", 40), ("rate", 40), ("rate", 800))
"""Observation, and frames of the observed block."""
PARTS: dict[str, tuple[type, tuple[str, ...]]] = {
    "render": (CartPoleEnv, ("render",)),
    "light": (RenderedLight, ("step",)),
    "sensor": (SpikeSensor, ("step",)),
    "observation": (ObservedStream, ("step", "skip")),
}
"""Methods whose time is counted."""


def measured(obs: str, block_frames: int) -> dict[str, Any]:
    """A row: steps a second, and milliseconds of a step by part."""
    env = SpikeCamera(
        gymnasium.make("CartPole-v1", render_mode="rgb_array"), obs, shape=SHAPE, block_frames=block_frames
    )
    env.reset(seed=0)
    env.step(0)  # compiles
    env.reset(seed=0)
    clocked = Clocked(time.process_time)
    with clocked.of((part, owner, name) for part, (owner, names) in PARTS.items() for name in names):
        begin, steps, over = time.process_time(), 0, False
        while steps < STEPS and not over:
            over = env.step(steps % 2)[2]
            steps += 1
        total = time.process_time() - begin
    env.close()
    own = {**{part: clocked.seconds[part] for part in PARTS}, "rest": total - sum(clocked.seconds.values())}
    parts = {f"{part} [ms]": 1e3 * seconds / steps for part, seconds in own.items()}
    return {"obs": obs, "block": block_frames, "steps/s": steps / total, **parts}


def main() -> None:
    """Print the table."""
    print(machine())
    print(table([measured(*case) for case in CASES]))


if __name__ == "__main__":
    main()
