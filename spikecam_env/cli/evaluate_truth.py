"""`spikecam evaluate truth`: the denoiser where the light is not known, or the camera is a measured one."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from spikecam_env.cli.mode_weights import Mode, ModeWeights
from spikecam_env.numbers import Seed, WholeRange


@dataclass
class EvaluateTruth:
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
    """Folder for truth.json and truth.txt."""
    modes: tuple[Mode, ...] = ("paper", "best")
    """Modes to evaluate."""
    scenes: Annotated[int, WholeRange(1, 1000)] = 1
    """Simulated scenes for each camera, and in each class of speed and light."""
    seed: Seed = 0
    """Seed of the simulated scenes, cameras and noise."""
    weights: ModeWeights = field(default_factory=ModeWeights)

    def run(self) -> None:
        from denoiser.evaluate.truth import evaluate_truth, report
        from spikecam_env.cli.files import show_evaluation

        options: dict[str, Any] = {"weights": self.weights.by_mode(), "scenes": self.scenes, "seed": self.seed}
        show_evaluation(
            "truth", self.out, lambda: evaluate_truth(self.static, self.moving, self.modes, **options), report
        )
