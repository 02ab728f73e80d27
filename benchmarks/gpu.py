"""Every figure that today's code can give of a GPU, in one run of at most eight minutes.

python -m benchmarks.gpu --out gpu.json    # on a machine with a GPU
python -m benchmarks.gpu --cpu             # a dry run on the processor, small: that it works, and no figure of a GPU

Parts, in this order: the camera (`benchmarks.bench_cuda`: batches, and one frame a call), the denoiser's network with
its input on the device, passes whose windows lie with the host, training pairs, training steps of `best`.  A part that
would begin too late is left out, and said to be.
Scenes, windows and `OnlineDnSS` itself do not run on a GPU yet.
"""

from __future__ import annotations

import time
from argparse import ArgumentParser
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from benchmarks import bench_cuda
from denoiser import infer
from denoiser.rollout import Rollouts
from denoiser.simulated import Bank
from denoiser.stream_network import CARRY, StreamDnSS
from denoiser.weights import load_weights, pretrained_path
from denoiser.window import RollingWindow
from spikecam_env.bench.machine import FRAME_RATE_HZ, SHAPE, machine
from spikecam_env.cli.files import write_json
from spikecam_env.cli.table import table
from spikecam_env.whole import check_file

MINUTES = 8.0
"""Of the whole run, set-up included."""

TO_SPARE_S = 60.0
"""Time that a part may take: none begins later than this before the end."""

SECONDS = 2.0
"""Of each measurement."""

Rows = list[dict[str, Any]]


@dataclass(frozen=True)
class Sizes:
    """shape: of the denoiser's frames.  streams: of a pass.  cameras, intervals: of the camera.  patches: of a training
    step, of `side` pixels.  textures, units: of the bank that training streams are drawn from."""

    shape: tuple[int, int]
    streams: tuple[int, ...]
    cameras: tuple[int, ...]
    intervals: tuple[float, ...]
    patches: int
    side: int
    textures: int
    units: int


FULL = Sizes(SHAPE, (1, 4, 16), (1, 16, 64), (20.0,), 64, 64, 384, 96)
DRY = Sizes((20, 24), (1, 2), (1,), (20.0,), 2, 16, 4, 3)


def camera(sizes: Sizes, device: torch.device) -> Rows:
    """As `benchmarks.bench_cuda`."""
    return [row for i in sizes.intervals for cameras in sizes.cameras for row in bench_cuda.rows(i, cameras, device)]


