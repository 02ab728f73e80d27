"""Checkpoints: trained networks as small files, with their recipe and the record of their training.

A file is `torch.save` of plain values: format, mode, recipe, state_dict, training (command, seed, steps, minutes,
package version) and sha256, the digest of recipe and weights.  A foreign file cannot run code (`plain_torch.py`).
`seal` adds the digest to a file without one.  The file of a reconstructor has `name` in place of `mode`, and its
weights are float16 (they compute in float32).
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import warnings
from collections.abc import Callable, Collection, Mapping
from importlib import resources
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import torch
from torch import Tensor, nn

from denoiser.ground.plain_torch import read_plain, tensors_like
from denoiser.ground.torch_threads import where_torch_can
from denoiser.networks.reconstructor_recipe import LEARNED, ReconstructorRecipe
from denoiser.passes.recipe import MODES, recipe_from
from denoiser.passes.recipe import AnyRecipe as DenoiserRecipe
from spikecam_env.errors import InputError, shown, unknown_name
from spikecam_env.whole import whole_file

FORMAT = "spikecam-denoiser/1"
RECONSTRUCTOR_FORMAT = "spikecam-reconstructor/1"

AnyRecipe: TypeAlias = DenoiserRecipe | ReconstructorRecipe
R = TypeVar("R", bound=AnyRecipe)


def save_weights(
    path: str | os.PathLike[str], mode: str, recipe: AnyRecipe, network: nn.Module, training: dict[str, Any]
) -> None:
    """Write a checkpoint of a denoiser or a reconstructor; the file appears whole."""
    state = {name: tensor.detach().cpu().contiguous() for name, tensor in network.state_dict().items()}
    names = {"format": FORMAT, "mode": mode}
    if isinstance(recipe, ReconstructorRecipe):
        names = {"format": RECONSTRUCTOR_FORMAT, "name": mode}
        state = {name: tensor.to(torch.float16) for name, tensor in state.items()}
    data = {**names, "recipe": recipe.to_dict(), "state_dict": state, "training": training}
    write_whole(path, data | {"sha256": digest(recipe, state)})


def load_weights(path: str | os.PathLike[str]) -> tuple[DenoiserRecipe, nn.Module, dict[str, Any]]:
    """Read a checkpoint, or the weights of a mode that ship.  Warns where it has no digest.

    Args:
        path: of the file, or the name of a mode.

    Returns:
        Recipe, network in evaluation mode, training record.

    Raises:
        InputError: a missing or damaged file, a file of another kind, weights of another network, and weights that are
            not finite or not those of the digest.
    """
    return where_torch_can(lambda: read_checkpoint(weights_path(path), FORMAT, recipe_from))


def load_reconstructor(path: str | os.PathLike[str]) -> tuple[ReconstructorRecipe, nn.Module, dict[str, Any]]:
    """Read a checkpoint of a reconstructor, as `load_weights` does; its weights become float32."""
    return where_torch_can(
        lambda: read_checkpoint(path, RECONSTRUCTOR_FORMAT, ReconstructorRecipe.from_dict, torch.float16)
    )


def digest(recipe: AnyRecipe, weights: Mapping[str, Tensor]) -> str:
    """SHA-256 of a recipe, and of weights by name."""
    found = hashlib.sha256(json.dumps(recipe.to_dict(), sort_keys=True).encode())
    for name in sorted(weights):
        tensor = weights[name].detach().cpu().contiguous()
        found.update(f"{name} {tensor.dtype} {tuple(tensor.shape)}".encode())
        found.update(tensor.reshape(-1).view(torch.uint8).numpy().tobytes())  # numpy has no bfloat16
    return found.hexdigest()


def pretrained_path(mode: str) -> Path:
    """Where the shipped weights of a mode are."""
    return _shipped("denoiser mode", mode, MODES)


def reconstructor_path(name: str) -> Path:
    """Where the shipped weights of a learned reconstructor are."""
    return _shipped("learned reconstructor", name, LEARNED)


def _shipped(what: str, name: Any, known: Collection[str]) -> Path:
    if not isinstance(name, str) or name not in known:
        raise unknown_name(what, name, known)
    return Path(str(resources.files("denoiser") / "weights" / f"{name}.pt"))


def weights_path(weights: Any) -> Path:
    """Path of weights that are given by path or by the name of a mode; InputError for another object, a network for
    one."""
    if isinstance(weights, str) and weights in MODES:
        return pretrained_path(weights)
    if not isinstance(weights, str | os.PathLike):
        raise InputError(
            f"weights are given as a {type(weights).__name__}; give {', '.join(MODES)} or the path of a checkpoint"
        )
    return Path(weights)


def write_whole(path: str | os.PathLike[str], data: Any) -> None:
    """`torch.save`, whole; the same data give the same bytes under any name."""
    held = io.BytesIO()
    torch.save(data, held)
    with whole_file(Path(path)) as beside:
        beside.write_bytes(held.getbuffer())


def seal(path: str | os.PathLike[str]) -> None:
    """Add the digest to a checkpoint without one; nothing else changes.  InputError as `load_weights`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        recipe, _, _ = load_weights(path)
    data = read_plain(path)
    write_whole(path, data | {"sha256": digest(recipe, data["state_dict"])})


def read_checkpoint(
    path: str | os.PathLike[str], form: str, recipe_of: Callable[[Any, str], R], number_type: torch.dtype | None = None
) -> tuple[R, nn.Module, dict[str, Any]]:
    """The parts of a checkpoint, as `load_weights` gives them.

    Args:
        path: of the file.
        form: its format.
        recipe_of: makes the recipe of plain values and the begin of an error's text.
        number_type: of the weights in the file; None: that of the network.
    """
    data = read_plain(path)
    if not isinstance(data, dict) or data.get("format") != form:
        found = data.get("format") if isinstance(data, dict) else type(data).__name__
        raise InputError(f"{path} is not a {form} checkpoint (found {shown(found)}); give a file of `spikecam train`")
    recipe = recipe_of(data.get("recipe"), f"{path}: recipe")
    network, training = recipe.network(), data.get("training", {})
    expected = {name: w if number_type is None else w.to(number_type) for name, w in network.state_dict().items()}
    weights = tensors_like(expected, data.get("state_dict"), str(path))
    if not isinstance(training, dict):
        raise InputError(f"{path}: training is {type(training).__name__}; it must be a table; copy the file again")
    if "sha256" not in data and form == FORMAT:  # early files have none
        warnings.warn(
            f"{path} has no digest, so whether its weights are whole cannot be checked; "
            "if they are yours, add one with denoiser.weights.seal(path)",
            UserWarning,
            stacklevel=2,
        )
    elif data.get("sha256") != digest(recipe, weights):
        raise InputError(f"{path} is damaged: its weights are not those of its digest; copy it again or train anew")
    network.load_state_dict(weights)
    return recipe, network.eval(), dict(training)
