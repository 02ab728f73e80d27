"""`spikecam evaluate quick | spikezoo | truth`: modes on held-out scenes, on clips, and where no light is known."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, get_args

import tyro

from spikecam_env.cli.mode_weights import Denoiser, Mode, ModeWeights, Reconstruction
from spikecam_env.cli.without_effect import WithoutEffect
from spikecam_env.numbers import Positive, Seed, WholeRange, Workers


def _is_not_evaluated(mode: str, command: Any) -> bool:
    return all(one.partition("-")[0] != mode for one in command.modes)


UNUSED_WEIGHTS = tuple(
    WithoutEffect((mode,), partial(_is_not_evaluated, mode), f"--modes has no {mode}") for mode in get_args(Mode)
)
"""Weights of modes that are not evaluated."""


@dataclass
class Quick:
    """Compare noisy, denoised and clean-twin streams on held-out scenes.

    Held-out textures, speeds and light levels, TFP 21 and 41, against true light and the clean twin.

    example:  spikecam evaluate quick --out evaluation
    """

    out: Path | None = None
    """Folder for evaluate.json, evaluate.txt and evaluate.jsonl; a run that was stopped goes on in it."""
    modes: tuple[Mode, ...] = ("paper", "best")
    """Modes to evaluate."""
    scenes: Annotated[int, WholeRange(1, 1000)] = 2
    """Scenes in each class of speed and light; the same count again gives a finer mean."""
    seed: Seed = 0
    """Seed of the held-out scenes, cameras and noise."""
    weights: ModeWeights = field(default_factory=ModeWeights)

    without_effect: ClassVar = UNUSED_WEIGHTS

    def run(self) -> None:
        from denoiser.evaluate import evaluate_quick, report

        options: dict[str, Any] = {"weights": self.weights.by_mode(), "scenes_a_class": self.scenes, "seed": self.seed}
        _show("evaluate", self.out, report(evaluate_quick(self.modes, out=self.out, **options)))


@dataclass
class SpikeZoo:
    """PSNR and SSIM of pictures at the middle of clips in Spike-Zoo's layout, as Spike-Zoo computes them.

    Rows: pictures of the noisy spikes and of each mode's by TFP, TFI and our Spk2ImgNet, and the rate planes of each
    mode.  No random numbers.  Beside each the seconds of one core for a picture.

    example:  spikecam evaluate spikezoo reds --out evaluation
    """

    folder: tyro.conf.Positional[Path]
    """Folder of spike/*.dat and gt/*.png of the same names, or test/ with them.  Pictures say rows and columns."""
    out: Path | None = None
    """Folder for spikezoo.txt, .csv, .json and .jsonl, and the sheet of pictures spikezoo.png; a run that was stopped
    goes on in it."""
    modes: tuple[Denoiser, ...] = ("paper", "fast", "best", "best-overlap", "picture")
    """Modes to evaluate; `paper` takes nearly all of the time."""
    pictures: tuple[Reconstruction, ...] = ("tfp21", "tfp41", "tfi", "spk2img-clean", "spk2img-noisy")
    """Pictures of the noisy and the denoised spikes."""
    rate: Positive = 0.6
    """Light [spikes/frame] that is white in the pictures; 0.6 in Spike-Zoo's REDS clips."""
    jobs: Workers = 1
    """Worker processes, one thread each; 1 works in this one, with all threads."""
    weights: ModeWeights = field(default_factory=ModeWeights)

    without_effect: ClassVar = UNUSED_WEIGHTS

    def run(self) -> None:
        from denoiser.evaluate.spikezoo import evaluate_spikezoo, report

        options: dict[str, Any] = {"weights": self.weights.by_mode(), "rate": self.rate, "jobs": self.jobs}
        options["pictures"] = self.pictures
        result = evaluate_spikezoo(self.folder, self.modes, out=self.out, **options)
        _show("spikezoo", self.out, report(result), "png", "csv")


@dataclass
class TruthTests:
    """Compare with measured truth: a recording's other half, the fixed pattern of a moving one, measured cameras.

    Without recordings the simulated tests alone are run.  Options of reading a recording go into a side file beside
    it (docs/recordings.md).

    example:  spikecam evaluate truth --static wall.npz --moving helicopter.npz --out evaluation
    """

    static: Path | None = None
    """A recording of a scene at rest: one half is denoised, the mean of the other is the truth."""
    moving: Path | None = None
    """A recording in which everything moves: a pattern that stays is the camera's own."""
    out: Path | None = None
    """Folder for truth.json, truth.txt and truth.jsonl; the held-out scenes in it are not evaluated again."""
    modes: tuple[Mode, ...] = ("paper", "best")
    """Modes to evaluate."""
    scenes: Annotated[int, WholeRange(1, 1000)] = 1
    """Simulated scenes for each camera, and in each class of speed and light."""
    seed: Seed = 0
    """Seed of the simulated scenes, cameras and noise."""
    weights: ModeWeights = field(default_factory=ModeWeights)

    without_effect: ClassVar = UNUSED_WEIGHTS

    def run(self) -> None:
        from denoiser.evaluate.truth import evaluate_truth, report

        options: dict[str, Any] = {"weights": self.weights.by_mode(), "scenes": self.scenes, "seed": self.seed}
        _show("truth", self.out, report(evaluate_truth(self.static, self.moving, self.modes, out=self.out, **options)))


def _show(name: str, out: Path | None, report: str, *more: str) -> None:
    print(report, end="")
    if out is not None:
        print(f"wrote {', '.join(f'{name}.{kind}' for kind in (*more, 'json'))} and {name}.txt in {out}")
