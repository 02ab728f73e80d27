"""`spikecam train`: train a denoiser or a reconstructor along simulated streams."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from spikecam_env.cli.without_effect import WithoutEffect
from spikecam_env.numbers import Count, Positive, Range, Seed, WholeRange, Workers


@dataclass
class Train:
    """Train DnSS or a reconstructor on noisy and clean streams simulated on the fly, or on recordings; goes on from its
    last checkpoint.

    example:  spikecam train --mode best --out runs/best
    on films: spikecam train --start best --recordings clip.h5 --out runs/mine
    on a GPU: spikecam train --mode best --device cuda --batch 48 --minutes 7.6 --out runs/best
    """

    out: Path
    """Folder of the run: weights, checkpoint to resume from, validation curve (JSON, PNG)."""
    mode: Literal["best", "fast", "paper", "picture", "spk2img-clean", "spk2img-noisy", "ssml"] = "best"
    """`paper`: the paper's network and loss; `best`: many rate planes a pass, trained on true light;
    `fast`: the same with a quarter of the weights.  The others are
    reconstructors, which make pictures of spikes."""
    steps: Count = 20_000
    """Training steps in all; the learning rate falls to zero over them."""
    minutes: Positive | None = None
    """End after this many minutes, instead of after --steps."""
    batch: Annotated[int, WholeRange(1, 65_536)] | None = None
    """Streams a step.  Default: 16; for reconstructors 64."""
    patch: Count = 64
    """Side of a stream's frames [pixels], a multiple of 16, at most 128."""
    lr: Annotated[float, Range(0.0, 1.0, above=True)] = 1e-3
    """Highest learning rate."""
    seed: Seed = 0
    """Seed of network, scenes, cameras and noise."""
    threads: Workers = 2
    """Threads, on a processor."""
    device: str = "cpu"
    """Device of streams and network: cpu, cuda, cuda:1."""
    refine: bool = True
    """Give `paper` its refine module; without it for the ablation."""
    channels: tuple[Count, ...] | None = None
    """Channels of `best`, `fast` or `picture` at half and at quarter resolution, and of the head of the first two:
    fewer are faster, and less accurate.  Default: 64 128 24, 32 64 12 and 32 64."""
    start: str | None = None
    """Weights to begin from: a file of this command, or `best`, `fast` or `paper` for those that ship.  A network
    with fewer channels, or without the refine module, begins from a larger one.  Default: none."""
    recordings: tuple[Path, ...] | None = None
    """Learn from recordings with a clean twin instead: .h5 files of `spikecam film --clean`, folders of `spikecam
    dataset`.  The last fifth of each is kept for validation.  Not for `picture`."""
    teacher: str | None = None
    """Weights whose rates `best` or `fast` learns instead of the true light, as a small network does better: a file, or
    `best`."""
    layers: Literal["all", "last"] | None = None
    """Layers of `best` or `fast` that learn: all, or, of weights to begin from, the last."""
    seams: Annotated[float, Range(0.0, 1000.0)] | None = None
    """Weight of the steps from pass to pass in the loss of `best` or `fast`.  Default: 0."""
    panned: Annotated[float, Range(0.0, 1.0)] | None = None
    """Share of the simulated scenes of `best` or `fast` before a camera that pans.  Default: 0."""
    weak: Annotated[float, Range(0.0, 1.0)] | None = None
    """Share of the layers of these scenes whose texture is weak.  Default: 0."""
    width: Count | None = None
    """Channels of a reconstructor, a multiple of 12 up to 252.  Default: 48."""
    frames_a_step: Count | None = None
    """Frames that a reconstructor's streams advance in a step, at most 41.  Default: 12."""
    validate_every: Count | None = None
    """Steps between validations.  Default: 1000, of reconstructors 500."""
    validate_passes: Count | None = None
    """Passes of each validation along its eight streams.  Default: 24."""
    compiled: bool = False
    """Compile the simulated light on a processor too: faster steps, after a minute; needs a C++ compiler."""
    resume: bool = True
    """Continue from the folder's checkpoint, if there is one."""

    without_effect: ClassVar = (
        WithoutEffect(("steps",), lambda c: c.minutes is not None, "--minutes says when the training ends"),
        WithoutEffect(
            ("panned", "weak", "compiled"), lambda c: c.recordings, "streams of --recordings are not simulated"
        ),
    )

    def run(self) -> None:
        from denoiser.training.train import TrainConfig, train

        given = {name: value for name, value in vars(self).items() if value is not None}
        print(f"wrote {train(TrainConfig(**given))}")
