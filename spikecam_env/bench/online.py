"""How fast the online denoiser is, as ratios to the paper's network at every frame, measured in the same run.

spikecam bench online
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import torch
from tqdm import tqdm

from denoiser.online import OnlineDnSS
from denoiser.passes.recipe import recipe_of
from scenes import RotatingDisk
from spikecam_env.sensor import SpikeSensor
from spikecam_env.torch_settings import torch_settings

SHAPES = ((250, 400), (64, 64))
STRIDES = (1, 2, 4, 8)
CHUNK = 16


def bench_online(threads: tuple[int, ...] = (1, 2), seconds: float = 3.0, seed: int = 0) -> list[dict[str, Any]]:
    """Frames a second of `OnlineDnSS` on a noisy stream of the disk, by size, network evaluation stride and threads.

    Args:
        threads: numbers of threads.
        seconds: time for each row.
        seed: seed of the camera.

    Returns:
        Rows of mode, engine, size and threads.  stride is frames between network
        evaluations; `best` and `fast` give 16 frames an evaluation.  Then frames/s, x paper (same size and threads,
        stride 1), x real time (40 000 frames a second), latency [frames].
    """
    contestants = [("paper", stride) for stride in STRIDES]
    contestants += [(mode, recipe_of(mode).layout.planes) for mode in ("best", "fast")]
    jobs = [(shape, count, *c) for shape in SHAPES for count in threads for c in contestants]
    rows: list[dict[str, Any]] = []
    base = 0.0
    with torch_settings():
        for shape, count, mode, stride in tqdm(jobs, desc="bench", unit="row", leave=False):
            torch.set_num_threads(count)
            options: dict[str, Any] = {"stride": stride} if mode == "paper" else {}
            online = OnlineDnSS.pretrained(mode, output="both", **options)
            rate = _frames_a_second(online, _stream(shape, seed), seconds)
            base = rate if (mode, stride) == ("paper", 1) else base
            rows.append(
                {
                    "mode": mode,
                    "engine": "torch",
                    "size": f"{shape[0]} x {shape[1]}",
                    "stride": stride,
                    "threads": count,
                    "frames/s": rate,
                    "x paper": rate / base,
                    "x real time": rate / 40_000,
                    "latency, frames": online.latency,
                }
            )
    return rows


def _stream(shape: tuple[int, int], seed: int) -> np.ndarray:
    frames = 8 * CHUNK
    return SpikeSensor("scsim", shape, seed).step(RotatingDisk(shape).radiance(0, frames), frames)


def _frames_a_second(online: OnlineDnSS, spikes: np.ndarray, seconds: float) -> float:
    """Frames out a second, once the pipeline is full."""
    for start in range(0, 4 * CHUNK, CHUNK):
        online.push(spikes[start : start + CHUNK])
    begin, ready, at = time.perf_counter(), 0, 0
    while (elapsed := time.perf_counter() - begin) < seconds or ready == 0:
        fired, _ = online.push(spikes[at : at + CHUNK])
        ready += len(fired)
        at = (at + CHUNK) % len(spikes)
    return ready / elapsed
