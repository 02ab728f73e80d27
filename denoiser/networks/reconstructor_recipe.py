"""The learned reconstructors by name: network, width, and the spikes from which it learns."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any, Literal

from pydantic import Field
from torch import nn

from denoiser.networks.spk2imgnet import Spk2ImgNet
from denoiser.networks.ssml import Student
from spikecam_env.checked import checked_whole
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.untrusted import Declared, declared

WIDTH_STEP, WIDEST = 12, 252
"""Channels come in twelves (four groups, three scales a width), up to the most.  48 ships; Spk2ImgNet of 144 has 3.72 M
parameters, about as many as the publication's 3.91 M."""
NETWORKS = {"spk2imgnet": Spk2ImgNet, "ssml": Student}


@dataclass(frozen=True)
class ReconstructorRecipe:
    """Network and training spikes of a reconstructor."""

    architecture: str
    """Of `NETWORKS`."""
    learns_from: str
    """Spikes of its training, "clean" or "noisy"."""
    width: int = 48
    """Channels of its body."""

    def network(self) -> nn.Module:
        """The untrained network: (N, 41, H, W) spikes -> (N, 1, H, W) float32 light [spikes/frame]."""
        return NETWORKS[self.architecture](self.width)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for a checkpoint."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Any, where: str = "recipe") -> ReconstructorRecipe:
        """The inverse of `to_dict`; InputError for anything else, whose text `where` begins."""
        return cls(**declared(_DeclaredRecipe, data, where).model_dump())


class _DeclaredRecipe(Declared):
    architecture: Literal["spk2imgnet", "ssml"]
    learns_from: Literal["clean", "noisy"]
    width: Annotated[int, Field(ge=WIDTH_STEP, le=WIDEST, multiple_of=WIDTH_STEP)]


LEARNED = {
    "spk2img-clean": ReconstructorRecipe("spk2imgnet", "clean"),
    "spk2img-noisy": ReconstructorRecipe("spk2imgnet", "noisy"),
    "ssml": ReconstructorRecipe("ssml", "noisy"),
}


def reconstructor_recipe(name: str, width: int | None = None) -> ReconstructorRecipe:
    """The recipe of a learned reconstructor, of another width where one is given; InputError for another name, and for
    a width out of range."""
    if not isinstance(name, str) or name not in LEARNED:
        raise unknown_name("learned reconstructor", name, LEARNED)
    return LEARNED[name] if width is None else replace(LEARNED[name], width=_checked_width(width))


def _checked_width(width: Any) -> int:
    checked = checked_whole(width, "width", WIDTH_STEP, WIDEST)
    if checked % WIDTH_STEP:
        raise InputError(f"width = {checked}; it must be a multiple of {WIDTH_STEP}, up to {WIDEST}")
    return checked
