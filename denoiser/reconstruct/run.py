"""A run of training that can go on where it was stopped: networks, optimiser, and how far it is.

`last.pt` holds them as plain values; reading it checks every name, shape, type and number before anything is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import torch
from pydantic import Field
from torch import nn

from denoiser.plain_torch import read_plain, tensors_like
from denoiser.weights import write_whole
from spikecam_env.errors import InputError
from spikecam_env.untrusted import Declared, Name, Whole, declared


@dataclass
class Run:
    """networks: by name, all of them learned together.  seconds: spent so far.  curve: the validations."""

    networks: nn.ModuleDict
    optimiser: torch.optim.Optimizer
    step: int
    seconds: float
    curve: list[dict[str, float]]
    resumed_at: list[int]

    @classmethod
    def begin(cls, networks: nn.ModuleDict) -> Run:
        return cls(networks, torch.optim.Adam(networks.parameters()), 0, 0.0, [], [])

    def save(self, path: Path) -> None:
        """Write all of it; the file appears whole."""
        progress = {name: getattr(self, name) for name in ("step", "seconds", "curve", "resumed_at")}
        parts = {"networks": self.networks.state_dict(), "optimiser": self.optimiser.state_dict()}
        write_whole(path, parts | progress)

    def load(self, path: Path) -> None:
        """Go on from a file of `save`.  Raises InputError where it is damaged, or of other networks."""
        data = read_plain(path)
        try:
            if not isinstance(data, dict) or not {"networks", "optimiser"} <= set(data):
                raise InputError(f"{path} holds no networks")
            weights, moments = data.pop("networks"), data.pop("optimiser")
            progress = declared(_Progress, data, str(path))
            tensors_like(self.networks.state_dict(), weights, str(path))
            _refuse_other_moments(moments, self.optimiser, str(path))
        except InputError as error:
            raise InputError(f"{error}; it is not a run of this mode: give another --out, or resume=False") from error
        self.networks.load_state_dict(weights)
        self.optimiser.load_state_dict(moments)
        self.step, self.seconds, self.curve = progress.step, progress.seconds, [dict(p) for p in progress.curve]
        self.resumed_at = [*progress.resumed_at, self.step]


class _Progress(Declared):
    step: Whole
    seconds: Annotated[float, Field(ge=0)]
    curve: list[dict[Name, float]]
    resumed_at: list[Whole]


def _refuse_other_moments(found: Any, optimiser: torch.optim.Optimizer, where: str) -> None:
    """Raises InputError unless `found` is the state of an Adam of the same parameters; its rate is set anew anyway."""
    groups = found.get("param_groups") if isinstance(found, dict) else None
    if not isinstance(groups, list) or not all(isinstance(group, dict) for group in groups):
        raise InputError(f"{where}: the optimiser's groups are missing")
    if _settings(groups) != _settings(optimiser.state_dict()["param_groups"]):
        raise InputError(f"{where}: the optimiser has other settings or parameters")
    if any(not isinstance(group.get("lr"), float) or not 0 <= group["lr"] <= 1 for group in groups):
        raise InputError(f"{where}: the optimiser's rate of learning is out of range")
    weights = [p.detach() for group in optimiser.param_groups for p in group["params"]]
    moments = found.get("state")
    if not isinstance(moments, dict) or set(moments) not in (set(), set(range(len(weights)))):
        raise InputError(f"{where}: the optimiser has no moments of these parameters")
    for number, moment in moments.items():
        like = weights[number]
        tensors_like({"step": torch.zeros(()), "exp_avg": like, "exp_avg_sq": like}, moment, f"{where}: optimiser")


def _settings(groups: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{name: value for name, value in group.items() if name != "lr"} for group in groups]
