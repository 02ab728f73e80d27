"""The loop of every training here: steps at a rate of learning that warms up and falls, validations, and files.

The rate warms up over WARM_UP_STEPS steps and falls as a cosine to nothing at the end.  A run that is limited by
minutes ends where the clock says.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from pathlib import Path

import torch
from torch import Tensor, nn
from tqdm import tqdm

from denoiser.ground.captured import captured
from denoiser.training.resumable_run import Run
from denoiser.training.train_config import TrainConfig, training_record
from denoiser.training.training_source import TrainingSource
from denoiser.weights import save_weights
from spikecam_env.whole import whole_file, write_text_whole

WARM_UP_STEPS = 100
RUN_FILE = "last.pt"
"""File in the folder of a run, from which it is resumed."""


def learn(
    config: TrainConfig,
    run: Run,
    source: TrainingSource,
    validate: Callable[[nn.Module], dict[str, float]],
    *,
    began: float,
    progress: bool,
) -> Path:
    """Take steps to the end of the run; returns the path of the weights.

    Args:
        config: options of the training.
        run: to go on with.
        source: of the losses.
        validate: scores of the network that is kept by name, "network_db" among them.
        began: begin of this part of the run, by `time.monotonic`.
        progress: shows a bar.
    """
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
    step = captured(
        lambda: _step(run, source), source.streams.device, source.streams.rng
    )  # on a GPU a few steps are taken meanwhile
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


def begun(config: TrainConfig, network: nn.Module) -> Run:
    """A run before its first step, or the one that is in the folder, where that is to go on."""
    run = Run.begin(network.to(config.device, memory_format=torch.channels_last))  # type: ignore[call-overload]
    if resumes(config):
        run.load(config.out / RUN_FILE)
    torch.backends.cudnn.benchmark = True
    return run


def resumes(config: TrainConfig) -> bool:
    """Whether there is a run to go on with."""
    return config.resume and (config.out / RUN_FILE).exists()


def _step(run: Run, source: TrainingSource) -> Tensor:
    """One step; its loss, which a GPU may still be computing."""
    run.optimiser.zero_grad(set_to_none=True)
    error = source.loss(run.network)
    error.backward()
    nn.utils.clip_grad_norm_(run.network.parameters(), 1.0)
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
