"""How fast CartPole is with a spike camera before it, and where the time goes.

    python -m benchmarks.any_env          one core; the processor's time, so that other programs count little

A step of CartPole is 20 ms, 800 frames of the camera.  light: from a picture to light on pixels; rest: the rules of
CartPole, its wrappers and the camera's.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

import gymnasium
from gymnasium.envs.classic_control import CartPoleEnv

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
"""Methods whose time is counted; that of light holds that of render."""


@contextmanager
def timed(spent: dict[str, float]) -> Iterator[None]:
    """Add the processor's time [s] of every part to `spent`."""
    with ExitStack() as patches:
        for part, (owner, names) in PARTS.items():
            for name in names:
                patches.enter_context(patch.object(owner, name, _timed(getattr(owner, name), spent, part)))
        yield


def _timed(function: Callable[..., Any], spent: dict[str, float], part: str) -> Callable[..., Any]:
    def call(*args: Any, **kwargs: Any) -> Any:
        begin = time.process_time()
        result = function(*args, **kwargs)
        spent[part] += time.process_time() - begin
        return result

    return call


def measured(obs: str, block_frames: int) -> dict[str, Any]:
    """A row: steps a second, and milliseconds of a step by part."""
    env = SpikeCamera(
        gymnasium.make("CartPole-v1", render_mode="rgb_array"), obs, shape=SHAPE, block_frames=block_frames
    )
    env.reset(seed=0)
    env.step(0)  # compiles
    env.reset(seed=0)
    spent: dict[str, float] = defaultdict(float)
    with timed(spent):
        begin, steps, over = time.process_time(), 0, False
        while steps < STEPS and not over:
            over = env.step(steps % 2)[2]
            steps += 1
        total = time.process_time() - begin
    env.close()
    spent["light"] -= spent["render"]
    own = {**{part: spent[part] for part in PARTS}, "rest": total - sum(spent.values())}
    parts = {f"{part} [ms]": 1e3 * seconds / steps for part, seconds in own.items()}
    return {"obs": obs, "block": block_frames, "steps/s": steps / total, **parts}


def main() -> None:
    """Print the table."""
    print(machine())
    print(table([measured(*case) for case in CASES]))


if __name__ == "__main__":
    main()
