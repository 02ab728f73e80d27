"""A network that a user gives to the denoiser: checked before it is copied, and its output before it is used.

A network of the recipe's own class computes passes by `passed`, which reads less data twice.  Any other module, as
`torch.compile(network)` is one, is called: its additions to the network within it act.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from denoiser.ground.torch_threads import where_torch_can
from denoiser.networks.dnss import DnSS
from denoiser.networks.picture_network import PictureDnSS
from denoiser.networks.stream_network import StreamDnSS
from denoiser.passes.recipe import PictureRecipe, Recipe
from spikecam_env.errors import InputError, OwnCodeError

COMPILED, PARALLEL = "_orig_mod.", "module."
"""Prefixes that torch.compile and DataParallel give the names of a network's weights."""


def check_network(recipe: Any, network: Any) -> None:
    """Refuse a network that is not of this recipe, or cannot compute.

    Args:
        recipe: a `Recipe`, else refused.
        network: its network (`recipe.network()`, `load_weights(path)`), or a module that takes and gives the same.

    Raises:
        InputError: names the given object, and the one to give.
    """
    if not isinstance(recipe, Recipe | PictureRecipe):
        raise InputError(f"recipe is a {type(recipe).__name__}; give a Recipe, for one `recipe_of('best')`")
    if not isinstance(network, nn.Module):
        raise InputError(f"network is {_kind(network)}; give a torch module, `recipe.network()` or of `load_weights`")
    if isinstance(network, torch.jit.ScriptModule):
        raise InputError("network is a ScriptModule, which cannot be copied in another type; give the network itself")
    if any(getattr(part, "_compiled_call_impl", None) is not None for part in network.modules()):
        raise InputError("network is compiled in place, which a copy of it is not; give torch.compile(network)")
    with torch.device("meta"):
        own = recipe.network()
    weights = network.state_dict()
    _check_sizes(weights, own.state_dict())
    if isinstance(network, DnSS | StreamDnSS | PictureDnSS) and not isinstance(network, type(own)):
        raise InputError(f"network is a {type(network).__name__}, the recipe's is a {type(own).__name__}; give its own")
    where_torch_can(lambda: _check_values(weights))


def check_output(network: nn.Module, found: Any, sizes: tuple[int, int, int, int]) -> tuple[Tensor, tuple[Tensor, ...]]:
    """The rates and carried tensors that a module returned for a batch.

    Args:
        network: the module, for the error's text.
        found: the returned object.
        sizes: (N, planes, H, W) of the batch; planes are those that are used, it may return more.

    Raises:
        OwnCodeError: it is no pair of rates (N, planes, H, W) and of tensors to carry, or not finite.
    """
    name = type(network).__name__
    if not isinstance(found, tuple) or len(found) != 2 or not isinstance(found[0], Tensor):
        raise OwnCodeError(f"network {name}: it returned a {type(found).__name__}; it must return (rates, carried)")
    rate, kept = found
    if rate.ndim != 4 or (len(rate), *rate.shape[2:]) != (sizes[0], *sizes[2:]) or rate.shape[1] < sizes[1]:
        raise OwnCodeError(f"network {name}: rates have shape {tuple(rate.shape)}; it must be {sizes}")
    if not bool(torch.isfinite(rate).all()):
        raise OwnCodeError(f"network {name}: its rates are not all finite")
    return rate, kept or ()


def has_passes(network: Any) -> bool:
    """Whether a network's own class, not a class around it, has `passed`, and no hook is on it that only a call
    reaches."""
    called = any(vars(network).get(name) for name in ("_forward_hooks", "_forward_pre_hooks", "forward"))
    return hasattr(type(network), "passed") and not called


def _check_values(weights: dict[str, Any]) -> None:
    for name, tensor in weights.items():
        if isinstance(tensor, Tensor) and tensor.is_meta:
            raise InputError(f"network: {name} is on the device meta and has no values; load its weights")
        if isinstance(tensor, Tensor) and not bool(torch.isfinite(tensor).all()):
            raise InputError(f"network: {name} holds values that are not finite; train anew or load other weights")


def _check_sizes(weights: dict[str, Any], own: dict[str, Any]) -> None:
    for full_name, tensor in weights.items():
        name = full_name.removeprefix(COMPILED).removeprefix(PARALLEL)
        if name in own and getattr(tensor, "shape", None) != own[name].shape:
            raise InputError(
                f"network is of another recipe: {name} is {tuple(tensor.shape)}, of this recipe "
                f"{tuple(own[name].shape)}; give the recipe that `load_weights` returns with the network"
            )


def _kind(value: Any) -> str:
    return f"the class {value.__name__}" if isinstance(value, type) else f"a {type(value).__name__}"
