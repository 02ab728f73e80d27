"""Pictures of a study: learning curves, and films of an agent at work."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spikecam_env.agents.playing import Actor
from spikecam_env.agents.study import Result
from spikecam_env.whole import whole_file


def draw_curves(results: Sequence[Result], path: Path) -> None:
    """A panel a task: performance in training over processor minutes, a line a run, a colour a sight."""
    learned = [result for result in results if result.curve]
    tasks = sorted({result.case.task for result in learned}) or [""]
    sights = sorted({result.case.sight for result in learned})
    figure = Figure(figsize=(4.2 * len(tasks), 3.4), layout="constrained")
    for axes, task in zip(figure.subplots(1, len(tasks), squeeze=False)[0], tasks, strict=True):
        seen: set[str] = set()
        for result in (result for result in learned if result.case.task == task):
            sight = result.case.sight
            minutes = [row["cpu_s"] / 60 for row in result.curve]
            label = None if sight in seen else sight
            axes.plot(minutes, [row["performance"] for row in result.curve], f"C{sights.index(sight)}", label=label)
            seen.add(sight)
        axes.set(title=task, xlabel="processor time [min]", ylabel="performance in training", ylim=(0, 1))
        if seen:
            axes.legend(frameon=False)
    with whole_file(path) as beside:
        figure.savefig(beside, format="png", dpi=110)


def pictures(actor: Actor, env: gymnasium.Env[Any, Any], seed: int) -> Iterator[NDArray[np.uint8]]:
    """(rows, columns, 3) uint8 of an episode, a step each, ENLARGED, with the middle marked; env: with rgb_array."""
    observation, _ = env.reset(seed=seed)
    actor.begin()
    over = False
    while not over:
        yield _marked(env.render())
        observation, _, terminated, truncated, _ = env.step(actor.act(observation))
        over = terminated or truncated
    yield _marked(env.render())


ENLARGED = 6
"""Pixels of a film a pixel of the camera."""
MARK = (255, 180, 0)


def _marked(picture: Any) -> NDArray[np.uint8]:
    large = np.asarray(picture, np.uint8).repeat(ENLARGED, axis=0).repeat(ENLARGED, axis=1)
    row, column = (size // 2 for size in large.shape[:2])
    large[row - 1 : row + 1, column - 12 : column + 12] = MARK
    large[row - 12 : row + 12, column - 1 : column + 1] = MARK
    return large
