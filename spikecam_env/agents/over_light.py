"""Score over light: a study that was played at several mean intervals, as a table and as a picture.

    score(sight, light) = mean over seeds +- t(0.975, seeds - 1) sd / sqrt(seeds)

    gain(sight, light)  = the same of (score - score of the first sight), seed by seed

A column is a sight.  The first sight is the one that others are compared with.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from scipy import stats

from spikecam_env.agents.study import Result
from spikecam_env.whole import whole_file

LEVEL = 0.95
"""Of the intervals."""


class MeanOfSeeds(NamedTuple):
    """A mean, and the half of its interval of LEVEL; NaN of one seed."""

    mean: float
    half: float

    def __str__(self) -> str:
        return f"{self.mean:.3f}" if np.isnan(self.half) else f"{self.mean:.3f} +- {self.half:.3f}"


def mean_of_seeds(values: ArrayLike) -> MeanOfSeeds:
    """The mean of independent values and its interval, by Student's law.

    Example:
        >>> str(mean_of_seeds([0.9, 1.0, 1.1]))
        '1.000 +- 0.248'
    """
    numbers = np.asarray(values, np.float64)
    count = len(numbers)
    if count < 2:
        return MeanOfSeeds(float(numbers.mean()), float("nan"))
    t = float(stats.t.ppf((1 + LEVEL) / 2, count - 1))
    return MeanOfSeeds(float(numbers.mean()), t * float(numbers.std(ddof=1)) / count**0.5)


def light_rows(results: Sequence[Result]) -> list[dict[str, Any]]:
    """A row a task, length of training and interval: the score of each sight, and its gain over the first.

    Args:
        results: of a study; those without an interval are left out.
    """
    learned = [result for result in results if result.case.interval is not None]
    sights = _in_order(result.case.sight for result in learned)
    rows = []
    for task, steps in _problems(learned):
        for interval in _in_order(result.case.interval for result in learned):
            scores = {sight: _scores(learned, task, steps, sight, interval) for sight in sights}
            columns = {sight: str(mean_of_seeds([*its.values()])) for sight, its in scores.items() if its}
            gains = {f"{sight} - {sights[0]}": _gain(scores[sight], scores[sights[0]]) for sight in sights[1:]}
            head = {"task": task, "steps": steps, "interval [frames]": f"{interval:g}"}
            rows.append(head | {sight: columns.get(sight) for sight in sights} | gains)
    return rows


def draw_over_light(results: Sequence[Result], path: Path) -> None:
    """Draw scores over mean intervals: a column a task, a row a length of training, a colour a sight.

    Args:
        results: of a study; those without an interval are left out.
        path: the PNG to write; bands are intervals of LEVEL over seeds.
    """
    learned = [result for result in results if result.case.interval is not None]
    sights = _in_order(result.case.sight for result in learned)
    tasks, lengths = (_in_order(values) for values in zip(*_problems(learned), strict=True))
    figure = Figure(figsize=(4.4 * len(tasks), 3.0 * len(lengths)), layout="constrained")
    panels = figure.subplots(len(lengths), len(tasks), squeeze=False)
    for row, steps in enumerate(lengths):
        for column, task in enumerate(tasks):
            axes = panels[row, column]
            axes.set(title=f"{task}, {steps} steps", xlabel="mean interval [frames]", ylabel="score on test episodes")
            for number, sight in enumerate(sights):
                _draw_sight(axes, learned, (task, steps, sight), f"C{number}")
            axes.axhline(0, color="0.8", linewidth=0.8, zorder=0)
            if axes.get_legend_handles_labels()[1]:
                axes.legend(
                    frameon=False, fontsize="small", title="sees, processor time of training", title_fontsize="small"
                )
    with whole_file(path) as beside:
        figure.savefig(beside, format="png", dpi=110)


def _draw_sight(axes: Axes, results: Sequence[Result], whose: tuple[str, int, str], colour: str) -> None:
    """The line of a task, a length of training and a sight, with its band and its time of training."""
    own = [result for result in results if _whose(result) == whose]
    if not own:
        return
    intervals = np.array(sorted({float(result.case.interval or 0.0) for result in own}))
    mean, half = np.array([mean_of_seeds([*_scores(own, *whose, light).values()]) for light in intervals]).T
    minutes = float(np.mean([result.cpu_s for result in own])) / 60
    axes.semilogx(intervals, mean, f"{colour}.-", label=f"{whose[2]}, {minutes:.1f} min")
    axes.fill_between(intervals, mean - half, mean + half, color=colour, alpha=0.15, linewidth=0)
    axes.set_xticks(intervals, [f"{interval:g}" for interval in intervals], minor=False)
    axes.set_xticks([], minor=True)
    axes.set_ylim(-0.15, 1.1)


def _whose(result: Result) -> tuple[str, int, str]:
    return result.case.task, result.case.steps, result.case.sight


def _scores(results: Sequence[Result], task: str, steps: int, sight: str, interval: float | None) -> dict[int, float]:
    """Scores by seed."""
    return {
        result.case.seed: result.score
        for result in results
        if _whose(result) == (task, steps, sight) and result.case.interval == interval
    }


def _gain(scores: dict[int, float], others: dict[int, float]) -> str | None:
    """Over the others, of the seeds that both have."""
    both = [scores[seed] - others[seed] for seed in scores if seed in others]
    return str(mean_of_seeds(both)) if both else None


def _problems(results: Sequence[Result]) -> list[tuple[str, int]]:
    """(task, steps of training), in the order of the results."""
    return _in_order((result.case.task, result.case.steps) for result in results)


def _in_order(values: Any) -> list[Any]:
    return list(dict.fromkeys(values))
