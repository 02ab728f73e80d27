"""How fast the online denoiser is, as ratios to the paper's network at every frame, measured in the same run.

spikecam bench online
"""

from __future__ import annotations

import time
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import numpy as np
import torch
from tqdm import tqdm

from denoiser.online import OnlineDnSS
from denoiser.recipe import recipe_of
from denoiser.stream_network import CHANNELS
from scenes import RotatingDisk
from spikecam_env.sensor import SpikeSensor
from spikecam_env.torch_settings import torch_settings

SHAPES = ((250, 400), (64, 64))
STRIDES = (1, 2, 4, 8)
CHUNK = 16
NARROW = (32, 64, 12)
"""Channels of a network of a quarter of the weights of `best`, whose speed is measured too.  It is not trained: its
speed is the same, and its rates are of no use."""


def bench_online(threads: tuple[int, ...] = (1, 2), seconds: float = 3.0, seed: int = 0) -> list[dict[str, Any]]:
    """Frames a second of `OnlineDnSS` on a noisy stream of the disk, by size, network evaluation stride and threads.

    Of `best` both engines, where OpenVINO is installed, and a network of `NARROW` channels.
    Columns: mode, engine, channels (of `best`), size, stride (frames between network evaluations; `best` gives 16
    frames an evaluation), threads, frames/s, x paper (same size and threads, stride 1), x real time (40 000 frames a
    second), latency [frames].
    """
    engines = ["torch", *(["openvino"] if find_spec("openvino") else [])]
    many = recipe_of("best")
    contestants = [("paper", "torch", stride, CHANNELS) for stride in STRIDES]
    contestants += [("best", engine, many.layout.planes, c) for c in (CHANNELS, NARROW) for engine in engines]
    jobs = [(shape, count, *c) for shape in SHAPES for count in threads for c in contestants]
    rows: list[dict[str, Any]] = []
    base = 0.0
    with torch_settings():
        for shape, count, mode, engine, stride, channels in tqdm(jobs, desc="bench", unit="row", leave=False):
            torch.set_num_threads(count)
            options: dict[str, Any] = {"stride": stride} if mode == "paper" else {"engine": engine}
            online = _denoiser(mode, channels, options)
            rate = _frames_a_second(online, _stream(shape, seed), seconds)
            base = rate if (mode, stride) == ("paper", 1) else base
            rows.append(
                {
                    "mode": mode,
                    "engine": engine,
                    "channels": " ".join(map(str, channels)) if mode == "best" else "",
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


def _denoiser(mode: str, channels: tuple[int, int, int], options: dict[str, Any]) -> OnlineDnSS:
    """With the shipped weights, or of other channels with none."""
    if channels == CHANNELS:
        return OnlineDnSS.pretrained(mode, output="both", **options)
    recipe = replace(recipe_of(mode), channels=channels)
    return OnlineDnSS(recipe, recipe.network().eval(), output="both", **options)


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
