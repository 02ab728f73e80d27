"""Checkpoints: trained networks as small files that say what they are and how they were made.

A file is `torch.save` of plain values: format, mode, recipe, state_dict, training (command, seed, steps, minutes,
package version).  It is read with `weights_only=True`, so a foreign file cannot run code.
"""

from __future__ import annotations

import io
import os
import pickle
from importlib import resources
from pathlib import Path
from typing import Any

import torch
from torch import nn

from denoiser.recipe import RECIPES, Recipe
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.whole import whole_file

FORMAT = "spikecam-denoiser/1"


def save_weights(path: str | os.PathLike[str], mode: str, recipe: Recipe, network: nn.Module, training: dict) -> None:
    """Write a checkpoint; the file appears whole."""
    state = {name: tensor.detach().cpu().contiguous() for name, tensor in network.state_dict().items()}
    write_whole(
        path,
        {"format": FORMAT, "mode": mode, "recipe": recipe.to_dict(), "state_dict": state, "training": training},
    )


def load_weights(path: str | os.PathLike[str]) -> tuple[Recipe, nn.Module, dict[str, Any]]:
    """Read a checkpoint: (recipe, network in evaluation mode, training record).

    Raises InputError for a missing or truncated file, a file of another kind, and weights of another network.
    """
    data = read_plain(path)
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        found = data.get("format") if isinstance(data, dict) else type(data).__name__
        raise InputError(f"{path} is not a {FORMAT} checkpoint (found {found!r}); give a file of `spikecam train`")
    recipe = Recipe.from_dict(data.get("recipe", {}))
    network = recipe.network()
    try:
        network.load_state_dict(data["state_dict"])
    except (KeyError, RuntimeError, TypeError, AttributeError) as error:
        first_line = str(error).splitlines()[0]
        raise InputError(f"{path} holds weights of another network ({first_line}); train again") from error
    return recipe, network.eval(), dict(data.get("training", {}))


def pretrained_path(mode: str) -> Path:
    """Where the shipped weights of a mode are."""
    if mode not in RECIPES:
        raise unknown_name("denoiser mode", mode, RECIPES)
    return Path(str(resources.files("denoiser") / "weights" / f"{mode}.pt"))


def read_plain(path: str | os.PathLike[str]) -> Any:
    """Any `torch.save` file of plain values; raises InputError where it is missing, cut short or foreign."""
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except OSError as error:
        raise InputError(f"cannot read weights {path}: {error.strerror or error}") from error
    except (RuntimeError, pickle.UnpicklingError, EOFError, ValueError, KeyError) as error:
        raise InputError(f"{path} is not a whole torch file of plain values; copy it again or train anew") from error


def write_whole(path: str | os.PathLike[str], data: Any) -> None:
    """`torch.save`, whole; the same data give the same bytes under any name."""
    held = io.BytesIO()
    torch.save(data, held)
    with whole_file(Path(path)) as beside:
        beside.write_bytes(held.getbuffer())
