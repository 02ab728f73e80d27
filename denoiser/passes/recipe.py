"""The modes: the window and network of each, its target in training, and its decoder from rates to spikes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import AfterValidator, Field
from torch import nn

from denoiser.networks.dnss import DnSS
from denoiser.networks.picture_network import HIDDEN, PICTURE_CHANNELS, PictureDnSS
from denoiser.networks.stream_network import CARRY, CHANNELS, MOST_CHANNELS, StreamDnSS
from denoiser.passes.history_kernels import DARK
from denoiser.passes.pixel_history import CONDITIONS, MULTIPLE, PictureLayout
from denoiser.passes.window import WindowLayout
from spikecam_env.checked import checked_whole
from spikecam_env.errors import InputError, shown, unknown_name
from spikecam_env.untrusted import Declared, declared


@dataclass(frozen=True)
class Recipe:
    """Network, window, target and decoder of a mode."""

    layout: WindowLayout
    target: str
    """The quantity that the network learns, "light" or "clean_inverse_interval"."""
    decoder: str
    """"mus" (`denoiser.decoders.mus`) or "accumulate" (`denoiser.decoders.accumulate`)."""
    refine: bool = True
    """Whether `paper` has its refine module."""
    channels: tuple[int, int, int] = CHANNELS
    """Of a network of many planes (`stream_network.StreamDnSS`)."""

    def network(self) -> nn.Module:
        """The untrained network: (N, span, H, W) spikes, (N, layers, H, W) planes -> (N, planes, H, W) rates."""
        if self.layout.planes == 1:
            return DnSS(window=self.layout.span, refine=self.refine)
        layout = self.layout
        return StreamDnSS(layout.span, layout.layers, layout.planes, layout.means, self.channels)

    def carries(self, shape: tuple[int, int]) -> tuple[tuple[int, int, int], ...]:
        """Shapes of the arrays that a pass leaves for the next, for frames of `shape`."""
        if self.layout.planes == 1:
            return ()
        height, width = (n + -n % 4 for n in shape)
        return (1, *shape), (CARRY, height // 2, width // 2)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for a checkpoint.  `channels` are left out if they are `CHANNELS`: older files have none, and
        their digests stay valid."""
        plain = asdict(self)
        return plain if self.channels != CHANNELS else {name: plain[name] for name in plain if name != "channels"}

    @classmethod
    def from_dict(cls, data: Any, where: str = "recipe") -> Recipe:
        """The inverse of `to_dict`; InputError for anything else, whose text `where` begins."""
        plain = declared(_DeclaredRecipe, data, where)
        layout = WindowLayout(**plain.layout.model_dump())
        return cls(layout, plain.target, plain.decoder, plain.refine, plain.channels)


@dataclass(frozen=True)
class PictureRecipe:
    """Network and planes of a mode that gives one picture a step."""

    layout: PictureLayout = field(default_factory=PictureLayout)
    channels: tuple[int, int] = PICTURE_CHANNELS
    """`picture_network.PictureDnSS`."""

    target: ClassVar[str] = "light"
    decoder: ClassVar[None] = None

    def network(self) -> PictureDnSS:
        """The untrained network."""
        return PictureDnSS(self.layout.layers, self.layout.rates, CONDITIONS, DARK, self.channels)

    def carries(self, shape: tuple[int, int]) -> tuple[tuple[int, int, int], ...]:
        """Shape of the hidden picture that a pass leaves for the next, for frames of `shape`."""
        height, width = (n + -n % MULTIPLE for n in shape)
        return ((HIDDEN, height // 2, width // 2),)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for a checkpoint."""
        return asdict(self)


AnyRecipe: TypeAlias = Recipe | PictureRecipe


def recipe_from(data: Any, where: str = "recipe") -> AnyRecipe:
    """The recipe of `to_dict`; InputError for anything else, whose text `where` begins."""
    layout = data.get("layout") if isinstance(data, dict) else None
    if isinstance(layout, dict) and "instants" in layout:
        plain = declared(_DeclaredPictureRecipe, data, where)
        return PictureRecipe(PictureLayout(**plain.layout.model_dump()), plain.channels)
    return Recipe.from_dict(data, where)


def _none_or_some(memory: float) -> float:
    if 0 < memory < 1:
        raise ValueError("it must be 0 or at least 1")
    return memory


_Frames = Annotated[int, Field(ge=0, le=1000)]
_Memory = Annotated[float, Field(ge=1, le=1e6)]
_Channels = Annotated[int, Field(ge=1, le=MOST_CHANNELS)]


class _DeclaredLayout(Declared):
    """Ranges: with `CHANNELS`, a network of any such layout has fewer than two million weights."""

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
    channels: Annotated[tuple[_Channels, _Channels, _Channels], Field(strict=False)] = CHANNELS


_Age = Annotated[int, Field(ge=-64, le=64)]
_Few = Field(max_length=16, strict=False)


class _DeclaredPictureLayout(Declared):
    instants: Annotated[tuple[_Age, ...], _Few]
    counts: Annotated[tuple[Annotated[int, Field(ge=1, le=100)], ...], _Few]
    half_widths: Annotated[tuple[Annotated[int, Field(ge=1, le=64)], ...], _Few]
    memories: Annotated[tuple[_Memory, ...], _Few]
    gain_memory: _Memory


class _DeclaredPictureRecipe(Declared):
    layout: _DeclaredPictureLayout
    channels: Annotated[tuple[_Channels, _Channels], Field(strict=False)]


_PASSES = WindowLayout(
    past=16, planes=16, future=16, half_widths=(4, 12, 22), memories=(64.0, 512.0), gain_memory=1024.0
)
RECIPES = {
    "paper": Recipe(WindowLayout(past=20, planes=1, future=20), "clean_inverse_interval", "accumulate"),
    "best": Recipe(_PASSES, "light", "accumulate"),
    "fast": Recipe(_PASSES, "light", "accumulate", channels=(32, 64, 12)),
}
"""Modes that give the rate in every frame."""
MODES: dict[str, AnyRecipe] = {**RECIPES, "picture": PictureRecipe()}


def recipe_of(mode: str) -> Recipe:
    """The recipe of a mode that gives every frame: "paper", "best" or "fast"."""
    if not isinstance(mode, str) or mode not in RECIPES:
        raise unknown_name("denoiser mode", mode, RECIPES)
    return RECIPES[mode]


def checked_channels(channels: Any, like: Sequence[int]) -> tuple[int, ...]:
    """Channels of a network, as many numbers as `like` has; InputError unless they are whole numbers in range."""
    if isinstance(channels, str) or not isinstance(channels, Sequence) or len(channels) != len(like):
        raise InputError(f"channels is {shown(channels)}; it must be {len(like)} numbers, as {tuple(like)}")
    return tuple(checked_whole(count, "channels", 1, MOST_CHANNELS) for count in channels)
