"""Checks that the options of every training share."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from denoiser.captured import checked_compiler
from spikecam_env.checked import checked_number, checked_whole
from spikecam_env.errors import InputError
from spikecam_env.sensor.kernels.cuda import checked_device

_AMOUNTS = {"lr": 1.0, "minutes": 1e6, "save_every_s": 1e9}
"""Options that are numbers above 0, with the most."""


def check_options(config: Any, counts: Mapping[str, tuple[int, int]]) -> None:
    """Check a frozen dataclass of options and make its folder `out` a path; InputError for a value out of range.

    Args:
        config: `TrainConfig` or `ReconstructorConfig`.
        counts: options that are whole numbers, with the least and the most.
    """
    for name, (least, most) in counts.items():
        object.__setattr__(config, name, checked_whole(getattr(config, name), name, least, most))
    for name, most in _AMOUNTS.items():
        if name != "minutes" or config.minutes is not None:
            checked_number(getattr(config, name), name, 0.0, most, above=True)
    for name in ("resume", "refine", "compiled"):
        if not isinstance(getattr(config, name, True), bool):
            raise InputError(f"{name} is {getattr(config, name)!r}; it must be True or False")
    if not isinstance(config.out, str | os.PathLike):
        raise InputError(f"out is {config.out!r}; it must be the path of a folder")
    object.__setattr__(config, "out", Path(config.out))
    checked_device(config.device, "train with --device cpu")
    if config.compiled:
        checked_compiler(config.device)
