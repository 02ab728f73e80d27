"""Options that every training has, and their checks."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from denoiser.ground.captured import checked_compiler
from spikecam_env.errors import InputError
from spikecam_env.numbers import Range, WholeRange
from spikecam_env.sensor.kernels.cuda import checked_device

VALIDATION_SEED = 1_000_003
"""Added to the seed of a run: other scenes, other units, other textures of the same kinds."""


@dataclass(frozen=True)
class TrainingOptions:
    """Options of a training; the run ends after `steps`, or `minutes` where that is given."""

    mode: str
    """Name of the network."""
    out: Path = Path("training")
    """Folder."""
    steps: int = 20_000
    batch: int = 16
    """Streams a step."""
    seed: int = 0
    threads: int = 1
    """Of the processor."""
    resume: bool = True
    """Go on from out/last.pt."""
    minutes: float | None = None
    patch: int = 64
    """Side of the streams [pixels]."""
    lr: float = 1e-3
    """Highest rate of learning."""
    save_every_s: float = 60.0
    validate_every: int = 1000
    """Steps between validations."""
    device: str = "cpu"
    """Of streams and network; a GPU wants larger batches."""
    compiled: bool = False
    """The simulated light by `torch.compile`, on a processor too; a GPU always does."""

    ranges: ClassVar[dict[str, Range]] = {
        "steps": WholeRange(1, 10**9),
        "batch": WholeRange(1, 65_536),
        "seed": WholeRange(0, 2**62),
        "threads": WholeRange(1, 1024),
        "validate_every": WholeRange(1, 10**9),
        "lr": Range(0, 1, above=True),
        "minutes": Range(0, 1e6, above=True),
        "save_every_s": Range(0, 1e9, above=True),
    }
    """Ranges of the options that are numbers; the seed of a validation is above the seed."""
    flags: ClassVar[tuple[str, ...]] = ("resume", "compiled")

    def __post_init__(self) -> None:
        for name, allowed in self.ranges.items():
            if name != "minutes" or self.minutes is not None:
                number = allowed.check(getattr(self, name), name)
                if isinstance(allowed, WholeRange):
                    object.__setattr__(self, name, number)
        for name in self.flags:
            if not isinstance(getattr(self, name), bool):
                raise InputError(f"{name} is {getattr(self, name)!r}; it must be True or False")
        if not isinstance(self.out, str | os.PathLike):
            raise InputError(f"out is {self.out!r}; it must be the path of a folder")
        object.__setattr__(self, "out", Path(self.out))
        checked_device(self.device, "train with --device cpu")
        if self.compiled:
            checked_compiler(self.device)
