"""Training a reconstructor on simulated streams as they go on, resumable at any minute.

Each step moves every stream on by `frames_a_step` frames and learns from the window that ends there (`rolling.py`), by
the loss of `lessons.py`.  The loop is that of all training (`training_loop.py`).  A resumed run goes on with new
streams.

In `out` the run keeps `<mode>.pt` (weights), `last.pt` (to resume), `curve.json` and `curve.png`: validation on streams
of another seed, against the true light, beside TFP 21, TFP 41 and TFI of the same windows.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn

from denoiser.ground.number_type import computing_in, number_type
from denoiser.networks import ssml
from denoiser.networks.reconstructor_recipe import ReconstructorRecipe, reconstructor_recipe
from denoiser.networks.spk2imgnet import WINDOW
from denoiser.training.lessons import Lesson, LessonWindows, lesson_of
from denoiser.training.rolling import RollingWindows
from denoiser.training.simulated import UNIT_SHAPE, Bank, SimulatedStreams
from denoiser.training.training_loop import begun, learn
from denoiser.training.training_options import VALIDATION_SEED, TrainingOptions
from spikecam_env.numbers import WholeRange
from spikecam_env.run_folder import run_folder
from spikecam_env.torch_settings import torch_settings

VALIDATION_STREAMS = 64
VALIDATION_MOMENTS = 4
VALIDATION_TEXTURES, VALIDATION_UNITS = 32, 16
FRAMES_BETWEEN_MOMENTS = 64


@dataclass(frozen=True)
class ReconstructorConfig(TrainingOptions):
    """Options of a reconstructor's training; every stream of `batch` gives a window a step."""

    mode: str = "spk2img-noisy"
    """"spk2img-clean", "spk2img-noisy" or "ssml"."""
    batch: int = 64
    validate_every: int = 500
    width: int | None = None
    """Channels; None: the recipe's."""
    frames_a_step: int = 12
    """Frames by which the streams go on."""

    ranges = TrainingOptions.ranges | {"patch": WholeRange(1, min(UNIT_SHAPE)), "frames_a_step": WholeRange(1, WINDOW)}

    def __post_init__(self) -> None:
        self.recipe()
        super().__post_init__()

    def recipe(self) -> ReconstructorRecipe:
        """The recipe to train; InputError for an unknown mode or width."""
        return reconstructor_recipe(self.mode, self.width)


def train_reconstructor(config: ReconstructorConfig, *, progress: bool = True) -> Path:
    """Train, or go on training; returns the path of the weights.

    `minutes` counts from here, with the drawing of textures and compilation.

    Args:
        config: options.
        progress: shows a bar.

    Raises:
        InputError: another run is at work in `out`, or it holds the run of another mode or width, or a damaged one.
    """
    with run_folder(config.out, "a run of training"), torch_settings(config.threads, config.seed):
        return _trained(config, progress)


def _trained(config: ReconstructorConfig, progress: bool) -> Path:
    began = time.monotonic()
    lesson = lesson_of(config.recipe())
    run = begun(config, lesson.networks)
    rolling = _windows(config, run.step, lesson.span)
    held_out = _held_out(config)
    student = lesson.networks["student"]
    return learn(
        config,
        run,
        config.recipe(),
        student,
        lambda: _loss(lesson, rolling.advance(config.frames_a_step)),
        rolling.streams,
        lambda: validate(student, held_out),
        began=began,
        progress=progress,
    )


def _loss(lesson: Lesson, windows: LessonWindows) -> Tensor:
    """Mean of the streams whose windows are whole."""
    kind = number_type("auto", windows.spikes.device)
    with computing_in(kind, windows.spikes.device):
        losses = lesson.losses(windows, kind)
    return (losses * windows.old).sum() / windows.old.sum().clamp(min=1)


def _windows(config: ReconstructorConfig, step: int, span: int) -> RollingWindows:
    """Of the streams to learn from; a run that is resumed at `step` meets others."""
    device = torch.device(config.device)
    bank = Bank.drawn(config.seed, device)
    seed, twin = config.seed + step, config.recipe().learns_from
    streams = SimulatedStreams(
        config.batch,
        config.patch,
        device,
        seed,
        bank=bank,
        compiled=config.compiled or device.type == "cuda",
        twins=(twin,),
    )
    return RollingWindows(streams, twin, span)


def _held_out(config: ReconstructorConfig) -> list[LessonWindows]:
    """Windows of other streams at a few moments."""
    seed, device = config.seed + VALIDATION_SEED, torch.device(config.device)
    bank = Bank.drawn(seed, device, textures=VALIDATION_TEXTURES, units=VALIDATION_UNITS)
    twin = config.recipe().learns_from
    streams = SimulatedStreams(VALIDATION_STREAMS, config.patch, device, seed, bank=bank, twins=(twin,))
    rolling = RollingWindows(streams, twin, WINDOW)
    return [rolling.advance(FRAMES_BETWEEN_MOMENTS).copy() for _ in range(VALIDATION_MOMENTS)]


def validate(network: nn.Module, held_out: list[LessonWindows]) -> dict[str, float]:
    """Error of the light over held-out windows, as PSNR [dB] against light 1.0: network, TFP 21, TFP 41, TFI."""
    network.eval()
    sums: dict[str, float] = {}
    for windows in held_out:
        spikes, middle = windows.spikes, WINDOW // 2
        kind = number_type("auto", spikes.device)
        with torch.inference_mode(), computing_in(kind, spikes.device):
            found = network(spikes.to(kind).contiguous(memory_format=torch.channels_last))
        guesses: Mapping[str, Tensor] = {
            "network": found.clamp(0, 1),
            "tfp21": spikes[:, middle - 10 : middle + 11].float().mean(1, keepdim=True),
            "tfp41": spikes.float().mean(1, keepdim=True),
            "tfi": ssml.interval_rate(spikes, middle),
        }
        for name, guess in guesses.items():
            errors = (guess - windows.light[:, middle, None]).square().mean((1, 2, 3))
            sums[f"{name}_db"] = sums.get(f"{name}_db", 0.0) + float(errors[windows.old].sum())
    network.train()
    count = sum(int(windows.old.sum()) for windows in held_out)
    return {name: round(-10 * math.log10(max(total, 1e-12) / max(count, 1)), 3) for name, total in sums.items()}
