"""The modes: which network sees which window, what it learns, and how its rates become spikes again."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from torch import nn

from denoiser.block_network import BlockDnSS
from denoiser.network import DnSS
from denoiser.window import WindowLayout
from spikecam_env.errors import InputError, unknown_name

TARGETS = ("clean_inverse_interval", "light")
DECODERS = ("mus", "accumulate")


@dataclass(frozen=True)
class Recipe:
    """target: what the network is taught.  decoder: `denoiser.mus` or `denoiser.accumulate`."""

    layout: WindowLayout
    target: str
    decoder: str
    refine: bool = True

    def network(self) -> nn.Module:
        """The untrained network: (N, span, H, W) spikes, (N, layers, H, W) planes -> (N, planes, H, W) rates."""
        if self.layout.planes == 1:
            return DnSS(window=self.layout.span, refine=self.refine)
        return BlockDnSS(span=self.layout.span, layers=self.layout.layers, planes=self.layout.planes)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for a checkpoint."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Recipe:
        """The inverse of `to_dict`; raises InputError for anything else."""
        try:
            layout = dict(data["layout"])
            layout["half_widths"] = tuple(int(h) for h in layout["half_widths"])
            layout["memories"] = tuple(float(m) for m in layout["memories"])
            recipe = cls(WindowLayout(**layout), data["target"], data["decoder"], bool(data["refine"]))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"not a denoiser recipe ({error}); train again with `spikecam train`") from error
        if recipe.decoder not in DECODERS or recipe.target not in TARGETS:
            raise InputError(f"recipe names decoder {recipe.decoder!r} and target {recipe.target!r}; not known here")
        return recipe


RECIPES = {
    "paper": Recipe(WindowLayout(past=20, planes=1, future=20), "clean_inverse_interval", "mus"),
    "best": Recipe(
        WindowLayout(past=20, planes=8, future=20, half_widths=(4, 12, 24), memories=(64.0, 512.0), gain_memory=1024.0),
        "light",
        "accumulate",
    ),
}


def recipe_of(mode: str) -> Recipe:
    """The recipe of a mode, "paper" or "best"."""
    if mode not in RECIPES:
        raise unknown_name("denoiser mode", mode, RECIPES)
    return RECIPES[mode]
