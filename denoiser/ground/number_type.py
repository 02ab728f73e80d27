"""The numbers that networks compute in: bfloat16 where the processor, or the GPU, multiplies in it, else float32.

A processor without it imitates it, several times slower than float32.
"""

from __future__ import annotations

import torch

PRECISIONS = ("auto", "bfloat16", "float32")


def number_type(precision: str, device: torch.device | None = None) -> torch.dtype:
    """The type of a precision of PRECISIONS; "auto" is the one in which the device, by default the processor,
    multiplies."""
    if precision == "auto" and device is not None and device.type == "cuda":
        return torch.bfloat16 if torch.cuda.is_bf16_supported() else torch.float32
    if precision == "auto":
        fast = getattr(torch.cpu, "_is_avx512_bf16_supported", lambda: False)()
        return torch.bfloat16 if fast else torch.float32
    return torch.bfloat16 if precision == "bfloat16" else torch.float32


def computing_in(kind: torch.dtype, device: torch.device) -> torch.autocast:
    """A context in which networks on a device multiply in numbers of a type."""
    return torch.autocast(device.type, kind, enabled=kind != torch.float32)
