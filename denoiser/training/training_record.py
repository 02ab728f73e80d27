"""The record of a training in its file of weights: the command, its options, how far it came."""

from __future__ import annotations

from dataclasses import asdict, fields
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from denoiser.training.training_options import TrainingOptions

NOT_RECORDED = ("out", "resume", "save_every_s")
"""Options that change nothing in the weights."""


def training_record(config: TrainingOptions, steps: int, seconds: float, resumed_at: list[int]) -> dict[str, Any]:
    """Plain values, for a checkpoint."""
    try:
        package = version("spikecam-env")
    except PackageNotFoundError:
        package = "not installed"
    return {
        "command": command(config),
        "options": {name: value for name, value in asdict(config).items() if name not in NOT_RECORDED},
        "steps": steps,
        "minutes": round(seconds / 60, 1),
        "resumed_at": resumed_at,
        "package": package,
    }


def command(config: TrainingOptions) -> str:
    """The command line that trains so; OUT stands for the folder."""
    given = {f.name: getattr(config, f.name) for f in fields(config) if getattr(config, f.name) != f.default}
    options = (_option(name, value) for name, value in given.items() if name not in ("mode", *NOT_RECORDED))
    return " ".join(["spikecam train", f"--mode {config.mode}", "--out OUT", *options])


def _option(name: str, value: Any) -> str:
    option = name.replace("_", "-")
    if isinstance(value, bool):
        return f"--{option}" if value else f"--no-{option}"
    return " ".join([f"--{option}", *map(str, value if isinstance(value, tuple) else (value,))])
