"""The modes: which network sees which window, what it learns, and how its rates become spikes again."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field
from torch import nn

from denoiser.network import DnSS
from denoiser.stream_network import CARRY, StreamDnSS
from denoiser.window import WindowLayout
from spikecam_env.errors import unknown_name
from spikecam_env.untrusted import Declared, declared


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
        layout = self.layout
        return StreamDnSS(layout.span, layout.layers, layout.planes, layout.means)

    def carries(self, shape: tuple[int, int]) -> tuple[tuple[int, int, int], ...]:
        """Shapes of what a pass leaves for the next, for frames of `shape`."""
        if self.layout.planes == 1:
            return ()
        height, width = (n + -n % 4 for n in shape)
        return (1, *shape), (CARRY, height // 2, width // 2)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for a checkpoint."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Any, where: str = "recipe") -> Recipe:
        """The inverse of `to_dict`; raises InputError for anything else.  where: begins the error's text."""
        found = declared(_DeclaredRecipe, data, where)
        return cls(WindowLayout(**found.layout.model_dump()), found.target, found.decoder, found.refine)


def _none_or_some(memory: float) -> float:
    if 0 < memory < 1:
        raise ValueError("it must be 0 or at least 1")
    return memory


_Frames = Annotated[int, Field(ge=0, le=1000)]
_Memory = Annotated[float, Field(ge=1, le=1e6)]


class _DeclaredLayout(Declared):
    """Ranges: a network of any such layout has fewer than two million weights."""

    past: _Frames
    planes: Annotated[int, Field(ge=1, le=64)]
    future: _Frames
    half_widths: Annotated[tuple[_Frames, ...], Field(max_length=16, strict=False)]
    memories: Annotated[tuple[_Memory, ...], Field(max_length=16, strict=False)]
    gain_memory: Annotated[float, Field(ge=0, le=1e6), AfterValidator(_none_or_some)]


class _DeclaredRecipe(Declared):
    layout: _DeclaredLayout
    target: Literal["clean_inverse_interval", "light"]
    decoder: Literal["mus", "accumulate"]
    refine: bool


RECIPES = {
    "paper": Recipe(WindowLayout(past=20, planes=1, future=20), "clean_inverse_interval", "accumulate"),
    "best": Recipe(
        WindowLayout(
            past=16, planes=16, future=16, half_widths=(4, 12, 22), memories=(64.0, 512.0), gain_memory=1024.0
        ),
        "light",
        "accumulate",
    ),
}


def recipe_of(mode: str) -> Recipe:
    """The recipe of a mode, "paper" or "best"."""
    if not isinstance(mode, str) or mode not in RECIPES:
        raise unknown_name("denoiser mode", mode, RECIPES)
    return RECIPES[mode]
