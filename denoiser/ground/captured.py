"""Work that a GPU replays: a step or a pass has many small kernels, and their launches take longer than they do."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable

import torch
from torch import Tensor

from spikecam_env.errors import InputError

WARM_UPS = 3
"""Calls before the capture, in which kernels are chosen and memory is taken.  They are steps like any other."""


def captured(
    step: Callable[[], Tensor], device: torch.device, generator: torch.Generator | None = None
) -> Callable[[], Tensor]:
    """The step; on a GPU recorded once, after WARM_UPS calls of it, and replayed from then on.

    Args:
        step: the same work at every call, on tensors that stay where they are; its result is copied out.
        device: where the step works.
        generator: the source of the step's draws, if it draws.
    """
    if device.type != "cuda":
        return step
    beside = torch.cuda.Stream()
    beside.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(beside):
        for _ in range(WARM_UPS):
            step()
    torch.cuda.current_stream().wait_stream(beside)
    graph = torch.cuda.CUDAGraph()
    if generator is not None:
        graph.register_generator_state(generator)
    with torch.cuda.graph(graph):
        found = step()

    def replay() -> Tensor:
        graph.replay()
        return found.clone()

    return replay


def checked_compiler(device: str) -> None:
    """Raise InputError where `torch.compile` finds no C++ compiler for a processor."""
    compilers = (os.environ.get("CXX", ""), "g++", "clang++", "c++")
    if torch.device(device).type == "cpu" and not any(map(shutil.which, compilers)):
        raise InputError("compiled needs a C++ compiler on a processor; install g++, or leave it out")
