"""How fast CartPole is with a spike camera before it, and where the time goes.

    python -m benchmarks.any_env          one core; processor's time, so that other programs count little

A step of CartPole is 20 ms: 800 frames of the camera.  `simulator` is the rules of CartPole and all else of a step.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any

import gymnasium

from spikecam_env.bench.machine import machine
from spikecam_env.cli.table import table
from spikecam_env.envs.light_between import RenderedLight
from spikecam_env.envs.observations import CameraView
from spikecam_env.envs.wrappers import SpikeCamera

STEPS = 100
SHAPES = ((64, 64), (128, 128))
LAWS = ("tfp", "tfi")


def timed(function: Callable[..., Any], spent: dict[str, float], name: str) -> Callable[..., Any]:
    """The function, whose processor's time [s] is added to `spent` under a name."""

    def call(*args: Any, **kwargs: Any) -> Any:
        begin = time.process_time()
        try:
            return function(*args, **kwargs)
        finally:
            spent[name] += time.process_time() - begin

    return call


def measured(obs: str, shape: tuple[int, int]) -> dict[str, Any]:
    """A row: milliseconds of a step, and the shares of its parts."""
    bare = gymnasium.make("CartPole-v1", render_mode="rgb_array")
    spent: dict[str, float] = defaultdict(float)
    bare.unwrapped.render = timed(bare.unwrapped.render, spent, "render")  # type: ignore[method-assign]

    def timed_light(inner: Any, view: CameraView) -> RenderedLight:
        light = RenderedLight(inner, view)
        light.step = timed(light.step, spent, "light")  # type: ignore[method-assign]
        return light

    env = SpikeCamera(bare, obs, shape=shape, make_light=timed_light)
    env.reset(seed=0)
    env.step(0)  # compiles
    env.reset(seed=0)
    env.sensor.step = timed(env.sensor.step, spent, "sensor")  # type: ignore[method-assign]
    spent.clear()
    begin, steps = time.process_time(), 0
    while steps < STEPS:
        steps += 1
        if env.step(steps % 2)[2]:
            break
    total = time.process_time() - begin
    env.close()
    own = {"render": spent["render"], "light": spent["light"] - spent["render"], "sensor": spent["sensor"]}
    shares = {f"{name} [ms]": 1e3 * seconds / steps for name, seconds in own.items()}
    rest = 1e3 * (total - sum(own.values())) / steps
    return {"obs": obs, "shape": f"{shape[0]} x {shape[1]}", "steps/s": steps / total, **shares, "simulator [ms]": rest}


def main() -> None:
    """Print the table."""
    print(machine())
    print(table([measured(obs, shape) for shape in SHAPES for obs in LAWS]))


if __name__ == "__main__":
    main()
