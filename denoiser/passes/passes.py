"""Passes over N streams, wherever the network is."""

from __future__ import annotations

from typing import TypeAlias

from denoiser.passes.engine import Engine
from denoiser.passes.on_device import DevicePasses
from denoiser.passes.on_host import HostPasses

Passes: TypeAlias = HostPasses | DevicePasses


def passes_of(engine: Engine, shape: tuple[int, int], streams: int = 1, first: int = 0) -> Passes:
    """Passes over streams of frames of `shape`, from frame `first` of each on."""
    if engine.device is None:
        return HostPasses(engine, shape, streams, first)
    return DevicePasses(engine, engine.device, shape, streams, first)
