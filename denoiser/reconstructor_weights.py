"""Checkpoints of reconstructors: as `denoiser.weights`, with weights in float16 (they compute in float32).

A file is `torch.save` of plain values: format, name, recipe, state_dict, training (command, seed, steps, minutes,
package version) and sha256, the digest of recipe and weights.
"""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from denoiser.ground.torch_threads import where_torch_can
from denoiser.networks.reconstructor_recipe import LEARNED, ReconstructorRecipe
from denoiser.weights import digest, read_checkpoint, write_whole
from spikecam_env.errors import unknown_name

FORMAT = "spikecam-reconstructor/1"


def save_reconstructor(
    path: str | os.PathLike[str], name: str, recipe: ReconstructorRecipe, network: nn.Module, training: dict[str, Any]
) -> None:
    """Write a checkpoint; the file appears whole."""
    state = _halves(network)
    data = {"format": FORMAT, "name": name, "recipe": recipe.to_dict(), "state_dict": state, "training": training}
    write_whole(path, data | {"sha256": digest(recipe, state)})


def load_reconstructor(path: str | os.PathLike[str]) -> tuple[ReconstructorRecipe, nn.Module, dict[str, Any]]:
    """Read a checkpoint.

    Args:
        path: of the file.

    Returns:
        Recipe, network in evaluation mode with float32 weights, training record.

    Raises:
        InputError: a missing or damaged file, a file of another kind, weights of another network, and weights that are
            not finite or not those of the digest.
    """
    return where_torch_can(lambda: read_checkpoint(path, FORMAT, ReconstructorRecipe.from_dict, torch.float16))


def shipped_path(name: str) -> Path:
    """Where the shipped weights of a learned reconstructor are."""
    if not isinstance(name, str) or name not in LEARNED:
        raise unknown_name("learned reconstructor", name, LEARNED)
    return Path(str(resources.files("denoiser") / "weights" / f"{name}.pt"))


def _halves(network: nn.Module) -> dict[str, Tensor]:
    return {name: w.detach().cpu().to(torch.float16).contiguous() for name, w in network.state_dict().items()}
