"""Training: minimise the error of the light along simulated streams, resumable at any minute.

    paper        L = mean (ISI_dn - ISI_clean)^2                 paper (22), normalised intervals (`interval_training`)
    best, fast   L = mean (rate - light)^2 / (rate + 0.02) + ..  light weighs as its count noise does (`rollout`)
    spk2img-*    L = mean (rate - light)^2 / (rate + 0.05) + ..  (`lessons`)
    ssml         from noisy spikes alone (`lessons`)

Adam; the rate of learning warms up over 100 steps and falls as a cosine to nothing at the end.  Everything follows from
the seed and the number of steps; a run limited by `minutes` ends where the clock says.  A resumed run draws other
streams.  On a GPU streams, windows and network are all there.

In `out` the run keeps `<mode>.pt` (weights), `last.pt` (to resume), `curve.json` and `curve.png` (validation).
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from torch import nn

from denoiser.networks.dnss import DnSS
from denoiser.networks.stream_network import StreamDnSS
from denoiser.passes.recipe import Recipe
from denoiser.training.simulated import Bank
from denoiser.training.smaller import narrowed, without_refine
from denoiser.training.train_config import TrainConfig as TrainConfig
from denoiser.training.train_config import source_of
from denoiser.training.training_loop import begun, learn, resumes
from denoiser.weights import load_weights
from spikecam_env.errors import InputError
from spikecam_env.run_folder import run_folder
from spikecam_env.torch_settings import torch_settings

VALIDATION_SEED = 1_000_003
"""Added to the seed of a run: other scenes, other units, other textures of the same kinds."""
NARROWING_STREAMS, NARROWING_PASSES = 8, 16
"""From which the channels of a larger network are chosen for a smaller one."""


def train(config: TrainConfig, *, progress: bool = True) -> Path:
    """Train, or go on training; returns the path of the weights.

    Args:
        config: options.
        progress: shows a bar.

    Raises:
        InputError: another run is at work in `out`; it holds the run of another network, or a damaged one; `start` is
            of another network.
    """
    with run_folder(config.out, "a run of training"), torch_settings(config.threads, config.seed):
        return _trained(config, progress)


def _trained(config: TrainConfig, progress: bool) -> Path:
    began = time.monotonic()
    device, kind = torch.device(config.device), config.source
    run = begun(config, _networks(config))
    few = None if kind.whole_bank else config.steps * config.batch
    source = kind(
        config.recipe,
        taken=config.batch,
        patch=config.patch,
        device=device,
        seed=config.seed + run.step,  # a resumed run meets other streams
        bank=Bank.drawn(config.seed, device, streams=few, progress=progress),
        compiled=config.compiled or device.type == "cuda",
        **_own(config),
    )
    return learn(config, run, source, Validator(config).scores, began=began, progress=progress)


class Validator:
    """Held-out streams, the same at every validation."""

    def __init__(self, config: TrainConfig) -> None:
        self._config, self._seed, self._device = config, config.seed + VALIDATION_SEED, torch.device(config.device)
        self._bank = Bank.drawn(self._seed, self._device, textures=32, units=16)

    def scores(self, network: nn.Module) -> dict[str, float]:
        """PSNR against light 1.0 [dB] of the network and of simpler guesses, each along whole streams."""
        config, (streams, patch, passes) = self._config, self._config.source.held_out
        source = config.source(
            config.recipe,
            taken=streams,
            pool=1,
            patch=patch or config.patch,
            device=self._device,
            seed=self._seed,
            bank=self._bank,
        )
        network.eval()
        errors = source.errors(network, passes or config.validate_passes)
        network.train()
        return {f"{name}_db": round(-10 * math.log10(max(error, 1e-12)), 3) for name, error in errors.items()}


def started(recipe: Recipe, start: str, seed: int, patch: int = 64) -> nn.Module:
    """A trained network, ready to learn further.  Of a larger network a smaller one is made (`smaller`).

    Args:
        recipe: of the network to train.
        start: a file of weights, or the name of weights that ship.
        seed: of the streams from which the smaller network is made.
        patch: their side [pixels].

    Raises:
        InputError: the weights are of another kind of network, or of a smaller one.
    """
    found, network, _ = load_weights(start)
    alike = replace(found, decoder=recipe.decoder, channels=recipe.channels, refine=recipe.refine) == recipe
    larger = all(one >= other for one, other in zip(found.channels, recipe.channels, strict=True))
    if not alike or not larger or found.refine < recipe.refine:  # how rates become spikes is not learnt
        raise InputError(
            f"start is {start!r}, weights of another network; give a file of this mode, as large or larger"
        )
    if isinstance(network, DnSS) and found.refine > recipe.refine:
        network = without_refine(network)
    if isinstance(network, StreamDnSS) and found.channels != recipe.channels:
        device = torch.device("cpu")
        seen = source_of(recipe)(recipe, seed=seed, taken=NARROWING_STREAMS, pool=1, patch=patch, device=device)
        network = narrowed(network, recipe.channels, lambda larger: seen.errors(larger, NARROWING_PASSES))
    return network.train()


def _networks(config: TrainConfig) -> nn.Module:
    """To begin with; a run that goes on has its own."""
    recipe = config.recipe
    if isinstance(recipe, Recipe) and config.start is not None and not resumes(config):
        return started(recipe, config.start, config.seed, config.patch)
    return config.source.networks(recipe)


def _own(config: TrainConfig) -> dict[str, Any]:
    """Arguments of the streams that not every source has; InputError for a teacher of other windows."""
    recipe, teacher = config.recipe, config.teacher
    if not isinstance(recipe, Recipe) or teacher is None:
        return {} if config.frames_a_step is None else {"frames_a_step": config.frames_a_step}
    found, network, _ = load_weights(teacher)
    if found.layout != recipe.layout:
        raise InputError(f"teacher is {teacher!r}, weights of another mode; give a file of this mode")
    network = network.to(config.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
    return {"teacher": network.requires_grad_(False)}
