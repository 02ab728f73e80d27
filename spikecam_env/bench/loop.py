"""How fast the whole loop is, scene -> noisy spikes -> denoised rates, and where its time goes.

spikecam bench loop

Beside it, block by block on the same spikes, the mode `fast`, and a plain denoiser: the float32 network, called as in
training.
Other programs slow a machine, so both are compared by the processor's time.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from tqdm import tqdm

from denoiser.online import OnlineDnSS
from denoiser.weights import load_weights, pretrained_path
from scenes.catalogue import make_scene
from scenes.flat.disk import RotatingDisk
from scenes.protocol import Scene
from spikecam_env.bench.machine import FRAME_RATE_HZ, SHAPE
from spikecam_env.sensor import SpikeSensor
from spikecam_env.torch_settings import torch_settings

BLOCK = 64
"""Frames taken through the loop at a time."""

WARM = 2
"""Blocks that are not timed: kernels are compiled in them, and the denoiser's pipeline fills."""

SPACE = "tumble"
"""The scene in space: six bodies of 17 000 triangles."""

STAGES = ("light", "camera", "denoiser")
WHOLE = "whole"
FAST = "denoiser, mode fast"
FIRST_WAY = "denoiser, float32, called as in training"

Rows = list[dict[str, Any]]
Seconds = dict[str, NDArray[np.float64]]
"""By stage, of a block: (wall clock, processor)."""


class CalledAsInTraining(nn.Module):
    """A network whose passes are calls of `forward`."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, spikes: Tensor, planes: Tensor, carried: tuple[Tensor, Tensor] | None) -> Any:
        """As the network's."""
        return self.network(spikes, planes, carried)


def bench_loop(
    shape: tuple[int, int] = SHAPE, seconds: float = 8.0, threads: int | None = None, engine: str = "torch"
) -> dict[str, Rows]:
    """Measure the loop in two scenes.

    Args:
        shape: rows and columns.
        seconds: time for each scene, all denoisers included; three blocks of 64 frames at least.
        threads: threads of torch, default its own; light and camera take NUMBA_NUM_THREADS.
        engine: engine of the denoiser.

    Returns:
        A table a scene, by title.  Its rows have stage, frames/s (wall clock) and x real time (40 000 frames a
        second).  processor ms/frame and of the whole, %, are by the processor's time.  So is x plain float32, of the
        denoisers and of the whole: medians over blocks.
    """
    with torch_settings(threads):
        scenes: dict[str, Callable[[], Scene]] = {
            "disk": lambda: RotatingDisk(shape),
            SPACE: lambda: make_scene(SPACE, shape),
        }
        tables = {
            f"{name}: scene to denoised rates": loop_table(make(), seconds, engine)
            for name, make in tqdm(scenes.items(), desc="bench", unit="scene", leave=False)
        }
    return tables | {"on a GPU": [{"GPU": _on_a_gpu()}]}


def loop_table(scene: Scene, seconds: float, engine: str = "torch") -> Rows:
    """Rows of one scene: its stages, the whole, and the other denoisers."""
    blocks = _timed(scene, seconds, engine)
    rows = []
    spent = {stage: np.median([block[stage] for block in blocks], axis=0) for stage in (*STAGES, FAST, FIRST_WAY)}
    spent[WHOLE] = np.asarray(sum(spent[stage] for stage in STAGES))
    for stage in (*STAGES, WHOLE, FAST, FIRST_WAY):
        wall, processor = spent[stage] / BLOCK
        rows.append(
            {
                "stage": stage,
                "frames/s": 1 / wall,
                "x real time": 1 / wall / FRAME_RATE_HZ,
                "processor ms/frame": 1e3 * processor,
                "of the whole, %": 100 * processor * BLOCK / spent[WHOLE][1] if stage in (*STAGES, WHOLE) else None,
                "x plain float32": _gain(blocks, stage),
            }
        )
    return rows


def _timed(scene: Scene, seconds: float, engine: str) -> list[Seconds]:
    """Blocks through the loop and through the other denoisers, in turn."""
    height, width = scene.shape
    sensor = SpikeSensor("scsim", (height, width), seed=0)
    recipe, network, _ = load_weights(pretrained_path("best"))
    now = OnlineDnSS(recipe, network, output="rate", engine=engine)
    fast = OnlineDnSS.pretrained("fast", output="rate", engine=engine)
    first = OnlineDnSS(recipe, CalledAsInTraining(network), output="rate", precision="float32")
    blocks: list[Seconds] = []
    begin = time.perf_counter()
    while len(blocks) < WARM + 3 or time.perf_counter() - begin < seconds:
        block: Seconds = {}
        light = _clocked(block, "light", scene.radiance, sensor.frame, sensor.frame + BLOCK)
        spikes = _clocked(block, "camera", sensor.step, light, BLOCK)
        _clocked(block, "denoiser", now.push, spikes)
        _clocked(block, FAST, fast.push, spikes)
        _clocked(block, FIRST_WAY, first.push, spikes)
        blocks.append(block)
    return blocks[WARM:]


def _clocked(block: Seconds, stage: str, work: Callable[..., Any], *arguments: Any) -> Any:
    """Do the work, and note its time in the block; returns the result."""
    wall, processor = time.perf_counter(), time.process_time()
    result = work(*arguments)
    block[stage] = np.array([time.perf_counter() - wall, time.process_time() - processor])
    return result


def _gain(blocks: list[Seconds], stage: str) -> float | None:
    """Processor's time of the plain denoiser over that of a denoiser or of the loop; None for other stages."""
    if stage in ("denoiser", FAST):
        return float(np.median([block[FIRST_WAY][1] / block[stage][1] for block in blocks]))
    if stage == WHOLE:
        other = [sum(block[s][1] for s in ("light", "camera", FIRST_WAY)) for block in blocks]
        return float(np.median([o / sum(block[s][1] for s in STAGES) for o, block in zip(other, blocks, strict=True)]))
    return 1.0 if stage == FIRST_WAY else None


def _on_a_gpu() -> str:
    """The note on GPUs."""
    if not torch.cuda.is_available():
        return "not measured: these rows need a GPU, and this machine has none"
    return "not measured here: `python -m benchmarks.gpu` does it"
