"""The Triton kernel gives the bits of the plain torch one; on the processor through Triton's interpreter.

Triton comes with CUDA builds of torch.  Elsewhere: pip install triton, in an environment of its own.
"""

from __future__ import annotations

import copy
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import torch

from spikecam_env.sensor import SensorModel
from spikecam_env.sensor.engines import gpu
from spikecam_env.sensor.engines.gpu import dense
from spikecam_env.sensor.light import Segment
from spikecam_env.sensor.model import generator

pytestmark = pytest.mark.skipif(find_spec("triton") is None, reason="triton is not installed (CUDA builds of torch)")

DEVICE = torch.device("cuda" if torch.cuda.is_available() else "cpu")
SEEDS = (3, 2**40)


@pytest.fixture
def jump() -> ModuleType:
    """The kernel's module: compiled on a CUDA device, else interpreted; that has to be said before Triton is loaded."""
    if DEVICE.type == "cpu":
        if "triton" in sys.modules and os.environ.get("TRITON_INTERPRET") != "1":
            pytest.skip("triton was loaded before; run this file by itself, or with TRITON_INTERPRET=1")
        os.environ["TRITON_INTERPRET"] = "1"
    import triton

    if DEVICE.type == "cpu" and _version(triton) < (3, 9) and _version(np) >= (2, 4):
        pytest.skip(f"the interpreter of triton {triton.__version__} does not run under numpy {np.__version__}")
    from spikecam_env.sensor.engines.gpu import jump

    return jump


def _version(module: ModuleType) -> tuple[int, ...]:
    return tuple(int(number) for number in module.__version__.split(".")[:2])


def started(pixels: int, preset: str) -> gpu.BatchState:
    model = SensorModel.preset(preset)
    units = [model.draw_unit((1, pixels), seed) for seed in SEEDS]
    return gpu.start(units, [generator(seed, "phase").random(pixels) for seed in SEEDS], SEEDS, DEVICE)


def light(pixels: int, low: float, high: float) -> np.ndarray:
    """(2 keys, 2 cameras, P) radiance, log-uniform between low and high; a few pixels dark, a few fading to nothing."""
    rng = np.random.default_rng(pixels)
    film = np.exp(rng.uniform(np.log(low), np.log(high), (2, 2, pixels))).astype(np.float32)
    film[:, :, :3] = 0.0
    film[1, :, 3:6] = 0.0
    return film


def same(jump: ModuleType, state: gpu.BatchState, segment: gpu.BatchSegment) -> None:
    """Both kernels on copies of `state`: same spikes, same state after."""
    ours, theirs = copy.deepcopy(state), copy.deepcopy(state)
    shape = (state.cameras, segment.count + 2, state.pixels)
    spikes, expected = (torch.full(shape, 7, dtype=torch.uint8, device=DEVICE) for _ in range(2))
    jump.advance(ours, segment, spikes[:, 1:-1])
    dense.advance(theirs, segment, expected[:, 1:-1])
    print(f"{spikes[:, 1:-1].numel()} bits, {int(theirs.fired.sum())} spikes, {int((spikes != expected).sum())} differ")
    assert torch.equal(spikes, expected)
    assert torch.equal(ours.remaining, theirs.remaining) and torch.equal(ours.fired, theirs.fired)


@pytest.mark.parametrize(
    "pixels, low, high, intervals",
    [
        (128, 0.02, 0.3, [(64, 0, 64), (64, 0, 64)]),
        (5, 0.5, 4.0, [(64, 10, 20), (20, 0, 20)]),
        (150, 0.005, 0.1, [(64, 40, 24), (33, 1, 24)]),
        (37, 0.1, 1.0, [(1, 0, 1), (64, 63, 1)]),
    ],
)
def test_the_triton_kernel_gives_the_bits_of_the_torch_one(
    jump: ModuleType, pixels: int, low: float, high: float, intervals: list[tuple[int, int, int]]
) -> None:
    """Each camera in a key interval of its own (length, first, count): ramps, bright and dim, blocks not filled."""
    film = light(pixels, low, high)
    segments = [Segment(film[0, b], film[1, b], *intervals[b]) for b in range(2)]
    same(jump, started(pixels, "scsim"), gpu.BatchSegment.of(segments, DEVICE))


def test_the_triton_kernel_takes_light_that_all_cameras_share(jump: ModuleType) -> None:
    film = light(40, 0.02, 0.5)
    shared = gpu.BatchSegment.of([Segment(film[0, 0], film[1, 0], 64, 0, 20)], DEVICE)
    same(jump, started(40, "physical"), shared)
    held = gpu.BatchSegment.held(torch.from_numpy(film[0]).to(DEVICE), 20)
    same(jump, started(40, "ideal"), held)


COMPILE = """
from triton import compile
from triton.backends.compiler import GPUTarget
from triton.compiler import ASTSource
from spikecam_env.sensor.engines.gpu import jump

floats = dict.fromkeys(("radiance0", "radiance1", "per_twice", "gain", "dark", "spread", "polynomial"), "*fp32")
whole = dict.fromkeys(("timing", "seeds", "remaining", "fired"), "*i32")
kinds = {**floats, **whole, "out": "*u8", "BLOCK": "constexpr"}
names = jump.advance_kernel.arg_names
source = ASTSource(jump.advance_kernel, {n: kinds.get(n, "i32") for n in names}, {(names.index("BLOCK"),): jump.BLOCK})
print(compile(source, target=GPUTarget("cuda", 90, 32), options=jump.OPTIONS).asm["ptx"])
"""


def test_compiled_for_a_gpu_the_kernel_fuses_no_multiply_and_add(tmp_path: Path) -> None:
    """For an H100, which need not be there.  A fused operation would round, and so draw, otherwise."""
    here = {**os.environ, "TRITON_INTERPRET": "0", "TRITON_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", COMPILE], env=here, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    multiplied, fused = (len(re.findall(rf"\b{name}\S*f32", done.stdout)) for name in ("mul", "fma"))
    print(f"{multiplied} products, {fused} of them fused")
    assert multiplied > 0 and fused == 0
