"""The stages of a diagnosis as a picture for the documentation.

python -m tools.diagnosis_figure docs/explanation/diagnosis.svg
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from spikecam_env.whole import whole_file

Stage = tuple[str, str]
"""Name, and its work in two lines."""

BEFORE: tuple[Stage, ...] = (
    ("read", "recordings\nto numbers"),
    ("audit", "wrong labels?\nmotion?"),
    ("refit", "this unit's gain,\ndark level, jitter"),
    ("twins", "simulate the unit\nunder the model"),
    ("alarm", "do statistics\ndisagree?"),
)
SEARCH: tuple[Stage, ...] = (
    ("screen", "which effects\ncould do this?"),
    ("fit", "simulate with\neach effect"),
    ("confirm", "more twins,\nheld-out data"),
    ("add", "the best one;\nrefit all found"),
)
AFTER: tuple[Stage, ...] = (
    ("gate", "is anything left\nbeyond chance?"),
    ("verdict", "name, class\nor structure"),
    ("bounds", "limits on effects\nnot named"),
)
ROWS = ((BEFORE, "#dbe7f5"), (SEARCH, "#fbe6cf"), (AFTER, "#dcefdc"))

WIDTH, HEIGHT, STEP, RISE = 1.5, 0.86, 1.85, 1.45
"""Of a box, from box to box, from row to row [figure units of an inch]."""


def main(words: Sequence[str]) -> None:
    """Draw the picture into the one file named."""
    if len(words) != 1:
        sys.exit("give one file, e.g. python -m tools.diagnosis_figure docs/explanation/diagnosis.svg")
    with whole_file(Path(words[0])) as beside:
        draw(beside)


def draw(path: Path) -> None:
    """Write the picture; the same text gives the same bytes with one version of matplotlib."""
    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "diagnosis"})
    fig, axes = plt.subplots(figsize=(9.4, 4.2))
    for number, (stages, colour) in enumerate(ROWS):
        for place, stage in enumerate(stages):
            _box(axes, place * STEP, -number * RISE, stage, colour)
            if place:
                _arrow(axes, ((place - 1) * STEP + WIDTH, -number * RISE), (place * STEP, -number * RISE))
    _lead(axes, 0, "yes")
    _lead(axes, 1, "nothing better")
    _back(axes)
    axes.text(4 * STEP + WIDTH / 2 + 0.1, -HEIGHT / 2 - 0.2, "no: verdict, bounds", fontsize=8.5)
    axes.set(xlim=(-0.1, 4 * STEP + WIDTH + 0.65), ylim=(-2 * RISE - HEIGHT * 0.6, HEIGHT * 0.7))
    axes.axis("off")
    fig.subplots_adjust(0, 0, 1, 1)
    fig.savefig(path, format="svg", metadata={"Date": None}, facecolor="white")
    plt.close(fig)


def _box(axes: Axes, x: float, y: float, stage: Stage, colour: str) -> None:
    style = "round,pad=0,rounding_size=0.08"
    box = matplotlib.patches.FancyBboxPatch(
        (x, y - HEIGHT / 2), WIDTH, HEIGHT, boxstyle=style, facecolor=colour, edgecolor="#444"
    )
    axes.add_patch(box)
    axes.text(x + WIDTH / 2, y + 0.24, stage[0], ha="center", va="center", weight="bold", fontsize=11)
    axes.text(x + WIDTH / 2, y - 0.13, stage[1], ha="center", va="center", fontsize=8.5)


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": "#444", "shrinkA": 1, "shrinkB": 1})


def _lead(axes: Axes, number: int, word: str) -> None:
    """From the end of a row to the first box of the next."""
    last = (len(ROWS[number][0]) - 1) * STEP + WIDTH / 2
    top, middle, first = -number * RISE - HEIGHT / 2, -(number + 0.5) * RISE, WIDTH / 2
    axes.plot([last, last, first], [top, middle, middle], color="#444", linewidth=1)
    _arrow(axes, (first, middle), (first, middle - RISE / 2 + HEIGHT / 2))
    axes.text(first + 0.1, middle + 0.05, word, fontsize=8.5)


def _back(axes: Axes) -> None:
    """From the last box of the search to its first: one effect after another."""
    last, y = (len(SEARCH) - 1) * STEP + WIDTH, -RISE
    axes.plot([last, last + 0.35, last + 0.35], [y, y, y + HEIGHT / 2 + 0.15], color="#444", linewidth=1)
    axes.plot([last + 0.35, WIDTH / 2 + 0.4], [y + HEIGHT / 2 + 0.15] * 2, color="#444", linewidth=1)
    _arrow(axes, (WIDTH / 2 + 0.4, y + HEIGHT / 2 + 0.15), (WIDTH / 2 + 0.4, y + HEIGHT / 2))
    axes.text(last + 0.42, y, "something\nis left", fontsize=8.5, va="center")


if __name__ == "__main__":
    main(sys.argv[1:])
