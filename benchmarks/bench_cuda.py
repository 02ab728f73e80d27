"""Batches of cameras on a GPU against the fast engine on this machine's processor, measured in the same run.

python -m benchmarks.bench_cuda            # the GPU; without one it says so and times the torch fallback, small

Columns: scene, engine or kernel, cameras, frames (in one call), Gpx-steps/s, x fast (one camera, NUMBA_NUM_THREADS
threads), x real time (Vidar).  Light lies on the device already; spikes stay there, one byte a pixel.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from spikecam_env.bench.machine import SHAPE, machine
from spikecam_env.bench.sensor import BLOCK, REAL_TIME
from spikecam_env.cli.table import table
from spikecam_env.sensor import SpikeSensorBatch
from spikecam_env.sensor.engines import gpu
from spikecam_env.sensor.engines.compiled import fast
from spikecam_env.sensor.light import Segment
from spikecam_env.sensor.model import SensorModel, generator

INTERVALS = (5.0, 20.0, 100.0)
SECONDS = 1.0


def rows(interval: float, cameras: int, device: torch.device, shape: tuple[int, int] = SHAPE) -> list[dict[str, Any]]:
    """The fast engine, the batch on `device` with each kernel that runs there, and the batch a frame at a time.

    Light rises by a tenth over 64 frames, from cameras x pixels levels within 10 % of one spike in `interval` frames.
    """
    rng = np.random.default_rng(0)
    pixels = shape[0] * shape[1]
    start = rng.uniform(0.9, 1.1, (cameras, pixels)).astype(np.float32) / np.float32(interval)
    stop = start * np.float32(1.1)
    model = SensorModel.preset("scsim")
    one = fast.start(model.draw_unit(shape, 0), generator(0, "phase").random(pixels), 0)
    out = np.empty((BLOCK, pixels), dtype=np.uint8)
    segment = Segment(start[0], stop[0], BLOCK, 0, BLOCK)
    base = _rate(lambda: fast.run(one, segment, out), pixels * BLOCK)

    units = [model.draw_unit(shape, seed) for seed in range(cameras)]
    phases = [generator(seed, "phase").random(pixels) for seed in range(cameras)]
    state = gpu.start(units, phases, range(cameras), device)
    light = [Segment(start[b], stop[b], BLOCK, 0, BLOCK) for b in range(cameras)]
    batch = gpu.BatchSegment.of(light, device)
    spikes = torch.empty((cameras, BLOCK, pixels), dtype=torch.uint8, device=device)

    measured = [("fast", 1, BLOCK, base)]
    for kernel in dict.fromkeys((gpu.kernel_on(device), "torch")):
        run = _kernel(kernel)
        rate = _rate(lambda run=run: run(state, batch, spikes), spikes.numel(), device)  # type: ignore[misc]
        measured.append((kernel, cameras, BLOCK, rate))
    sensors = SpikeSensorBatch(model, shape, range(cameras), device)
    picture = torch.from_numpy(start).reshape(cameras, *shape).to(device)
    measured.append(
        (f"{sensors.kernel}, step()", cameras, 1, _rate(lambda: sensors.step(picture), picture.numel(), device))
    )
    return [
        {
            "scene": f"interval {interval:g}",
            "engine": name,
            "cameras": number,
            "frames": frames,
            "Gpx-steps/s": rate / 1e9,
            "x fast": rate / base,
            "x real time": rate / REAL_TIME,
        }
        for name, number, frames, rate in measured
    ]


def _kernel(name: str) -> Callable[[gpu.BatchState, gpu.BatchSegment, torch.Tensor], None]:
    if name == "triton":
        from spikecam_env.sensor.engines.gpu import jump

        return jump.advance
    from spikecam_env.sensor.engines.gpu import dense

    return dense.advance


def _rate(run: Callable[[], object], steps: int, device: torch.device | None = None) -> float:
    """Pixel-steps a second of the best repeat in SECONDS, after two that compile and warm up."""
    best, begun = np.inf, time.perf_counter()
    for repeat in range(1_000_000):
        begin = time.perf_counter()
        run()
        if device is not None and device.type == "cuda":
            torch.cuda.synchronize(device)
        end = time.perf_counter()
        if repeat < 2:
            begun = end
            continue
        best = min(best, end - begin)
        if end - begun > SECONDS:
            break
    return steps / best


if __name__ == "__main__":
    print(machine())
    if torch.cuda.is_available():
        device = torch.device("cuda")
        print(f"GPU: {torch.cuda.get_device_name()}, torch {torch.__version__}")
        found = [row for interval in INTERVALS for cameras in (1, 16, 64) for row in rows(interval, cameras, device)]
    else:
        print("No CUDA device here: this says nothing of a GPU.  Below, the torch fallback on the processor, small.")
        found = [row for cameras in (1, 2) for row in rows(20.0, cameras, torch.device("cpu"))]
    print(table(found))
