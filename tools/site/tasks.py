"""The page of a task: its class as its docstring describes it, and its rows of the tables of scores."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from spikecam_env.envs.mujoco_tasks import MUJOCO_TASKS
from spikecam_env.envs.tasks import TASKS
from tools.site.sections import rows_of, section

DOCS = Path(__file__).resolve().parents[2] / "docs"
SCORES = {
    "environments.md": ("Baselines", "Test episodes of `spikecam evaluate tasks --episodes 20`"),
    "agents.md": ("Scores", "Agents on test episodes"),
}
"""Section of a page whose first table has scores, and how the task's page introduces its rows."""


def page(name: str) -> str:
    """Markdown below the title and the film of a task, e.g. of `Track`."""
    return "\n".join([*_class(name), "## Scores", "", *_scores(name)])


def _class(name: str) -> Iterator[str]:
    kind = (TASKS | MUJOCO_TASKS)[name]
    yield from (f"Ids: `spikecam_env/{name}-v1` (64 x 64), `spikecam_env/{name}-Full-v1` (250 x 400).", "")
    yield from ("```{eval-rst}", f".. autoclass:: {kind.__module__}.{kind.__name__}", "```", "")
    yield from ("[Tasks](../environments.md): observation, action, reward and score, which all tasks share.", "")


def _scores(name: str) -> Iterator[str]:
    for file, (title, introduced) in SCORES.items():
        rows = rows_of(section((DOCS / file).read_text(encoding="utf-8"), title), f"{name}-v1")
        if rows:
            yield from (f"{introduced} ([{title.lower()}](../{file}#{title.lower()})):", "", *rows, "")
