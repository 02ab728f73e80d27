"""Figures over a quantity: a study that was played at several lights, or levels, as a table and as a picture.

    score(sight, light) = mean over seeds +- t(0.975, seeds - 1) sd / sqrt(seeds)

    gain(sight, light)  = the same of (score - score of the first sight), seed by seed

A column is a sight, with its learner where that is not ours.  The first is the one that others are compared with.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from scipy import stats

from spikecam_env.agents.study import LEARNERS, Result, StudyRun, mean_known
from spikecam_env.whole import whole_file

CONFIDENCE = 0.95
"""Of the intervals."""


class MeanOfSeeds(NamedTuple):
    """A mean, and the half of its interval of CONFIDENCE; NaN of one seed."""

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
    t = float(stats.t.ppf((1 + CONFIDENCE) / 2, count - 1))
    return MeanOfSeeds(float(numbers.mean()), t * float(numbers.std(ddof=1)) / count**0.5)


@dataclass(frozen=True)
class Over:
    """What a study is drawn over, and which figure."""

    name: str
    """Of the quantity."""
    value: Callable[[StudyRun], float | None]
    """Of a case; None where the study did not vary it."""
    figure: str
    """Name of the figure."""
    of: Callable[[Result], float]
    """The figure of a result."""
    has_decades: bool
    """Whether the quantity's axis is logarithmic."""


LIGHT = Over("interval [frames]", lambda case: case.interval, "score", lambda result: result.score, True)
"""Scores over mean intervals."""
LEVELS = Over("level", lambda case: case.level, "success", lambda result: result.success or 0.0, False)
"""Shares of successes over levels of MuJoCo tasks."""

Problem = tuple[str, int, float | None]
"""Task, steps of training, and the value of the quantity that is not drawn over."""


def rows_over(results: Sequence[Result], over: Over) -> list[dict[str, Any]]:
    """A row a task, length of training and value: the figure of each sight, its bits a second, and its gain.

    Args:
        results: of a study; those that have no value are left out.
        over: LIGHT or LEVELS.

    Example:
        >>> runs = [StudyRun(task="Return-v1", sight="oracle", level=level) for level in (1, 2)]
        >>> rows_over([Result(case=run, score=1.0, success=1.0) for run in runs], LEVELS)[1]
        {'task': 'Return-v1', 'steps': 0, 'level': '2', 'oracle': '1.000'}
    """
    known = [result for result in results if over.value(result.case) is not None]
    series = _in_order(_series(result.case) for result in known)
    rows = []
    for problem in _problems(known, over):
        task, steps, other = problem
        for value in _in_order(over.value(result.case) for result in known):
            own = {name: _own(known, problem, name, over, value) for name in series}
            figures = {name: _figures(its, over) for name, its in own.items()}
            head = {"task": task, "steps": steps} | ({} if other is None else {_other(over).name: f"{other:g}"})
            row = head | {over.name: f"{value:g}"}
            row |= {name: str(mean_of_seeds([*its.values()])) if its else None for name, its in figures.items()}
            row |= {f"{name} - {series[0]}": _gain(figures[name], figures[series[0]]) for name in series[1:]}
            bits = {name: mean_known(result.camera_bits_s for result in its) for name, its in own.items()}
            rows.append(row | {f"{name} [Mbit/s]": None if its is None else its / 1e6 for name, its in bits.items()})
    empty = {f"{name} [Mbit/s]" for name in series if all(row[f"{name} [Mbit/s]"] is None for row in rows)}
    return [{name: value for name, value in row.items() if name not in empty} for row in rows]


