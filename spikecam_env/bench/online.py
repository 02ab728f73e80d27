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
from denoiser.passes.pixel_history import TYPICAL_STEP
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
        Rows of mode, engine, size and threads.  stride is frames between network evaluations: `best` and `fast` give 16
        frames an evaluation, `picture` one picture.  Then frames/s, x paper (same size and threads, stride 1), x real
        time (40 000 frames a second), processor time of an evaluation [ms], the same over that of `fast`, latency
        [frames].
    """
    contestants = [("paper", stride) for stride in STRIDES]
    contestants += [(mode, recipe_of(mode).layout.planes) for mode in ("fast", "best")] + [("picture", TYPICAL_STEP)]
    jobs = [(shape, count, *c) for shape in SHAPES for count in threads for c in contestants]
    rows: list[dict[str, Any]] = []
    base = fast_s = 0.0
    with torch_settings():
        for shape, count, mode, stride in tqdm(jobs, desc="bench", unit="row", leave=False):
            torch.set_num_threads(count)
            options: dict[str, Any] = {"paper": {"stride": stride}, "picture": {"output": "rate"}}.get(mode, {})
            online = OnlineDnSS.pretrained(mode, **{"output": "both", **options})
            rate, pass_s = _speed(online, _stream(shape, seed), stride, seconds)
            base = rate if (mode, stride) == ("paper", 1) else base
            fast_s = pass_s if mode == "fast" else fast_s
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
                    "a pass, ms": 1e3 * pass_s,
                    "over fast": pass_s / fast_s if fast_s else None,
                    "latency, frames": online.latency,
                }
            )
    return rows


def _stream(shape: tuple[int, int], seed: int) -> np.ndarray:
    frames = 8 * CHUNK
    return SpikeSensor("scsim", shape, seed).step(RotatingDisk(shape).radiance(0, frames), frames)


def _speed(online: OnlineDnSS, spikes: np.ndarray, stride: int, seconds: float) -> tuple[float, float]:
    """Frames in a second, and processor time of a pass [s], once the pipeline is full."""
    pieces = [spikes[start : start + CHUNK] for start in range(0, len(spikes), CHUNK)]
    for piece in pieces[:6]:
        online.push(piece)
    begin, used, frames = time.perf_counter(), time.process_time(), 0
    while (elapsed := time.perf_counter() - begin) < seconds or frames < 2 * stride:
        online.push(pieces[frames // CHUNK % len(pieces)])
        frames += CHUNK
    return frames / elapsed, (time.process_time() - used) * stride / frames