def network(sizes: Sizes, device: torch.device) -> Rows:
    """Passes of `best` in bfloat16 whose input lies on the device."""
    recipe, its = _best(device)
    layout, (height, width) = recipe.layout, sizes.shape
    rows = []
    for streams in sizes.streams:
        channels = layout.span + layout.layers + 1
        seen = _channels_last(torch.rand(streams, channels, height, width, device=device))
        hidden = _channels_last(torch.rand(streams, CARRY, height // 2, width // 2, device=device))
        beside = seen[:, layout.span :]

        def once(seen: Any = seen, beside: Any = beside, hidden: Any = hidden) -> None:
            with torch.inference_mode(), torch.autocast(device.type, torch.bfloat16):
                its.passed(seen, beside, hidden, None)

        rows.append({"streams": streams} | _frames(_seconds(once, device), streams * layout.planes))
    return rows


def passes(sizes: Sizes, device: torch.device) -> Rows:
    """The same from windows of the host: their planes are made, moved, passed, and the rates moved back."""
    recipe, its = _best(device)
    rng = np.random.default_rng(0)
    rows = []
    for streams in sizes.streams:
        rolling = [RollingWindow(recipe.layout, sizes.shape) for _ in range(streams)]
        new = (rng.random((recipe.layout.planes, *sizes.shape)) < 0.1).astype(np.uint8)
        for window in rolling:
            list(window.push(np.concatenate([new] * 3)))

        def once(rolling: Any = rolling, new: Any = new, streams: int = streams) -> None:
            windows = [next(window.push(new)) for window in rolling]
            infer.rates_of_many(its, windows, torch.bfloat16, [()] * streams)

        rows.append({"streams": streams} | _frames(_seconds(once, device), streams * recipe.layout.planes))
    return rows


def training(sizes: Sizes, device: torch.device) -> Rows:
    """Training pairs (scene, camera, twin), and steps of `best` of three passes, forward and backward."""
    recipe, its = _best(device)
    its = its.float().requires_grad_(True).train()
    bank = Bank.drawn(0, device, textures=sizes.textures, units=sizes.units)
    rollouts = Rollouts(recipe.layout, taken=sizes.patches, patch=sizes.side, device=device, seed=0, pool=2, bank=bank)
    rows = torch.arange(sizes.patches, device=device)
    pairs = _seconds(lambda: rollouts.streams.advance(recipe.layout.planes, rows), device)
    step = _seconds(lambda: rollouts.loss(its, 3).backward(), device)
    frames = sizes.patches * recipe.layout.planes
    size = {"patches": sizes.patches, "side": sizes.side}
    return [
        {"what": "pairs", **size, "a second": 1 / pairs, "frames/s": frames / pairs},
        {"what": "steps of three passes", **size, "a second": 1 / step, "frames/s": 3 * frames / step},
    ]


PARTS: dict[str, Callable[[Sizes, torch.device], Rows]] = {
    "camera": camera,
    "denoiser: network alone": network,
    "denoiser: windows of the host": passes,
    "training": training,
}


def measured(sizes: Sizes, device: torch.device, minutes: float = MINUTES) -> dict[str, Rows]:
    """Tables by title; of a part that had no time left, one row that says so."""
    begin, tables = time.perf_counter(), {}
    for title, part in PARTS.items():
        late = time.perf_counter() - begin > 60 * minutes - TO_SPARE_S
        if device.type == "cuda":
            torch.cuda.reset_peak_memory_stats(device)
        tables[title] = [{"left out": f"{minutes:g} minutes were nearly over"}] if late else part(sizes, device)
        if device.type == "cuda" and not late:
            peak = torch.cuda.max_memory_allocated(device) / 2**30
            tables[title] = [row | {"most memory of the part, GiB": peak} for row in tables[title]]
    return tables


def _best(device: torch.device) -> tuple[Any, StreamDnSS]:
    recipe, its, _ = load_weights(pretrained_path("best"))
    ready = infer.prepared(its, torch.bfloat16).to(device)
    assert isinstance(ready, StreamDnSS)
    return recipe, ready


def _channels_last(tensor: torch.Tensor) -> torch.Tensor:
    return tensor.to(torch.bfloat16).contiguous(memory_format=torch.channels_last)


def _frames(seconds: float, frames: int) -> dict[str, float]:
    """ms a pass, frames/s of all streams together, and of one over the camera's."""
    return {"ms a pass": 1e3 * seconds, "frames/s": frames / seconds, "x real time": frames / seconds / FRAME_RATE_HZ}


def _seconds(run: Callable[[], object], device: torch.device) -> float:
    """Of one run: the median over SECONDS, after two that compile."""
    spent: list[float] = []
    until = np.inf
    while len(spent) < 5 or time.perf_counter() < until:
        begin = time.perf_counter()
        run()
        if device.type == "cuda":
            torch.cuda.synchronize(device)
        spent.append(time.perf_counter() - begin)
        if len(spent) == 2:
            until = time.perf_counter() + SECONDS
    return float(np.median(spent[2:]))


def main() -> None:
    """Measure and print."""
    parser = ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, help="where to write the figures as JSON")
    parser.add_argument("--cpu", action="store_true", help="a dry run on the processor, small")
    chosen = parser.parse_args()
    if chosen.out is not None:
        check_file(chosen.out)
    if not chosen.cpu and not torch.cuda.is_available():
        raise SystemExit("no GPU here; --cpu makes a dry run")
    device, sizes = (torch.device("cpu"), DRY) if chosen.cpu else (torch.device("cuda"), FULL)
    name = "none: a dry run on the processor" if chosen.cpu else torch.cuda.get_device_name()
    print(f"{machine()}\nGPU: {name}, torch {torch.__version__}")
    tables = measured(sizes, device)
    for title, rows in tables.items():
        print(f"\n{title}\n{table(rows)}")
    if chosen.out is not None:
        write_json(chosen.out, {"machine": machine(), "GPU": name, "tables": tables})


if __name__ == "__main__":
    main()