def draw_over(results: Sequence[Result], over: Over, path: Path) -> None:
    """Draw the figure over the quantity: a column a task, a row a length of training, a colour a sight.

    Args:
        results: of a study; those that have no value are left out.
        over: LIGHT or LEVELS.
        path: the PNG to write; bands are intervals of CONFIDENCE over seeds.

    Example:
        >>> runs = [StudyRun(task="Return-v1", sight="oracle", level=level) for level in (1, 2)]
        >>> draw_over([Result(case=run, score=1.0, success=1.0) for run in runs], LEVELS, Path("levels.png"))
    """
    known = [result for result in results if over.value(result.case) is not None]
    series, problems = _in_order(_series(result.case) for result in known), _problems(known, over)
    tasks, rows = _in_order(task for task, *_ in problems), _in_order(tuple(further) for _, *further in problems)
    figure = Figure(figsize=(4.4 * len(tasks) + LEGEND_INCHES, 3.0 * len(rows)), layout="constrained")
    panels = figure.subplots(len(rows), len(tasks), squeeze=False)
    for row, (steps, other) in enumerate(rows):
        for column, task in enumerate(tasks):
            axes, at = panels[row, column], "" if other is None else f", {_other(over).name} {other:g}"
            axes.set(title=f"{task}, {steps} steps{at}", xlabel=over.name, ylabel=f"{over.figure} on test episodes")
            for number, name in enumerate(series):
                own = _own(known, (task, steps, other), name, over)
                if own:
                    _draw_series(axes, own, over, name, f"C{number}")
            axes.axhline(0, color="0.8", linewidth=0.8, zorder=0)
            if axes.get_legend_handles_labels()[1]:
                place = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5)} if column == len(tasks) - 1 else {}
                axes.legend(frameon=False, fontsize="small", title=LEGEND, title_fontsize="small", **place)
    with whole_file(path) as beside:
        figure.savefig(beside, format="png", dpi=110)


LEGEND = "sees, camera, processor time of training"
LEGEND_INCHES = 2.6
"""Width beside the last panel, for its legend: many cameras would hide curves [inches]."""


def _draw_series(axes: Axes, own: Sequence[Result], over: Over, name: str, colour: str) -> None:
    """The line of a sight with its band, dashed where it learns nothing; its bits and its time of training in words."""
    values = np.array(sorted({float(over.value(result.case) or 0.0) for result in own}))
    figures = [_figures([result for result in own if over.value(result.case) == value], over) for value in values]
    mean, half = np.array([mean_of_seeds([*its.values()]) for its in figures]).T
    bits, minutes = mean_known(result.camera_bits_s for result in own), mean_known(result.cpu_s / 60 for result in own)
    label = name + ("" if bits is None else f", {bits / 1e6:.3g} Mbit/s") + (f", {minutes:.1f} min" if minutes else "")
    draw = axes.semilogx if over.has_decades else axes.plot
    draw(values, mean, f"{colour}{'.-' if own[0].case.steps else '.--'}", label=label)
    axes.fill_between(values, mean - half, mean + half, color=colour, alpha=0.15, linewidth=0)
    axes.set_xticks(values, [f"{value:g}" for value in values], minor=False)
    axes.set_xticks([], minor=True)
    axes.set_ylim(-0.15, 1.1)


def _other(over: Over) -> Over:
    return LEVELS if over is LIGHT else LIGHT


def _series(case: StudyRun) -> str:
    """Name of a line and a column."""
    return case.sight if case.learner == LEARNERS[0] else f"{case.sight}, {case.learner}"


def _problem(result: Result, over: Over) -> Problem:
    return result.case.task, result.case.steps, _other(over).value(result.case)


def _own(
    results: Sequence[Result], problem: Problem, name: str, over: Over, value: float | None = None
) -> list[Result]:
    """Results of a sight; those that learned nothing stand beside every length of training."""
    task, _, other = problem
    return [
        result
        for result in results
        if _series(result.case) == name
        and _problem(result, over) in (problem, (task, 0, other))
        and value in (None, over.value(result.case))
    ]


def _figures(results: Sequence[Result], over: Over) -> dict[int, float]:
    """By seed."""
    return {result.case.seed: over.of(result) for result in results}


def _gain(figures: dict[int, float], others: dict[int, float]) -> str | None:
    """Over the others, of the seeds that both have."""
    both = [figures[seed] - others[seed] for seed in figures if seed in others]
    return str(mean_of_seeds(both)) if both else None


def _problems(results: Sequence[Result], over: Over) -> list[Problem]:
    """In the order of the results; what learned nothing makes none of its own where others of its task learned."""
    problems: list[Problem] = _in_order(_problem(result, over) for result in results)
    learned = {(task, other) for task, steps, other in problems if steps}
    return [problem for problem in problems if problem[1] or (problem[0], problem[2]) not in learned]


def _in_order(values: Any) -> list[Any]:
    return list(dict.fromkeys(values))
