"""Training: minimise the error of the light along simulated streams, resumable at any minute.

    paper        L = mean (ISI_dn - ISI_clean)^2                 paper (22), normalised intervals (`interval_training`)
    best, fast   L = mean (rate - light)^2 / (rate + 0.02) + ..  light weighs as its count noise does (`rollout`)
    picture      the same, along pictures of its own (`picture_training`)
    spk2img-*    L = mean (rate - light)^2 / (rate + 0.05) + ..  (`lessons`)
    ssml         from noisy spikes alone (`lessons`)

Adam; the rate of learning warms up over WARM_UP_STEPS and falls as a cosine to nothing at the end.  Everything follows
from the seed and the number of steps; a run limited by `minutes` ends where the clock says.  A resumed run draws other
streams.  On a GPU streams, windows and network are all there.

In `out` the run keeps `<mode>.pt` (weights), `last.pt` (to resume), `curve.json` and `curve.png` (validation).
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from tqdm import tqdm

from denoiser.ground.captured import captured
from denoiser.networks.dnss import DnSS
from denoiser.networks.reconstructor_recipe import ReconstructorRecipe
from denoiser.networks.stream_network import StreamDnSS
from denoiser.passes.recipe import AnyRecipe as DenoiserRecipe
from denoiser.passes.recipe import Recipe
from denoiser.training.resumable_run import Run
from denoiser.training.rollout import Rollouts
from denoiser.training.simulated import Bank
from denoiser.training.smaller import narrowed, without_refine
from denoiser.training.train_config import TrainConfig as TrainConfig
from denoiser.training.train_config import training_record
from denoiser.training.training_source import TrainingSource
from denoiser.weights import load_weights, save_weights
from spikecam_env.datasets import twin_recordings
from spikecam_env.errors import InputError
from spikecam_env.run_folder import run_folder
from spikecam_env.torch_settings import torch_settings
from spikecam_env.whole import whole_file, write_text_whole

WARM_UP_STEPS = 100
MOST_GRADIENT = 3.0
"""Usual norms beyond which a gradient is shortened: single ones cost `picture` 5 dB in 1000 steps.  Nine in ten
gradients are below 1.8 (measured along 420 steps)."""
RUN_FILE = "last.pt"
"""File in the folder of a run, from which it is resumed."""
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
    run = _begun(config)
    few = None if kind.whole_bank else config.steps * config.batch
    bank = None if config.recordings else Bank.drawn(config.seed, device, streams=few, progress=progress)
    source = kind(
        config.recipe,
        taken=config.batch,
        patch=config.patch,
        device=device,
        seed=config.seed + run.step,  # a resumed run meets other streams
        bank=bank,
        compiled=config.compiled or device.type == "cuda",
        **_own(config),
    )
    return _learn(config, run, source, validation(config), began, progress)


def _begun(config: TrainConfig) -> Run:
    """A run before its first step, or the one that is in the folder, where that is to go on."""
    goes_on, recipe = config.resume and (config.out / RUN_FILE).exists(), config.recipe
    if not isinstance(recipe, ReconstructorRecipe) and config.start is not None and not goes_on:
        network = started(recipe, config.start, config.seed, config.patch)
    else:
        network = config.source.networks(recipe)
    if config.layers == "last" and isinstance(network, StreamDnSS):
        network.only_last_learn()
    run = Run.begin(network.to(config.device, memory_format=torch.channels_last))  # type: ignore[call-overload]
    if goes_on:
        run.load(config.out / RUN_FILE)
    torch.backends.cudnn.benchmark = True
    return run


def _own(config: TrainConfig) -> dict[str, Any]:
    """Arguments of the streams that not every source has; InputError for a teacher of other windows."""
    recipe, teacher, own = config.recipe, config.teacher, _recorded(config)
    if config.source is Rollouts:
        own |= {name: getattr(config, name) for name in ("layers", "seams")}
        own |= {} if config.recordings else {name: getattr(config, name) for name in ("panned", "weak")}
    if not isinstance(recipe, Recipe) or teacher is None:
        return own if config.frames_a_step is None else own | {"frames_a_step": config.frames_a_step}
    found, network, _ = load_weights(teacher)
    if found.layout != recipe.layout:
        raise InputError(f"teacher is {teacher!r}, weights of another mode; give a file of this mode")
    network = network.to(config.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
    return own | {"teacher": network.requires_grad_(False)}


def _recorded(config: TrainConfig) -> dict[str, Any]:
    """The recordings to learn from, where some are given."""
    return {"recordings": twin_recordings(config.recordings)} if config.recordings else {}


def _learn(
    config: TrainConfig,
    run: Run,
    source: TrainingSource,
    validate: Callable[[nn.Module], dict[str, float]],
    began: float,
    progress: bool,
) -> Path:
    """Take steps to the end of the run, which went on at `began`, by `time.monotonic`."""
    network = run.network["student"] if isinstance(run.network, nn.ModuleDict) else run.network
    before, saved = run.seconds, time.monotonic()
    bar = tqdm(total=config.steps, initial=run.step, disable=not progress, mininterval=5.0, desc=config.mode)
    losses: list[Tensor] = []
    weights = config.out / f"{config.mode}.pt"

    def save() -> Path:
        record = training_record(config, run.step, run.seconds, run.resumed_at)
        save_weights(weights, config.mode, config.recipe, network, record)
        save_progress(config.out, run)
        return weights

    run.set_rate(rate_at(config.lr, 0, 0.0))  # of the steps that come before a capture
    # on a GPU a few steps are taken meanwhile; what comes from files cannot be replayed
    device = torch.device("cpu") if config.recordings else source.streams.device
    step = captured(lambda: _step(run, source), device, source.streams.rng)
    while (done := share_done(config, run)) < 1.0:
        run.set_rate(rate_at(config.lr, run.step, done))
        losses.append(step())
        run.step += 1
        run.seconds = before + time.monotonic() - began
        bar.update()
        if run.step % config.validate_every == 0:
            scores = validate(network)
            mean = float(torch.stack(losses).mean())
            run.curve.append({"step": run.step, "seconds": run.seconds, "loss": mean, **scores})
            losses.clear()
            bar.set_postfix(loss=mean, db=scores["network_db"])
        if run.step % config.validate_every == 0 or time.monotonic() - saved > config.save_every_s:
            save()
            saved = time.monotonic()
    bar.close()
    return save()


def validation(config: TrainConfig) -> Callable[[nn.Module], dict[str, float]]:
    """Gives PSNR against light 1.0 [dB] of a network and of simpler guesses, always along the same held-out streams."""
    streams, patch, passes = config.source.held_out
    device, seed = torch.device(config.device), config.seed + VALIDATION_SEED
    recorded = _recorded(config)
    if recorded:
        recorded["held_out"] = True
    bank = None if recorded else Bank.drawn(seed, device, textures=32, units=16)

    def scores(network: nn.Module) -> dict[str, float]:
        source = config.source(
            config.recipe,
            taken=streams,
            pool=1,
            patch=config.patch if recorded else patch or config.patch,
            device=device,
            seed=seed,
            bank=bank,
            **recorded,
        )
        network.eval()
        errors = source.errors(network, passes or config.validate_passes)
        network.train()
        return {f"{name}_db": round(-10 * math.log10(max(error, 1e-12)), 3) for name, error in errors.items()}

    return scores


def _step(run: Run, source: TrainingSource) -> Tensor:
    """One step; its loss, which a GPU may still be computing."""
    run.optimiser.zero_grad(set_to_none=True)
    error = source.loss(run.network)
    error.backward()
    run.shorten_gradients(MOST_GRADIENT)
    run.optimiser.step()
    return error.detach()


def share_done(config: TrainConfig, run: Run) -> float:
    """Share of the run that is over, by the clock where it is limited by minutes."""
    return run.step / config.steps if config.minutes is None else run.seconds / (60 * config.minutes)


def rate_at(highest: float, step: int, done: float) -> float:
    """The rate of learning of a step."""
    return highest * min(1.0, (step + 1) / WARM_UP_STEPS) * 0.5 * (1 + math.cos(math.pi * done))


def save_progress(folder: Path, run: Run) -> None:
    """Write the file to resume from, and the validations as numbers and as a picture; each file appears whole."""
    run.save(folder / RUN_FILE)
    write_text_whole(folder / "curve.json", json.dumps(run.curve, indent=1))
    if run.curve:
        _plot(run.curve, folder / "curve.png")


def _plot(curve: list[dict[str, float]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 4))
    axes = figure.subplots()
    for name in (key for key in curve[0] if key.endswith("_db")):
        axes.plot([p["step"] for p in curve], [p[name] for p in curve], label=name.removesuffix("_db"))
    axes.set(xlabel="step", ylabel="PSNR against the true light [dB]")
    axes.legend()
    with whole_file(path) as beside:
        figure.savefig(beside, dpi=120)


def started(recipe: DenoiserRecipe, start: str, seed: int, patch: int = 64) -> nn.Module:
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
    if not isinstance(found, Recipe) or not isinstance(recipe, Recipe):
        if found != recipe:
            raise InputError(f"start is {start!r}, weights of another network; give a file of this mode")
        return network.train()
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
        seen = Rollouts(recipe, seed=seed, taken=NARROWING_STREAMS, pool=1, patch=patch, device=device)
        network = narrowed(network, recipe.channels, lambda larger: seen.errors(larger, NARROWING_PASSES))
    return network.train()
