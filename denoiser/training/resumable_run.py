"""A run of training that can go on where it was stopped: network, optimiser, and progress.

`last.pt` holds them as plain values; reading it checks every name, shape, type and number before anything is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import torch
from pydantic import Field
from torch import Tensor, nn

from denoiser.ground.plain_torch import read_plain, tensors_like
from denoiser.weights import write_whole
from spikecam_env.errors import InputError
from spikecam_env.untrusted import Declared, Name, Whole, declared

FIRST_NORM = 0.25
"""Of the first gradient, where it is longer; later ones are measured by those before."""


@dataclass
class Run:
    """A run mid-way."""

    network: nn.Module
    """Its weights that are not frozen learn; several that learn together are one `nn.ModuleDict`."""
    optimiser: torch.optim.Optimizer
    step: int
    seconds: float
    """Spent so far."""
    curve: list[dict[str, float]]
    """The validations."""
    resumed_at: list[int]
    """Steps at which the run was resumed."""

    @classmethod
    def begin(cls, network: nn.Module) -> Run:
        """Before the first step, on the device where the network is."""
        weights = [weight for weight in network.parameters() if weight.requires_grad]
        on_gpu = weights[0].is_cuda
        rate = torch.tensor(1e-3, device=weights[0].device) if on_gpu else 1e-3  # a replayed step reads tensors alone
        return cls(network, torch.optim.Adam(weights, rate, capturable=on_gpu), 0, 0.0, [], [])

    def set_rate(self, rate: float) -> None:
        """The rate of learning from now on."""
        for group in self.optimiser.param_groups:
            if isinstance(group["lr"], Tensor):
                group["lr"].fill_(rate)
            else:
                group["lr"] = rate

    def shorten_gradients(self, most: float) -> None:
        """Shorten the gradient where its norm is more than `most` times its usual one.

        The usual norm is the root of Adam's second moments: the rms of the norm over the last thousand steps.  Before
        the first step it is FIRST_NORM.
        """
        gradients = [weight.grad for weight in self.network.parameters() if weight.grad is not None]
        norm = torch.stack(torch._foreach_norm(gradients)).norm()
        moments = list(self.optimiser.state.values())
        usual = torch.full_like(norm, FIRST_NORM)
        if moments:
            squares = torch.stack([moment["exp_avg_sq"].sum() for moment in moments]).sum()
            beta = self.optimiser.param_groups[0]["betas"][1]
            usual = (squares / (1 - beta ** moments[0]["step"])).sqrt().to(norm.device)
        factor = (most * usual / (norm + 1e-12)).clamp(max=1.0)
        torch._foreach_mul_(gradients, factor)

    def save(self, path: Path) -> None:
        """Write all of it; the file appears whole."""
        progress = {name: getattr(self, name) for name in ("step", "seconds", "curve", "resumed_at")}
        parts = {
            "network": self.network.state_dict(),
            "optimiser": {"moments": self._moments(), "settings": self._settings()},
        }
        write_whole(path, parts | progress)

    def load(self, path: Path) -> None:
        """Go on from a file of `save`; InputError where it is damaged, or of another network."""
        data = read_plain(path)
        try:
            if not isinstance(data, dict) or not {"network", "optimiser"} <= set(data):
                raise InputError(f"{path} holds no network")
            weights, moments = data.pop("network"), data.pop("optimiser")
            progress = declared(_Progress, data, str(path))
            tensors_like(self.network.state_dict(), weights, str(path))
            self._refuse_others(moments, str(path))
        except InputError as error:
            raise InputError(f"{error}; it is not a run of this mode: give another --out, or resume=False") from error
        self.network.load_state_dict(weights)
        groups = self.optimiser.state_dict()["param_groups"]
        self.optimiser.load_state_dict({"state": moments["moments"], "param_groups": groups})
        self.step, self.seconds, self.curve = progress.step, progress.seconds, [dict(p) for p in progress.curve]
        self.resumed_at = [*progress.resumed_at, self.step]

    def _moments(self) -> dict[int, dict[str, Tensor]]:
        """Of each parameter by number."""
        moments: dict[int, dict[str, Tensor]] = self.optimiser.state_dict()["state"]
        return moments

    def _settings(self) -> list[dict[str, Any]]:
        """Of the optimiser, but for those that depend on the device or change from step to step."""
        groups = self.optimiser.state_dict()["param_groups"]
        return [{name: v for name, v in group.items() if name not in ("lr", "capturable")} for group in groups]

    def _refuse_others(self, found: Any, where: str) -> None:
        """InputError unless these are moments of an Adam of the same parameters and settings."""
        if not isinstance(found, dict) or found.get("settings") != self._settings():
            raise InputError(f"{where}: the optimiser has other settings or parameters")
        weights = [p.detach().cpu() for p in self.network.parameters() if p.requires_grad]
        moments = found.get("moments")
        if not isinstance(moments, dict) or set(moments) not in (set(), set(range(len(weights)))):
            raise InputError(f"{where}: the optimiser has no moments of these parameters")
        for number, moment in moments.items():
            like = weights[number]
            expected = {"step": torch.zeros(()), "exp_avg": like, "exp_avg_sq": like}
            tensors_like(expected, moment, f"{where}: optimiser")


class _Progress(Declared):
    step: Whole
    seconds: Annotated[float, Field(ge=0)]
    curve: list[dict[Name, float]]
    resumed_at: list[Whole]
