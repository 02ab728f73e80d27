"""Training: minimise the error of the rate along simulated streams, resumable at any minute.

    paper   L = mean (ISI_dn - ISI_clean)^2                 paper (22), on normalised intervals (`interval_training`)
    best    L = mean (rate - light)^2 / (rate + 0.02) + ..  light weighs as its count noise does (`rollout`)

Adam; the rate of learning warms up over 100 steps and falls as a cosine to nothing at the end.  Everything follows from
the seed and the number of steps; a run limited by `minutes` ends where the clock says.  A resumed run draws other
streams.  On a GPU streams, windows and network are all there.

In `out` the run keeps `<mode>.pt` (weights), `last.pt` (to resume), `curve.json` and `curve.png` (validation).
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import torch
from torch import Tensor, nn

from denoiser.networks.dnss import DnSS
from denoiser.networks.stream_network import StreamDnSS
from denoiser.passes.recipe import Recipe, checked_channels, recipe_of
from denoiser.training.interval_training import IntervalWindows
from denoiser.training.rollout import Rollouts
from denoiser.training.simulated import Bank, SimulatedStreams
from denoiser.training.smaller import narrowed, without_refine
from denoiser.training.training_loop import begun, learn, resumes
from denoiser.training.training_options import VALIDATION_SEED, TrainingOptions
from denoiser.weights import load_weights
from spikecam_env.errors import InputError
from spikecam_env.numbers import WholeRange
from spikecam_env.run_folder import run_folder
from spikecam_env.torch_settings import torch_settings

VALIDATION_STREAMS = 8
NARROWING_PASSES = 16
"""Passes of VALIDATION_STREAMS streams from which the channels of a larger network are chosen for a smaller one."""
PASSES = {"light": 3, "clean_inverse_interval": 1}
"""Passes of each stream in a step, by the network's target."""


@dataclass(frozen=True)
class TrainConfig(TrainingOptions):
    """Options of a denoiser's training."""

    mode: str = "best"
    """"best", "fast" or "paper"."""
    refine: bool = True
    """`paper` with its refine module or, for the ablation, without."""
    channels: tuple[int, int, int] | None = None
    """Of `best` and `fast`, as `stream_network.StreamDnSS` has them: fewer are faster, and less accurate.  None: the
    mode's."""
    validate_passes: int = 24
    """Passes of each validation along its streams."""
    start: str | None = None
    """Weights of the same mode to begin from: a file of this training, or a mode's name for those that ship.  A network
    with more channels, or with the refine module, is made smaller (`smaller`)."""
    teacher: str | None = None
    """Not of `paper`: weights whose rates the network is to learn instead of the light, a file or "best"."""

    ranges = TrainingOptions.ranges | {"patch": WholeRange(16, 128), "validate_passes": WholeRange(1, 10**6)}
    flags = ("resume", "refine", "compiled")

    def __post_init__(self) -> None:
        recipe_of(self.mode)
        super().__post_init__()
        if self.patch % 16:
            raise InputError(f"patch is {self.patch}; it must be a multiple of 16")
        if self.channels is not None:
            object.__setattr__(self, "channels", checked_channels(self.channels))
        for name in ("start", "teacher"):
            given = getattr(self, name)
            if given is not None and not isinstance(given, str):
                raise InputError(f"{name} is {given!r}; it must be the path of weights, or a mode's name")
        if self.teacher is not None and recipe_of(self.mode).target != "light":
            raise InputError(f"teacher is for modes that learn the light; leave it out for {self.mode!r}")


def train(config: TrainConfig, *, progress: bool = True) -> Path:
    """Train, or go on training; returns the path of the weights.

    Args:
        config: options.
        progress: shows a bar.

    Raises:
        InputError: another run is at work in `out`; it holds the run of another mode, or a damaged one; `start` is of
            another network.
    """
    with run_folder(config.out, "a run of training"), torch_settings(config.threads, config.seed):
        return _trained(config, progress)


