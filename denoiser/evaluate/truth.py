"""Truth tests: the worth of a denoiser where nobody knows the light, or the camera is a real one.

    halves          a real recording at rest, one half denoised, the mean of the other as the truth (`halves`)
    pattern         a recording that moves, and simulated ones: fixed pattern that is left (`fixed_pattern`)
    measured        the held-out scenes of `quick`, true light, before cameras as measured (preset `measured`): once
                    with its shading, which no denoiser can tell from the scene, and once without

NIQE judges a picture by itself and rewards grain; these compare with the light of the scene.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from denoiser.evaluate import fixed_pattern, halves
from denoiser.evaluate.case import ScoredPictures
from denoiser.evaluate.fixed_pattern import evaluate_pattern, evaluate_simulated_pattern
from denoiser.evaluate.quick import PICTURES, Summary, held_out_tables
from denoiser.evaluate.rows import WeightFiles, Weights, denoiser
from denoiser.evaluate.work import results_in
from spikecam_env.sensor import SensorModel
from spikecam_env.streams import read_recording

SHOWN = ("well lit, moving", "well lit, static", "all dim")
"""Of `quick.GROUPS`."""


def evaluate_truth(
    static: str | os.PathLike[str] | None = None,
    moving: str | os.PathLike[str] | None = None,
    modes: Sequence[str] = ("paper", "best"),
    *,
    weights: WeightFiles | None = None,
    scenes: int = 1,
    seed: int = 0,
    out: str | os.PathLike[str] | None = None,
) -> dict[str, Any]:
    """Run the tests; those on recordings where there are recordings.

    Args:
        static: a recording of a scene at rest.
        moving: a recording in which everything moves.
        modes: denoisers to judge.
        weights: checkpoint by mode, instead of the shipped ones.
        scenes: simulated ones, for each camera of the pattern and each class of `quick`.
        seed: of the simulated scenes.
        out: a folder for `truth.json`, `truth.txt` and the records of the held-out scenes, `truth.jsonl`; those are not
            made again.

    Returns:
        "halves", "pattern" (by recording or camera), "measured" (by camera, as `evaluate_quick`), "settings".

    Raises:
        InputError: recordings that cannot be read, are too short, or dark, or nowhere at rest; an unknown mode, or
            weights that cannot be read; another run at work in `out`.
    """
    recordings = {path: read_recording(Path(path)).spikes for path in (static, moving) if path is not None}
    given = Weights.of_modes(modes, weights)
    online = {mode: denoiser(mode, given) for mode in modes}
    with results_in(out, "truth", {}, ScoredPictures) as results:
        patterns = {} if moving is None else {Path(moving).name: evaluate_pattern(recordings[moving], online)}
        result = {
            "settings": {
                "static": None if static is None else str(static),
                "moving": None if moving is None else str(moving),
                "modes": list(modes),
                "scenes": scenes,
                "seed": seed,
            },
            "halves": None if static is None else halves.evaluate_halves(recordings[static], online),
            "pattern": patterns | evaluate_simulated_pattern(online, scenes=scenes, seed=seed),
            "measured": {
                name: held_out_tables(modes, given, results, scenes, seed=seed, model=model, camera=f"{name}:")
                for name, model in cameras().items()
            },
        }
        results.write(result, report(result))
    return result


def cameras() -> dict[str, SensorModel]:
    """Models of the cameras before the held-out scenes, by their names in the report."""
    measured = SensorModel.preset("measured")
    return {"measured": measured, "measured, without shading": measured.without("vignetting")}


def report(result: dict[str, Any]) -> str:
    """The result as tables to read."""
    parts = []
    if result["halves"] is not None:
        parts.append(f"{Path(result['settings']['static']).name}, against itself\n" + halves.report(result["halves"]))
    for name, found in result["pattern"].items():
        parts.append("fixed pattern where the scene moves, " + fixed_pattern.report(found, name))
    for name, found in result["measured"].items():
        tables = [_table(group, found[group]) for group in SHOWN]
        parts.append(f"cameras {name}, against the true light [dB]\n" + "\n".join(tables) + "\n")
    return "\n".join(parts)


def _table(title: str, table: Summary) -> str:
    lines = [f"{title:18}" + "".join(f"{picture:>10}" for picture in PICTURES) + "   (TFI of rates: the plane)"]
    for row, pictures in table.items():
        levels = (pictures[picture]["light_db"] for picture in PICTURES)
        lines.append(f"{row:18}" + "".join("         -" if level is None else f"{level:10.2f}" for level in levels))
    return "\n".join(lines)
