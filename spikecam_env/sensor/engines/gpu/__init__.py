"""The cuda engine: batches of cameras on a GPU, by the fast engine's law and with its bits.

`state` holds B cameras' pixels as (B, P) tensors.  Two kernels advance them: `jump` (Triton, on CUDA devices) goes from
spike to spike, `dense` (plain torch, on any device) from frame to frame.  Charge is 32-bit integers, every draw a hash
of (seed, pixel, spike number) through a float32 polynomial without fused multiply-add: both give the bits of `fast`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from importlib.util import find_spec

import torch

from spikecam_env.errors import InputError
from spikecam_env.sensor.effects import Effect
from spikecam_env.sensor.engines.compiled import fast
from spikecam_env.sensor.engines.gpu import dense
from spikecam_env.sensor.engines.gpu.state import BatchSegment, BatchState, start

__all__ = ["BatchSegment", "BatchState", "checked_device", "kernel_on", "missing", "run", "start"]


def missing(effects: Sequence[Effect]) -> list[str]:
    """Names of effects, or options of them, that this engine does not carry: those that `fast` does not."""
    return fast.missing(effects)


def run(state: BatchState, segment: BatchSegment, out: torch.Tensor | None = None) -> torch.Tensor:
    """Advance `state` over a segment.

    Args:
        out: (B, count, P) uint8 on the state's device, any strides over cameras and frames, pixels adjoining.

    Returns:
        Spikes (B, count, P) uint8, 0 or 1, in `out` where that is given.
    """
    if out is None:
        out = torch.empty((state.cameras, segment.count, state.pixels), dtype=torch.uint8, device=state.device)
    if kernel_on(state.device) == "triton":
        from spikecam_env.sensor.engines.gpu import jump

        with torch.cuda.device(state.device):  # Triton launches on the current device, whatever the tensors'
            jump.advance(state, segment, out)
    else:
        dense.advance(state, segment, out)
    return out


def kernel_on(device: torch.device) -> str:
    """Which kernel runs on a device: "triton" on CUDA where Triton is installed, else "torch"."""
    return "triton" if device.type == "cuda" and _has_triton() else "torch"


ON_PROCESSOR = "use engine='fast', or SpikeSensorBatch(..., device='cpu') for batches on the processor"


def checked_device(device: str | torch.device, instead: str = ON_PROCESSOR) -> torch.device:
    """A device to run on; InputError for a missing CUDA device, with the advice `instead`, and for other kinds."""
    try:
        chosen = torch.device(device)
    except (RuntimeError, TypeError):
        chosen = torch.device("meta")
    if chosen.type not in ("cuda", "cpu"):
        raise InputError(f"device = {str(device)!r}; it must be 'cuda', 'cuda:N' or 'cpu'")
    if chosen.type == "cuda" and (chosen.index or 0) >= torch.cuda.device_count():
        raise InputError(
            f"device = {str(device)!r}, but torch {torch.__version__} sees {torch.cuda.device_count()} CUDA devices; "
            f"{instead}"
        )
    return chosen


@lru_cache(maxsize=1)
def _has_triton() -> bool:
    return find_spec("triton") is not None