def _trained(config: TrainConfig, progress: bool) -> Path:
    recipe = replace(recipe_of(config.mode), refine=config.refine)
    recipe = recipe if config.channels is None else replace(recipe, channels=config.channels)
    device = torch.device(config.device)
    is_new = config.start is None or resumes(config)
    network = recipe.network() if is_new else started(recipe, str(config.start), config.seed, config.patch)
    run = begun(config, network)
    taught = {} if config.teacher is None else {"teacher": _teacher(recipe, config.teacher).to(device)}
    streams = source(
        recipe,
        **taught,
        seed=config.seed + run.step,  # a resumed run meets other streams
        taken=config.batch,
        patch=config.patch,
        device=device,
        bank=Bank.drawn(config.seed, device, streams=config.steps * config.batch, progress=progress),
        compiled=config.compiled or device.type == "cuda",
    )
    judge = Validator(recipe, config.seed + VALIDATION_SEED, device, config.validate_passes)
    return learn(
        config,
        run,
        recipe,
        run.network,
        lambda: streams.loss(run.network, PASSES[recipe.target]),
        streams.streams,
        lambda: judge.scores(run.network),
        began=time.monotonic(),
        progress=progress,
    )


class TrainingSource(Protocol):
    """Streams from which a network learns, and by which it is judged."""

    streams: SimulatedStreams

    def loss(self, network: nn.Module, passes: int) -> Tensor:
        """The loss of one step, with gradients."""

    def errors(self, network: nn.Module, passes: int) -> dict[str, float]:
        """Mean squared errors of every guess against the light."""


def source(recipe: Recipe, *, seed: int, **options: Any) -> TrainingSource:
    """Streams for a recipe: `Rollouts` for the light, `IntervalWindows` for the clean interval."""
    kind = IntervalWindows if recipe.target == "clean_inverse_interval" else Rollouts
    return kind(recipe.layout, seed=seed, **options)


class Validator:
    """Held-out streams, the same at every validation."""

    def __init__(self, recipe: Recipe, seed: int, device: torch.device, passes: int) -> None:
        self._recipe, self._seed, self._device, self._passes = recipe, seed, device, passes
        self._bank = Bank.drawn(seed, device, textures=32, units=16)

    def scores(self, network: nn.Module) -> dict[str, float]:
        """PSNR against light 1.0 [dB] of the network and of simpler guesses, each along whole streams."""
        network.eval()
        streams = source(
            self._recipe,
            seed=self._seed,
            taken=VALIDATION_STREAMS,
            pool=1,
            patch=64,
            device=self._device,
            bank=self._bank,
        )
        errors = streams.errors(network, self._passes)
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
    if not isinstance(found, Recipe):
        raise InputError(f"start is {start!r}, weights of mode 'picture'; give a file of this mode")
    alike = replace(found, decoder=recipe.decoder, channels=recipe.channels, refine=recipe.refine) == recipe
    larger = all(one >= other for one, other in zip(found.channels, recipe.channels, strict=True))
    if not alike or not larger or found.refine < recipe.refine:  # how rates become spikes is not learnt
        raise InputError(
            f"start is {start!r}, weights of another network; give a file of this mode, as large or larger"
        )
    if isinstance(network, DnSS) and found.refine > recipe.refine:
        network = without_refine(network)
    if isinstance(network, StreamDnSS) and found.channels != recipe.channels:
        seen = source(recipe, seed=seed, taken=VALIDATION_STREAMS, pool=1, patch=patch, device=torch.device("cpu"))
        network = narrowed(network, recipe.channels, lambda larger: seen.errors(larger, NARROWING_PASSES))
    return network.train()


def _teacher(recipe: Recipe, teacher: str) -> nn.Module:
    """InputError for a network of other windows."""
    found, network, _ = load_weights(teacher)
    if found.layout != recipe.layout:
        raise InputError(f"teacher is {teacher!r}, weights of another mode; give a file of this mode")
    return network.to(memory_format=torch.channels_last).requires_grad_(False)  # type: ignore[call-overload, no-any-return]
