"""Pictures of a study: learning curves, and films of an agent at work."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spikecam_env.agents.study import Result
from spikecam_env.envs.score import Policy, judged_env
from spikecam_env.whole import whole_file

COLUMNS = 3
"""Panels of curves in a row."""


def draw_curves(results: Sequence[Result], path: Path) -> None:
    """Draw learning curves: a panel a task, a line a run, a colour a sight.

    Args:
        results: of a study; those without agents on the way are left out.
        path: the PNG to write; the score on test episodes over the steps of training.
    """
    learned = [result for result in results if result.along]
    tasks = sorted({result.case.task for result in learned}) or [""]
    sights = sorted({result.case.sight for result in learned})
    rows, columns = -(-len(tasks) // COLUMNS), min(len(tasks), COLUMNS)
    figure = Figure(figsize=(3.4 * columns, 2.8 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, task in zip(panels, tasks, strict=False):
        axes.set(title=task, xlabel="steps of training [thousand]", ylabel="score on test episodes")
        _draw_lines(axes, [result for result in learned if result.case.task == task], sights)
    for axes in panels[len(tasks) :]:
        axes.axis("off")
    with whole_file(path) as beside:
        figure.savefig(beside, format="png", dpi=110)


def _draw_lines(axes: Axes, results: Sequence[Result], sights: Sequence[str]) -> None:
    """Lines of a task's results; 0 and 1 are within the panel."""
    seen: set[str] = set()
    for result in results:
        sight = result.case.sight
        steps, scores = ([row[name] for row in result.along] for name in ("steps", "score"))
        label = None if sight in seen else sight
        axes.plot(np.divide(steps, 1000), scores, f"C{sights.index(sight)}.-", label=label)
        seen.add(sight)
    lowest = min((row["score"] for result in results for row in result.along), default=0.0)
    axes.set(xlim=(0, None), ylim=(min(0.0, lowest) - 0.05, 1.05))
    axes.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    if results:
        axes.legend(frameon=False, loc="lower right")


def pictures(policy: Policy, env: gymnasium.Env[Any, Any], seed: int) -> Iterator[NDArray[np.uint8]]:
    """Pictures (rows, columns, 3) of an episode, one a step, enlarged, the middle marked; `env` renders rgb_array."""
    observation, _ = env.reset(seed=seed)
    inner, over = judged_env(env), False
    while not over:
        yield _marked(env.render())
        observation, _, terminated, truncated, _ = env.step(np.asarray(policy(observation, inner), np.float32))
        over = terminated or truncated
    yield _marked(env.render())


FILM_SIDE = 384
"""Longer side of a film, to which smaller pictures are enlarged by a whole number [pixels]."""
MARK = (255, 180, 0)


def _marked(picture: Any) -> NDArray[np.uint8]:
    factor = max(1, FILM_SIDE // max(np.shape(picture)[:2]))
    large = np.asarray(picture, np.uint8).repeat(factor, axis=0).repeat(factor, axis=1)
    row, column = (size // 2 for size in large.shape[:2])
    large[row - 1 : row + 1, column - 12 : column + 12] = MARK
    large[row - 12 : row + 12, column - 1 : column + 1] = MARK
    return large
