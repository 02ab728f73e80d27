"""`spikecam evaluate`: how much a denoiser helps, on scenes it has not seen."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro


@dataclass
class Evaluate:
    """Compare noisy, denoised (both modes) and clean-twin streams on held-out scenes.

    example:  spikecam evaluate quick --out evaluation.json
    """

    what: tyro.conf.Positional[Literal["quick"]] = "quick"
    """quick: held-out textures, speeds and light levels, TFP 21 and 41, against true light and the clean twin."""
    out: Path | None = None
    """Where to write the figures as JSON."""
    seed: int = 0

    def run(self) -> None:
        from denoiser.evaluate import evaluate_quick, report

        result = evaluate_quick(seed=self.seed)
        print(report(result))
        if self.out is not None:
            from spikecam_env.cli.files import write_json

            write_json(self.out, result)
            print(f"wrote {self.out}")
