"""A network made ready for passes: its copy in the numbers and at the place in which it computes, and its options."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, cast

import torch
from numpy.typing import ArrayLike
from torch import nn

from denoiser.ground.number_type import PRECISIONS, number_type
from denoiser.passes import infer
from denoiser.passes.fused_picture import prepared_picture
from denoiser.passes.given_network import check_network, has_passes
from denoiser.passes.picture_pass import pictures_of
from denoiser.passes.pixel_history import (
    LOOKS,
    STEPS,
    TYPICAL_LOOK,
    TYPICAL_STEP,
    PictureInput,
    PictureLayout,
    PixelHistory,
)
from denoiser.passes.pixel_map import PixelMap
from denoiser.passes.recipe import AnyRecipe, PictureRecipe
from denoiser.passes.window import PassWindow, RollingWindow
from spikecam_env.calibration import Calibration
from spikecam_env.checked import checked_count, checked_whole
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.sensor.engines.gpu import checked_device
from spikecam_env.types import Pictures

ENGINES = ("torch", "captured")

AnyWindow: TypeAlias = RollingWindow | PixelHistory
AnyInput: TypeAlias = PassWindow | PictureInput


@dataclass(frozen=True)
class Engine:
    """A network, and how it is run."""

    recipe: AnyRecipe
    network: nn.Module
    """As `infer.prepared` or `prepared_picture` makes it, on the device."""
    type: torch.dtype
    """In which it computes."""
    kind: str = "torch"
    """Of `ENGINES`; "captured": on CUDA, a pass of all streams is recorded once and replayed."""
    stride: int = 1
    """Frames from one evaluation of the network to the next; its plane is held in between."""
    unit: PixelMap | None = None
    """The calibration map."""
    device: torch.device | None = None
    """Of windows, planes and network; None: on the processor, in compiled code."""
    step: int = TYPICAL_STEP
    """Frames from a picture to the next, of mode `picture`."""
    look: int = TYPICAL_LOOK
    """Age of its pictures [frames]."""

    @classmethod
    def of(
        cls,
        recipe: AnyRecipe,
        network: nn.Module,
        *,
        precision: str = "auto",
        kind: str = "torch",
        stride: int = 1,
        unit: PixelMap | Calibration | tuple[ArrayLike, ArrayLike] | str | os.PathLike[str] | None = None,
        device: str | torch.device | None = None,
        step: int | None = None,
        look: int | None = None,
    ) -> Engine:
        """A copy of a network, with the options of `OnlineDnSS`; InputError for those that do not fit it."""
        check_network(recipe, network)
        if not isinstance(precision, str) or precision not in PRECISIONS:
            raise unknown_name("precision", precision, PRECISIONS)
        if kind == "openvino":
            raise InputError("engine 'openvino' was removed: it was 1.06 times as fast as 'torch'; take 'torch'")
        if not isinstance(kind, str) or kind not in ENGINES:
            raise unknown_name("engine", kind, ENGINES)
        if checked_count(stride, "stride") > 1 and recipe.layout.planes > 1:
            raise InputError(f"stride is {stride}; it must be 1 for a network of many planes a pass")
        if unit is not None and not recipe.layout.gain_memory:
            raise InputError("this network takes no calibration map; leave unit out, or use mode 'best'")
        unit = None if unit is None else PixelMap.of(unit)
        one_picture = isinstance(recipe, PictureRecipe)
        if not one_picture and (step, look) != (None, None):
            raise InputError("step and look are of mode 'picture'; this network gives every frame, leave them out")
        if one_picture and (device is not None or stride != 1):
            raise InputError("a network of one picture a step takes no device and no stride; leave them out")
        step = checked_whole(TYPICAL_STEP if step is None else step, "step", *STEPS)
        look = checked_whole(TYPICAL_LOOK if look is None else look, "look", *LOOKS)
        place = None if device is None else checked_device(device, "leave device out")
        if kind == "captured" and place is None:
            raise InputError("engine 'captured' replays passes on a device; give one, device='cuda', or take 'torch'")
        its_type = number_type(precision, place)
        network = prepared_picture(network, its_type) if one_picture else infer.prepared(network, its_type)
        if place is not None:
            network = _moved(network, place)
        return cls(recipe, network, its_type, kind, int(stride), unit, place, step, look)

    def window(self, shape: tuple[int, int]) -> AnyWindow:
        """The window of a stream of frames of `shape`, before its first frame."""
        layout = self.recipe.layout
        if isinstance(layout, PictureLayout):
            return PixelHistory(layout, shape, self.unit, self.step, self.look)
        return RollingWindow(layout, shape, self.unit)

    def run(
        self, windows: Sequence[AnyInput], carried: Sequence[infer.Carried], shape: tuple[int, int]
    ) -> list[tuple[Pictures, infer.Carried]]:
        """Rates of the windows of as many streams, and the carried arrays of each, in one pass of the network."""
        if isinstance(self.recipe, PictureRecipe):
            return pictures_of(self.network, cast("Sequence[PictureInput]", windows), carried, shape, self.type)
        return infer.rates_of_many(self.network, cast("Sequence[PassWindow]", windows), self.type, carried)

    def check_map(self, shape: tuple[int, int]) -> None:
        """InputError where the calibration map has another shape."""
        if self.unit is not None and self.unit.gain.shape != shape:
            raise InputError(f"the calibration map has shape {self.unit.gain.shape}, the stream's frames {shape}")

    def identity(self) -> dict[str, Any]:
        """The options on which rates depend."""
        return {
            "stride": self.stride,
            "precision": "bfloat16" if self.type == torch.bfloat16 else "float32",
            "engine": self.kind if self.device is None else f"{self.kind} on {self.device.type}",
            "calibration map": None if self.unit is None else self.unit.digest,
            **({"step": self.step, "look": self.look} if isinstance(self.recipe, PictureRecipe) else {}),
        }


def _moved(network: nn.Module, device: torch.device) -> nn.Module:
    if not has_passes(network):
        raise InputError(
            f"a device takes networks of many planes a pass, as mode 'best' is, and no {type(network).__name__}; "
            "leave device out"
        )
    return network.to(device)
